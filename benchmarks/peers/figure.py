"""Draws the catches of all learners against learning steps and against time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import StrMethodFormatter
from numpy.typing import NDArray

from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import (
    COLOURS,
    LABEL_PT,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.results import CONFIDENCE

from .learners import PEERS
from .results import ALONE, NO_TRACE, OURS, WORDS, Results, catches, eager_seconds, seconds

_LINE = dict(zip(WORDS, COLOURS, strict=False))


def peers_figure(results: Results, best: int) -> Figure:
    """Draw a panel over steps and a panel over seconds.

    Args:
        results: of all learners.
        best: the highest score there is.
    """
    many, few = (
        count_words([len(results[name]) for name in names])
        for names in ((OURS, NO_TRACE), tuple(PEERS))
    )
    figure = new_figure(
        12.0,
        4.4,
        "The same task, as many steps of learning",
        f"line: mean over {many} of Q(λ), {few} of each DQN; band: its {100 * CONFIDENCE:g} % "
        "interval; time of a run alone, with compiling, without imports and evaluation",
    )
    by_steps, by_time = figure.subplots(1, 2, sharey=True)
    for name in WORDS:
        _draw(by_steps, results, name, np.array(results[name][0].steps), "-")
    # The evaluation before learning is at time 0, which a logarithmic axis can't show.
    _draw(by_time, results, OURS, seconds(results[ALONE]), "-", begin=1)
    _draw(by_time, results, OURS, eager_seconds(results), "--", begin=1)
    for name in PEERS:
        _draw(by_time, results, name, seconds(results[name]), "-", begin=1)
    by_steps.set_xlabel("learning steps")
    by_steps.set_ylabel(f"score (catches of {best})")
    by_steps.set_ylim(0, 1.03 * best)
    by_steps.set_xlim(0, results[OURS][0].steps[-1])
    by_time.set_xlabel("wall time of a run (s)")
    by_time.set_xscale("log")
    by_time.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    by_time.tick_params(labelleft=True)
    figure.draw_without_rendering()
    label_ends(by_steps, list(WORDS.values()))
    ours = WORDS[OURS]
    labels = [f"{ours}, compiled", f"{ours}, eager", *(peer.words for peer in PEERS.values())]
    by_time.legend(by_time.lines, labels, fontsize=LABEL_PT, loc="lower right")
    return figure


def _draw(
    axes: Axes,
    results: Results,
    name: str,
    x: NDArray[np.float64],
    style: str,
    begin: int = 0,
) -> None:
    """Draw a learner's line and band, beginning with one of its evaluations."""
    scores = catches(results[name])[:, begin:]
    mean, low, high = mean_interval(scores, confidence=CONFIDENCE)
    axes.plot(x[begin:], mean, color=_LINE[name], linestyle=style, linewidth=1.4)
    axes.fill_between(x[begin:], low, high, color=_LINE[name], alpha=0.2, linewidth=0)
    quiet_grid(axes)
