"""The page ``docs/value_functions.md``. Every number in it comes from result files."""

from collections.abc import Sequence

import numpy as np

from fnnq_torchrl.studies.experiments import NoResults
from fnnq_torchrl.studies.reproduction.markdown import table
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.results import CONFIDENCE

from .aloud import Aloud
from .learners import (
    BALL,
    CHOICES,
    FUZZY,
    LAST,
    WORLDS,
    Learner,
    Numbers,
    World,
    in_world,
    settings_of,
)

_FAILS = 0.25
"""The share of failing runs from which the page says so of a learner."""

_WHY: dict[tuple[str, str], str] = {
    ("mountain_car", "mlp"): (
        "In 200 episodes it learns little from single steps. Whether more exploration helps can't "
        "be told: over 50 other seeds it needs 744 [669, 819] steps with ε = 0.1, and 787 "
        "[709, 866] with ε = 0, as here."
    ),
    ("acrobot", "rbf"): (
        "The reason isn't known. With ε = 0.1 and 50 other seeds, five evenly spaced labels for "
        "each input need 334 [311, 357] steps, and three need 470 [456, 483]. That is no better "
        "than three labels by hand without exploration, as here."
    ),
    ("acrobot", "table"): (
        "A cell is a third of the range of each of the four numbers, so it holds states that need "
        "different actions."
    ),
}
"""The explanation of each learner that often fails, by the kinds of its world and itself."""

_PAGE = """# Value functions on the classic worlds

What do readable rules cost, and what do they bring? Here the fuzzy network (`fnnq`) learns Mountain
Car, Cart-Pole and Acrobot beside fuzzy Q-learning (`fuzzy_q`), radial basis functions (`rbf`), a
look-up table (`table`), tiles (`tiles`) and a perceptron (`mlp`). [values.md](values.md) explains
them.

{in_short}
`make values` writes this page from result files; only the explanations of failures, with their
numbers, were written by hand.

## How they are compared

Each value function has its own best λ and α in each world. A sweep chose them on {choosers} seeds,
by the mean over all episodes learned from (`+experiment=values_sweep`). {judges} others judge them
(`+experiment=values`), so the luck of the choice isn't part of the result. In both, a run learns
from {situations} episodes. The trace, the variant of Q(λ) and the size of the network are those of
`conf/tuned/`, γ and ε those of `conf/learner/`; on Mountain Car an episode ends after 1,000 steps.
If the best λ or α is the first or last of the sweep, a better one may lie beyond. Brackets are
{confidence:g} % bootstrap intervals (BCa). *While learning* is the mean over all tests after
learning began, *after learning* the mean over the last {last}. The tests are greedy. A run *fails*
if it is no better after learning than the mean before it. A run that has diverged counts as the
worst possible.

![Learning curves](figures/value_functions.png)

{worlds}
![The sweep](figures/value_functions_sweep.png)

## The paper's network and fuzzy Q-learning on the ball

{ball_choosers} seeds chose and {ball_runs} others judge. The robot is the paper's (`task=follow`),
and both have the paper's labels.

{ball}
## The rules for Mountain Car, read aloud

{aloud}"""


def write_page(learners: Sequence[Learner], aloud: Sequence[Aloud]) -> str:
    """Return the text of the page.

    Args:
        learners: all learners.
        aloud: the controllers on Mountain Car of the fuzzy network and of fuzzy Q-learning.

    Raises:
        NoResults: if a learner that the page needs is missing.
    """
    classic = [each for each in learners if each.world in WORLDS]
    ball = in_world(learners, BALL)
    if not classic or not ball:
        raise NoResults("values must have jobs in the classic worlds and on the ball")
    return _PAGE.format(
        in_short="".join(f"* {each}\n" for each in (_readable(aloud), *_in_short(learners))),
        choosers=min(job.evaluations.runs for each in classic for job in each.sweep),
        judges=min(each.judged.evaluations.runs for each in classic),
        situations=classic[0].judged.config.situations,
        confidence=100 * CONFIDENCE,
        last=LAST,
        worlds="\n".join(_of_world(learners, world) for world in WORLDS),
        ball_runs=f"{min(each.judged.evaluations.runs for each in ball):,}",
        ball_choosers=min(job.evaluations.runs for each in ball for job in each.sweep),
        ball=_table(ball),
        aloud="\n".join(map(_read, aloud)),
    )


def _readable(aloud: Sequence[Aloud]) -> str:
    """Return what it costs that each rule has one action, on Mountain Car."""
    told = []
    for each in aloud:
        full, short = _steps(each)
        told.append(f"`{each.job.config.value.kind}` {short} instead of {full}")
    return (
        "**Readable rules**: if each rule has one action, as printed below, the steps to the goal "
        f"on Mountain Car are, in the last test: {', '.join(told)}."
    )


def _in_short(learners: Sequence[Learner]) -> list[str]:
    """Return the findings, a sentence or two each."""
    lines = []
    for world in (*WORLDS, BALL):
        best, *others = in_world(learners, world)
        line = f"**{world.title}**: after learning, `{best.value}` is best, with {_words(best)} "
        line += f"{world.measure} and {best.weights:,} weights."
        for other in others:
            if other.value in (FUZZY, CHOICES):
                line += f" `{other.value}` has {_words(other)}, {_difference(other, best)} of "
                line += f"difference, with {other.weights:,} weights."
        lines.append(line)
    failing = [
        f"`{each.value}` on {each.world.title} ({each.failed:.0%})"
        for each in learners
        if each.failed >= _FAILS
    ]
    lines.append(f"**Failing in a quarter of the runs or more**: {', '.join(failing) or 'none'}.")
    return lines


def _words(learner: Learner) -> str:
    return _interval(bootstrap_interval(np.mean, learner.afterwards), learner.world)


def _difference(ours: Learner, theirs: Learner) -> str:
    found = paired_difference(ours.afterwards, theirs.afterwards).mean
    return _interval(found, ours.world, signed=True)


def _interval(interval: Interval, world: World, *, signed: bool = False) -> str:
    sign, digits = "+" if signed else "", world.digits
    value, low, high = (f"{x:{sign}z.{digits}f}" for x in interval)
    return f"{value} [{low}, {high}]"


def _of_world(learners: Sequence[Learner], world: World) -> str:
    found = in_world(learners, world)
    limit = found[0].judged.config.env.time_limit_steps
    better = "more" if world.sign > 0 else "fewer"
    measure = (
        f"The measure is the number of {world.measure}, at most {limit:,}; {better} are better."
    )
    lines = [f"## {world.title}\n", f"{measure}\n", _table(found)]
    for learner in found:
        if learner.failed >= _FAILS:
            why = _WHY.get((world.kind, learner.value), "The reason isn't known.")
            lines.append(
                f"**`{learner.value}` fails** in {learner.failed:.0%} of the runs. {why}\n"
            )
    return "\n".join(lines)


def _table(found: Sequence[Learner]) -> str:
    heads = [
        "",
        "weights",
        "λ",
        "α",
        "before",
        "while learning",
        "after learning",
        "runs that fail",
    ]
    rows = []
    for learner in found:
        lam, alpha = settings_of(learner.judged)
        best = "" if learner.is_best else " (sweep's best: λ = {:g}, α = {:g})"
        samples: list[Numbers] = [learner.meanwhile, learner.afterwards]
        rows.append(
            [
                f"`{learner.value}`",
                f"{learner.weights:,}",
                f"{lam:g}",
                f"{alpha:g}" + best.format(*settings_of(learner.best)),
                f"{learner.before.mean():.{learner.world.digits}f}",
                *(_interval(bootstrap_interval(np.mean, each), learner.world) for each in samples),
                f"{learner.failed:.0%}",
            ]
        )
    return table(heads, rows)


def _read(aloud: Aloud) -> str:
    """Return the controller of the best run in words, and how well it and the others' play."""
    value = aloud.job.config.value.kind
    full, short = _steps(aloud)
    of = aloud.moving("velocity")
    along = aloud.along("velocity")
    drives = (
        "Its greedy policy is this controller."
        if value == CHOICES
        else "Distilled, each pair of labels has one action, in place of the best of the network."
    )
    return (
        f"### `{value}`, {aloud.best.words}\n\n"
        f"{drives} The action in brackets goes from 0 (reverse) to 2 (forward).\n\n"
        f"{aloud.grid()}\n"
        f"Of the {of} rules about a moving car, {along.mean():.1f} push along its motion, in the "
        f"mean over {len(along)} runs. In the last test the greedy policies need "
        f"{full} steps to the goal; such rules alone need {short}.\n"
    )


def _steps(aloud: Aloud) -> tuple[str, str]:
    """Return the steps to the goal of the greedy policies and of the rules alone, in words."""
    full, short = (
        _interval(bootstrap_interval(np.mean, -scores), WORLDS[0])
        for scores in (aloud.full, aloud.short)
    )
    return full, short
