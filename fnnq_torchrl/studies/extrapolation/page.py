"""The text of docs/extrapolation.md. Every number in it is computed from results."""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.equations.membership import firing_shares
from fnnq_torchrl.equations.membership_functions import rule_width
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.statistics import bootstrap_interval
from fnnq_torchrl.training.results import CONFIDENCE

from .conclusions import CATCHES, MOVES, conclusions, forgetting_conclusion
from .findings import FAR_RAD, INTERFERENCE_AFTER, Findings, decayed_alpha
from .forgetting import FirstSide
from .learners import Learner
from .playing import ANGLES_RAD, SPEEDS_RADPS, TESTS
from .step_sizes import best_steps, step_words

_PAGE = """# Does it extrapolate?

The paper says that its fuzzy neural network, a local approximator, doesn't extrapolate into parts
of the space that it hasn't seen, or does so less than a multilayer perceptron. The paper gives no
experiment. This page has one, over {runs} seeds of each value function. Movement is given per unit
of the movement where states were seen.

{conclusions}

{outermost}

{share}

`make extrapolation` writes this page from result files; no number in it was typed by hand.

## What was done

* *Compact labels.* The paper's claim is on compact membership functions, but its own are Gaussian,
  as are those of `fnnq` here. So there are rows for labels of the bearing that are 0 outside a
  range: five triangles at the paper's centres, each reaching to its neighbours' centres; five
  trapezoids; and 21 narrow triangles, 0.1 rad apart. The outermost ones reach beyond the field of
  view.
* *Learning on the left.* For {switch} situations the ball starts on the left of straight ahead (φ₀
  ≥ 0). The head sees it from {view:g} rad on the left to {other:g} rad on the right, and reports a
  ball farther to the right at that edge. So no state with Δθ < −{other:g} rad occurs, and the
  *unseen* side is −{view:g} ≤ Δθ < −{other:g}. One step turns the robot by about {other:g} rad; if
  the head saw less, the robot couldn't tell on which side it has lost the ball.
* *Learning on the right.* For {then} more situations all is mirrored: the unseen side is seen, and
  the far left is not. α goes on from where it was: at × {decay:g} a catch, it is down to
  {decayed:.2g} of its initial value after {switch} catches. So less is learned, and less is
  forgotten, than with a larger α. Therefore everything is repeated with a constant α of the same
  initial value.
* *Movement* of Q at a state is √(meanₐ(Q − Q₀)²), where Q₀ is Q before learning and a are the
  candidate actions. It is given per unit of its mean over the seen states, which are evenly spaced
  from −{other:g} to {view:g} rad.
* *Catches* are those of the greedy policy in {tests} tests on each side: φ₀ of {angles} rad on the
  left, and mirrored on the right, each with ω_b of {speeds} rad/s. In the tests the head sees both
  sides. A robot that loses the ball to the unseen side may find it again by chance. So there is a
  *control*: the same policy, but with random actions in all states that were not seen.
* *Interference* is |ΔQ(s′, a)|/|ΔQ(s, a)| after a single update of plain Q-learning at (s, a), with
  an error of one and the initial α. s is evenly spaced over the seen states and s′ over all
  states; a is −1, −0.5, 0, 0.5 and 1. α makes no difference where Q is linear in its weights. For
  the other value functions interference was measured with a decreased α, too.
* All other settings are the defaults. Brackets are {confidence:g} % bootstrap intervals (BCa) over
  the seeds, not corrected for their number. If Q moved by less than {moves:g} of the seen
  side's movement, it *stayed where it was*. A difference of fewer than {catches:g} catches *doesn't
  matter*. Both bounds are our choice.

## Step sizes

Unless a remark says otherwise, each value function has the step size α with the best mean score,
out of five, on the ordinary task (`+experiment=value_functions`, {sweep_runs:,} seeds
each{disjoint}). The first half of those seeds chooses the best α, and the second half gives its
score:

{steps}
{diverged}

## Q where it was seen and where it was not

![V against the bearing at three moments](figures/extrapolation_values.png)

![Movement of Q against the bearing](figures/extrapolation_movement.png)

{movement}
*Beyond* means outside the field of view, up to 1.5 rad on either side. The sensor reports at most
±{view:g} rad, so these states never occur, neither in learning nor in tests. The last two columns
are the change of the greedy action from the edge of the view to beyond it, in units of Δv.

{towards}
## Catches, and what is forgotten

![Catches on either side at three moments](figures/extrapolation_catches.png)

{caught}
With a constant α instead:

{constant}
## Interference

![Interference against the distance of two states](figures/extrapolation_interference.png)

{spread}
## Was nothing seen?

The ball starts on one side, but the robot may turn past it and see it on the other. So every fourth
snapshot played the situation that came next, exploring as in learning: once with the head that it
learned with, and once with a head that sees both sides.

{seen}
"""


def write_page(
    findings: Sequence[Findings], constant: Sequence[FirstSide], sweep: Experiment
) -> str:
    """Return the text of the page.

    Args:
        findings: the measurements on each value function.
        constant: the catches on the first side of each value function with a constant α.
        sweep: the sweep over value functions and step sizes on the ordinary task.

    Raises:
        NoResults: if the sweep lacks a value function.
    """
    by_kind = {each.kind: each for each in findings}
    first = findings[0].learner.config
    lines = [*conclusions(by_kind), forgetting_conclusion(constant)]
    return _PAGE.format(
        runs=min(each.learner.runs for each in findings),
        conclusions="\n".join(f"* {line}" for line in lines),
        share=_nothing_seen(findings),
        switch=first.env.switch_side_after,
        then=first.situations - first.env.switch_side_after,
        view=first.env.field_of_view_rad,
        other=first.env.other_view_rad,
        tests=TESTS,
        angles=", ".join(f"{angle:g}" for angle in ANGLES_RAD),
        speeds=" and ".join(f"{speed:g}" for speed in SPEEDS_RADPS),
        confidence=100 * CONFIDENCE,
        moves=MOVES,
        catches=CATCHES,
        sweep_runs=sweep.runs,
        disjoint=_disjoint(findings, sweep),
        steps=_steps([each.learner for each in findings], sweep),
        diverged=_diverged(findings, constant, sweep),
        decay=first.alpha_decay,
        decayed=first.alpha_decay**first.env.switch_side_after,
        movement=_movement(findings),
        towards=_towards(findings),
        outermost=_outermost(by_kind["fnnq"].learner),
        caught=_caught(findings),
        constant=_constant(constant),
        spread=_spread(findings),
        seen=_seen(findings),
    )


def _nothing_seen(findings: Sequence[Findings]) -> str:
    most = max(float(each.hidden.max()) for each in findings)
    right = [float(each.would_see[:, 0].mean()) for each in findings]
    return (
        f"A check: at most {most:.2%} of the states that a run visited while learning on the left "
        "were on the unseen side. Starting the ball on the left alone would not hide that side: "
        f"with a head that sees both sides, {min(right):.0%} to {max(right):.0%} of the states, on "
        "average over the runs, would have been to the right of straight ahead."
    )


def _steps(learners: Iterable[Learner], sweep: Experiment) -> str:
    best = best_steps(sweep)
    rows = [step_words(best, learner.kind, learner.config.alpha) for learner in learners]
    return table(["", "α here", "best α", "of α from", "its mean score", ""], rows)


def _disjoint(findings: Sequence[Findings], sweep: Experiment) -> str:
    """Return a remark if no seed of the sweep is a seed of the findings, else an empty text."""
    chosen = {int(seed) for job in sweep.jobs for seed in job.evaluations.seed}
    used = {int(seed) for each in findings for seed in each.learner.snapshots.seed}
    return "" if chosen & used else ", none of them used below"


def _diverged(
    findings: Sequence[Findings], constant: Sequence[FirstSide], sweep: Experiment
) -> str:
    runs = [*(each.learner.diverged for each in findings), *(each.diverged for each in constant)]
    here = sum(int(diverged.any(axis=1).sum()) for diverged in runs)
    there = sum(job.evaluations.diverged_runs for job in sweep.jobs)
    return (
        f"Runs that diverged: {here} below, {there} in the sweep. A diverged run catches nothing "
        "from then on, and its Q is not measured. Forgetting is measured over the runs that had "
        "not diverged on the first side."
    )


def _movement(findings: Sequence[Findings]) -> str:
    rows = [
        [
            f"`{each.kind}`",
            *(
                _mean(each.moved_in(region))
                for region in (
                    each.where.unseen,
                    each.where.beyond_seen,
                    each.where.beyond_unseen,
                )
            ),
            *map(_mean, each.beyond.T),
        ]
        for each in findings
    ]
    head = [
        "movement per unit of the seen side",
        "unseen side",
        "beyond, seen side",
        "beyond, unseen side",
        "greedy action beyond, seen side",
        "unseen side",
    ]
    return table(head, rows)


def _outermost(learner: Learner) -> str:
    """Return a sentence on the outermost label's firing share at the edge of the seen side."""
    labels = learner.config.value.inputs["bearing"]
    centres, seconds = torch.tensor(labels, dtype=torch.float64).T
    widths = [rule_width(float(second), learner.config.value.width) for second in seconds]
    shares = firing_shares(torch.tensor(learner.edge_rad), centres, 1 / torch.tensor(widths))
    share = float(shares[centres.argmin()])
    return (
        f"At the edge of what is seen, {learner.edge_rad:g} rad, the fuzzy network's outermost "
        f"label, at {centres.min():g} rad, has {share:.0%} of the firing strength. Farther out it "
        "has nearly all. So what is learned at the edge also holds for everything beyond it."
    )


def _caught(findings: Sequence[Findings]) -> str:
    rows = []
    for each in findings:
        of_sides = [_mean(each.caught[:, moment, side]) for side in range(2) for moment in range(3)]
        gains = [each.helped, each.first_side.kept]
        gained = [_mean(gain, signed=True) for gain in gains]
        rows.append([f"`{each.kind}`", *of_sides, _mean(each.control), *gained])
    moments = ("before", "after the left", "after the right")
    head = [
        f"catches of {TESTS}",
        *(f"{side}, {moment}" for side in ("left", "right") for moment in moments),
        "right, after the left: control",
        "right: gained on control",
        "left: gained on the right",
    ]
    return table(head, rows)


def _spread(findings: Sequence[Findings]) -> str:
    rows = [[f"`{each.kind}`", *map(_mean, each.far)] for each in findings]
    first = findings[0].learner.config
    head = [
        f"after {INTERFERENCE_AFTER[-1]} situations",
        f"interference at {FAR_RAD:g} to 1 rad",
        f"with {decayed_alpha(first) / first.alpha:.2g} of the α",
    ]
    return table(head, rows)


def _constant(constant: Sequence[FirstSide]) -> str:
    rows = [
        [
            f"`{each.kind}`",
            *map(_mean, each.caught.T),
            _mean(each.kept, signed=True),
            f"{each.diverged[:, 1].sum()}",
        ]
        for each in constant
    ]
    sides = ["left, after the left", "left, after the right"]
    return table([f"catches of {TESTS}", *sides, "gained", "diverged runs"], rows)


def _towards(findings: Sequence[Findings]) -> str:
    rows = [[f"`{each.kind}`", *map(_mean, each.towards.T)] for each in findings]
    head = ["share of states where the greedy action turns towards the ball", "seen side"]
    return table([*head, "unseen side"], rows)


def _seen(findings: Sequence[Findings]) -> str:
    other = findings[0].learner.config.env.other_view_rad
    rows = [
        [
            f"`{each.kind}`",
            *(_mean(share) for share in (each.hidden, each.would_see[:, 1], each.would_see[:, 0])),
        ]
        for each in findings
    ]
    head = [
        "share of the states visited",
        f"Δθ < −{other:g}, as it learned",
        f"Δθ < −{other:g}, both sides seen",
        "Δθ < 0, both sides seen",
    ]
    return table(head, rows)


def _mean(samples: NDArray[np.float64], signed: bool = False) -> str:
    return interval_words(bootstrap_interval(np.mean, samples), signed)
