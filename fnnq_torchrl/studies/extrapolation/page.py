"""The page itself, in Markdown. Every number in it comes from the results."""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.equations.membership import firing_shares, rule_width
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

Written by `make extrapolation` from result files; no number here was typed by hand.

The paper says that a local approximator such as its fuzzy neural network doesn't extrapolate into
parts of the space that it hasn't seen, and that a multilayer perceptron does. It gives no
experiment. Here is one, over {runs} seeds of each value function.

## In short

{conclusions}

{outermost}

{share}

## What was done

* *Learning on the left.* For {switch} situations the ball starts on the left of straight ahead (φ₀
  ≥ 0), and the head sees it from {view:g} rad on the left to {other:g} rad on the right: a ball
  farther to the right is reported at that edge. So no state with Δθ < −{other:g} rad occurs, and
  the *unseen* side is −{view:g} ≤ Δθ < −{other:g}. The {other:g} rad are about what one step turns
  the robot by; with less, it can't tell which way it has lost the ball.
* *Learning on the right.* For {then} more situations all is mirrored: what had been unseen is seen,
  and the far left is not. α isn't set back: × {decay:g} a catch, it is down to {decayed:.2g} of its
  start after {switch} catches, so less is learned here, and forgotten, than might be. Therefore all
  is done once more with an α that isn't decreased, but stays what was best at the start of one that
  is, to see what is forgotten then.
* *Movement* of Q at a state is √(meanₐ(Q − Q₀)²) over the candidate actions a, Q₀ being Q before
  learning, per unit of its mean over the seen states (evenly from −{other:g} to {view:g} rad).
* *Catches* are the greedy policy's, of {tests} tests on each side: φ₀ of {angles} rad on the left,
  its mirror images on the right, each with ω_b of {speeds} rad/s. In the tests the head sees both
  sides. A robot that loses the ball to the unseen side may find it again by chance. So there is a
  *control*: the same policy, but with random actions in all states that were not seen.
* *Interference* is |ΔQ(s′, a)|/|ΔQ(s, a)| after a single update of plain Q-learning, with an error
  of one and the α of the start, at (s, a): s over the seen states, s′ over all, evenly spaced; a of
  −1, −0.5, 0, 0.5 and 1. Where Q is linear in its weights α has no say in it; for the others it was
  measured with a decreased α, too.
* All else is as by default. Brackets are {confidence:g} % bootstrap intervals (BCa) over the seeds,
  each of which stands for itself. Q that has moved by less than {moves:g} of the seen side's
  movement *stayed where it was*, and fewer than {catches:g} catches *don't matter*; both are our
  choice.

## Step sizes

If a remark doesn't say otherwise, each value function has the step size α that was best on the
ordinary task, by the mean score of five (`+experiment=value_functions`, {sweep_runs:,} seeds
each{disjoint}). The best α is chosen by the first half of those seeds, its score is that of the
second half:

{steps}
{diverged}

## Q where it was seen and where it was not

![V against the bearing at three moments](figures/extrapolation_values.png)

![Movement of Q against the bearing](figures/extrapolation_movement.png)

{movement}
«Beyond» is what lies outside the field of view, up to 1.5 rad on either side. The sensor clips what
it reports at ±{view:g} rad, so these states never occur, in learning or in tests. The last two
columns are how far the greedy action there is from that at the edge of the view, in units of Δv.

{towards}
## Catches, and what is forgotten

![Catches on either side at three moments](figures/extrapolation_catches.png)

{caught}
The same where α isn't decreased, but stays what it was at the start:

{constant}
## Interference

![Interference against the distance of two states](figures/extrapolation_interference.png)

{spread}
## Was nothing seen?

The side on which the ball starts is not the side on which the robot sees it: it turns past the
ball. So every fourth snapshot played on from the situation that it was taken before, exploring as
it had learned, once with the head that it learned with, and once as if the head had seen both
sides:

{seen}
"""


def write_page(
    findings: Sequence[Findings], constant: Sequence[FirstSide], sweep: Experiment
) -> str:
    """The page.

    Args:
        findings: of each value function.
        constant: of each, where α isn't decreased.
        sweep: of their step sizes on the ordinary task.

    Raises:
        NoResults: the sweep lacks one.
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
        f"A check: of the states visited while learning on the left, {most:.2%} of any run at most "
        "were on the unseen side. The sign of φ₀ alone wouldn't have hidden it: with a head that "
        f"sees both sides, {min(right):.0%} to {max(right):.0%} of the states, on average over the "
        "runs, would have been to the right of straight ahead."
    )


def _steps(learners: Iterable[Learner], sweep: Experiment) -> str:
    best = best_steps(sweep)
    rows = [step_words(best, learner.kind, learner.config.alpha) for learner in learners]
    return table(["", "α here", "best α", "of α from", "its mean score", ""], rows)


def _disjoint(findings: Sequence[Findings], sweep: Experiment) -> str:
    """Whether the seeds that choose α are others than those that it is then used for."""
    chosen = {int(seed) for job in sweep.jobs for seed in job.evaluations.seed}
    used = {int(seed) for each in findings for seed in each.learner.snapshots.seed}
    return "" if chosen & used else ", others than in what follows"


def _diverged(
    findings: Sequence[Findings], constant: Sequence[FirstSide], sweep: Experiment
) -> str:
    runs = [*(each.learner.diverged for each in findings), *(each.diverged for each in constant)]
    here = sum(int(diverged.any(axis=1).sum()) for diverged in runs)
    there = sum(job.evaluations.diverged_runs for job in sweep.jobs)
    return (
        f"Runs that diverged: {here} in what follows, {there} in the sweep. From then on they "
        "count as catching nothing, and of their Q nothing is measured. Those that do so on the "
        "first side have nothing to forget."
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
    """How much of the rules that answer for the unseen side fires at the edge of the seen one."""
    labels = learner.config.value.inputs["bearing"]
    centres, seconds = torch.tensor(labels, dtype=torch.float64).T
    widths = [rule_width(float(second), learner.config.value.width) for second in seconds]
    shares = firing_shares(torch.tensor(learner.edge_rad), centres, 1 / torch.tensor(widths))
    share = float(shares[centres.argmin()])
    return (
        f"At the edge of what is seen, {learner.edge_rad:g} rad, the fuzzy network's outermost "
        f"label, that of {centres.min():g} rad, has {share:.0%} of the firing strength, and "
        "farther out nearly all of it. What is learned at the edge is learned for what lies beyond."
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
