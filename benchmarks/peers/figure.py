"""The scores of all learners against the steps that they learn, and against the time it takes."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter
from numpy.typing import NDArray

from fnnq_torchrl.training.pictures.style import (
    COLOURS,
    LABEL_PT,
    count_words,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.results import CONFIDENCE

from .learners import PEERS
from .results import (
    ALONE,
    NO_TRACE,
    OURS,
    WORDS,
    Results,
    catches,
    eager_seconds,
    score_interval,
    seconds,
)

_COLOUR = dict(zip(WORDS, COLOURS, strict=False))


def peers_figure(results: Results, best: int) -> Figure:
    """Draw our default beside each of the others over steps, and all over seconds.

    Args:
        results: the runs of all learners.
        best: the highest possible score.
    """
    many, few = (
        count_words([len(results[name]) for name in names])
        for names in ((OURS, NO_TRACE), tuple(PEERS))
    )
    figure = new_figure(
        10.5,
        7.4,
        "The same task, and the same number of learning steps",
        f"line: mean over {many} of Q(λ), {few} of each DQN; band: its {100 * CONFIDENCE:g} % "
        f"interval (Student's t), cut off at {best} catches\nwall time: of a run alone, with "
        "compiling, without imports and evaluation",
    )
    panels = figure.subplots(2, 2, sharey=True)
    *by_steps, by_time = panels.flat
    others = [name for name in WORDS if name != OURS]
    for axes, other in zip(by_steps, others, strict=True):
        for name in (other, OURS):
            _draw_over_steps(axes, results, name, best)
        axes.set_title(f"{WORDS[OURS]}, and {WORDS[other]}", fontsize=10)
        axes.set_xlabel("learning steps")
        axes.set_xlim(0, results[OURS][0].steps[-1])
        axes.legend(axes.lines, [WORDS[other], WORDS[OURS]], fontsize=LABEL_PT, loc="lower right")
    ours = WORDS[OURS]
    _draw_over_time(by_time, results, OURS, seconds(results[ALONE]), f"{ours}, compiled", "-")
    _draw_over_time(by_time, results, OURS, eager_seconds(results), f"{ours}, eager", "--")
    for name, peer in PEERS.items():
        _draw_over_time(by_time, results, name, seconds(results[name]), peer.words, "-")
    by_time.set_title("means against wall time", fontsize=10)
    by_time.set_xlabel("wall time of a run (s)")
    by_time.set_xscale("log")
    by_time.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    by_time.legend(fontsize=LABEL_PT, loc="lower right")
    for axes in panels.flat:
        quiet_grid(axes)
    for axes in panels[:, 0]:
        axes.set_ylabel(f"score (catches of {best})")
        axes.set_ylim(0, 1.03 * best)
    return figure


def _draw_over_steps(axes: Axes, results: Results, name: str, best: int) -> None:
    """Draw a learner's line and band over its steps."""
    mean, low, high = score_interval(catches(results[name]), best)
    steps = np.array(results[name][0].steps)
    axes.plot(steps, mean, color=_COLOUR[name], linewidth=1.4)
    axes.fill_between(steps, low, high, color=_COLOUR[name], alpha=0.25, linewidth=0)


def _draw_over_time(
    axes: Axes, results: Results, name: str, taken_s: NDArray[np.float64], label: str, style: str
) -> None:
    """Draw a learner's line over its wall time.

    The evaluation before learning, after no time, has no place on a logarithmic axis.
    """
    mean = catches(results[name]).mean(axis=0)
    axes.plot(taken_s[1:], mean[1:], style, color=_COLOUR[name], linewidth=1.4, label=label)
