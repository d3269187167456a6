"""The page docs/stream_q.md, written from the results."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ttest_ind

from benchmarks.tables import table
from envs.pictures import Figure, own_style
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import COLOURS, count_words, new_figure, quiet_grid
from fnnq_torchrl.training.results import CONFIDENCE

from .results import PARTS

TITLES = {
    "cart_pole": "CartPole-v1",
    "acrobot": "Acrobot-v1",
    "follow": "the paper's ball",
}
"""The title of each task."""

OURS, THEIRS, LONGER, FUZZY = "ours", "theirs", "longer", "fuzzy"

FEWEST = 3
"""The smallest number of runs that have an interval."""

_LEARNED = 0.85
"""The return on the ball, of −0.5 to 1, from which the task counts as learned: 90 % caught."""

_BAND = 10
"""The smallest number of runs that are drawn as a band; the runs of fewer are drawn singly."""

LAST = PARTS // 5
"""The number of parts at the end, over which the final return is taken."""

_WORDS = {
    OURS: "ours",
    THEIRS: "its authors' program",
    LONGER: "ours",
    FUZZY: "the paper's fuzzy network",
}

_NAMED = {
    OURS: "with our Stream Q(λ)",
    THEIRS: "with its authors' program",
    FUZZY: "with the paper's fuzzy network and our defaults",
}

_PAGE = """# Stream Q(λ)

Stream Q(λ) learns with a multilayer perceptron and eligibility traces, from each step once and
without a replay buffer: M. Elsayed, G. Vasan, A. R. Mahmood, *Streaming deep reinforcement learning
finally works*, 2024. This page runs its recipe with this program, and with the program of its
authors ([mohmdelsayed/streaming-drl](https://github.com/mohmdelsayed/streaming-drl)).

{conclusions}

![Return against learning steps](figures/stream_q.png)

`make stream-q` writes this page from result files. The authors' program isn't part of this
repository: its licence is CC BY-NC. The command fetches it. Without it, the page has what was
measured earlier, on {dates}.

## The recipe

γ = 0.99, λ = 0.8, ObGD with α = 1 and κ = 2; two hidden layers of 32 normalised units with leaky
relus, and an output for each action; nine of ten weights start at 0. ε falls from 1 to 0.01 over
the first 5 % of the steps. Observations are normalised by their running mean and variance, and
rewards divided by the running standard deviation of their discounted sum.

```
python -m fnnq_torchrl.train +experiment=stream_q
python -m fnnq_torchrl.train +experiment=stream_q task=acrobot env=acrobot env.cosines=true {longer}
```

The first command runs 50,000 steps in three tasks, as on this page. The second runs the authors'
500,000 steps in one of them.

## Returns

The measure is the return of the learning episodes, with exploration: the mean over all steps, and
over the last fifth of the steps. *Its worst run* is the lowest last fifth of any run. Both programs
have the time limit of Gymnasium's registry; the authors' program itself asks for 10,000 steps an
episode. Brackets are {confidence:g} % Student's t intervals over the seeds. In the task of the
ball, a catch is worth 1 and a miss −0.5, and all have 21 candidate actions.

{returns}
## What differs

* *Where the trace is cut.* Watkins' Q(λ) cuts the trace before an exploratory action, so that
  earlier pairs aren't credited with what follows it. The authors' program updates all earlier pairs
  with the exploratory action's error, and clears the trace after that.
* *Truncation.* An episode that is cut off at the time limit bootstraps from its last state here. In
  the authors' program its last target doesn't.
* *The first layer.* The program sets nine tenths of each unit's incoming weights to 0, rounded up:
  with fewer than ten inputs, that is all of them. Here at least one weight of each unit isn't 0.
  This explains the difference on the ball: changed in this alone, the authors' program caught 95 to
  99 % in the last fifth of its steps, in each of three runs.
* *Time.* The program adds the time within the episode to the observations, as a further input that
  rises from −0.5 to 0.5 up to the time limit.
* *Precision.* Statistics are float32 here and float64 there.
{angles}"""

_ANGLES = """\
* *Acrobot's observations.* Our runs observe the two angles, which jump from π to −π. The authors'
  program observes their cosines and sines, as ours does with `env.cosines=true`.
"""


class Series(NamedTuple):
    """The runs of one learner on one task with one number of steps.

    Attributes:
        task: a key of `TITLES`.
        who: ours, theirs, longer (ours with more steps) or fuzzy.
        steps: the number of learning steps.
        returns: the mean return in each part of the steps, ``[runs, PARTS]``.
    """

    task: str
    who: str
    steps: int
    returns: NDArray[np.float64]

    @property
    def final(self) -> NDArray[np.float64]:
        """The mean return over the last fifth of the steps, ``[runs]``."""
        means: NDArray[np.float64] = self.returns[:, -LAST:].mean(axis=1)
        return means


def write_page(series: Sequence[Series], dates: Sequence[str], *, angles: bool = False) -> str:
    """Return the page.

    Args:
        series: the results of both programs.
        dates: the days on which the authors' program was measured.
        angles: whether our runs of Acrobot observe angles, not their cosines and sines.
    """
    known = {(each.task, each.who): each for each in series}
    days = sorted({*dates})
    return _PAGE.format(
        conclusions="\n".join(f"* {line}" for line in _conclusions(known)),
        longer="epsilon_over=25000 situations=4500 evaluation.every=20",
        dates=" to ".join(dict.fromkeys((days[0], days[-1]))) if days else "no day yet",
        confidence=100 * CONFIDENCE,
        angles=_ANGLES if angles else "",
        returns=_table(series),
    )


def _table(series: Sequence[Series]) -> str:
    rows = [
        (
            TITLES[each.task],
            _WORDS[each.who],
            f"{len(each.returns)}",
            f"{each.steps:,}",
            _interval(each.returns.mean(axis=1)),
            _interval(each.final),
            f"{each.final.min():.{_digits(each.final.min())}f}",
        )
        for each in series
    ]
    head = ("task", "program", "seeds", "steps", "mean return", "last fifth", "its worst run")
    return table(head, rows) + "\n"


def _catches(series: Series) -> str:
    share = (series.final + 0.5) / 1.5  # a catch is worth 1, a miss −0.5
    found = mean_interval(share, bounds=(0, 1))
    bounds = f" [{found.low:.0%}, {found.high:.0%}]" if len(share) >= FEWEST else ""
    return f"{found.mean:.0%}{bounds}"


def _interval(sample: NDArray[np.float64]) -> str:
    found = mean_interval(sample)
    digits = _digits(found.mean)
    if len(sample) < FEWEST:
        return f"{found.mean:.{digits}f}"
    return f"{found.mean:.{digits}f} [{found.low:.{digits}f}, {found.high:.{digits}f}]"


def _digits(value: float) -> int:
    """Return the number of digits after the point that are worth showing."""
    return 2 if abs(value) < 10 else 0


def _conclusions(known: Mapping[tuple[str, str], Series]) -> Iterator[str]:
    for task, title in TITLES.items():
        ours, theirs = known.get((task, OURS)), known.get((task, THEIRS))
        if ours is None or theirs is None:
            continue
        digits = _digits(ours.final.mean())
        if len(theirs.returns) < FEWEST:
            runs = " and ".join(f"{value:.{digits}f}" for value in theirs.final)
            yield (
                f"**{title}**: in the last fifth of {ours.steps:,} steps, ours earns "
                f"{_interval(ours.final)}; the authors' program earns {runs}, in too few runs "
                "for a comparison."
            )
            continue
        difference = ours.final.mean() - theirs.final.mean()
        bounds = ttest_ind(ours.final, theirs.final, equal_var=False).confidence_interval(
            CONFIDENCE
        )
        verdict = "neither clearly more nor less than"
        if bounds.low > 0 or bounds.high < 0:
            verdict = "more than" if bounds.low > 0 else "less than"
        yield (
            f"**{title}**: ours earns {verdict} the authors' program. In the last fifth of "
            f"{ours.steps:,} steps, ours has {ours.final.mean():.{digits}f} and theirs "
            f"{theirs.final.mean():.{digits}f}; the difference is {difference:+.{digits}f} "
            f"[{bounds.low:+.{digits}f}, {bounds.high:+.{digits}f}] "
            f"({len(ours.returns)} seeds against {len(theirs.returns)})."
        )
    if balls := [
        f"{_NAMED[who]} {_catches(known['follow', who])}"
        for who in (OURS, THEIRS, FUZZY)
        if ("follow", who) in known
    ]:
        yield (
            f"**{TITLES['follow']}**: in the last fifth of the steps, the share of balls caught is "
            f"{', '.join(balls)}.{_world_or_recipe(known)}"
        )


def _world_or_recipe(known: Mapping[tuple[str, str], Series]) -> str:
    """Return whether the ball's world is too hard for the recipe, if our runs can tell."""
    ours = known.get(("follow", OURS))
    if ours is None or mean_interval(ours.final).low < _LEARNED:
        return ""
    return (
        " So the world isn't too hard for the recipe. The perceptrons of [adaptive.md](adaptive.md)"
        " learn little with ObGD. They lack several parts of the recipe at once: a second layer,"
        " normalised observations, scaled rewards, an output for each action, a falling ε. Which of"
        " these matter isn't tested here."
    )


@own_style()
def figure_of(series: Sequence[Series]) -> Figure:
    """Draw the returns against the steps, a panel for each task."""
    counts = [len(each.returns) for each in series if each.who == THEIRS] or [0]
    figure = new_figure(
        11,
        4.2,
        "Stream Q(λ): return of the learning episodes",
        f"line: mean; band: its {100 * CONFIDENCE:g} % interval; thin: single runs; "
        f"{count_words([len(series[0].returns)])} of ours, {count_words(counts)} of the authors'",
    )
    for axes, (task, title) in zip(figure.subplots(1, len(TITLES)), TITLES.items(), strict=True):
        for who, colour in zip((OURS, THEIRS, FUZZY), COLOURS, strict=False):
            found = [each for each in series if (each.task, each.who) == (task, who)]
            if not found:
                continue
            (each,) = found
            places = (np.arange(PARTS) + 0.5) * each.steps / PARTS
            intervals = [mean_interval(column) for column in each.returns.T]
            axes.plot(places, [one.mean for one in intervals], color=colour, label=_WORDS[who])
            if len(each.returns) < _BAND:
                axes.plot(places, each.returns.T, color=colour, linewidth=0.6, alpha=0.5)
            else:
                lows, highs = [one.low for one in intervals], [one.high for one in intervals]
                axes.fill_between(places, lows, highs, color=colour, alpha=0.2, linewidth=0)
        axes.set_title(title, fontsize=10)
        axes.set_xlabel("learning steps")
        axes.xaxis.set_major_formatter("{x:,.0f}")
        axes.locator_params(axis="x", nbins=4)
        if axes.lines:
            axes.legend(frameon=False, fontsize=8)
        quiet_grid(axes)
    figure.axes[0].set_ylabel("return of an episode")
    return figure
