"""Catches of all learners, against the steps that they learn and the time that it takes them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fnnq_torchrl.figures.style import (
    COLOURS,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.results import CONFIDENCE
from fnnq_torchrl.stats import mean_interval

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
    _draw(by_time, results, OURS, seconds(results[ALONE]), "-")
    _draw(by_time, results, OURS, eager_seconds(results), "--")
    for name in PEERS:
        _draw(by_time, results, name, seconds(results[name]), "-")
    by_steps.set_xlabel("learning steps")
    by_steps.set_ylabel(f"score (catches of {best})")
    by_steps.set_ylim(0, 1.03 * best)
    by_steps.set_xlim(left=0)
    by_time.set_xlabel("wall time of a run (s)")
    by_time.set_xscale("log")
    by_time.tick_params(labelleft=True)
    figure.draw_without_rendering()
    label_ends(by_steps, list(WORDS.values()))
    ours = WORDS[OURS]
    label_ends(by_time, [f"{ours}, compiled", f"{ours}, eager", *(p.words for p in PEERS.values())])
    return figure


def _draw(axes: Axes, results: Results, name: str, x: Sequence[float], style: str) -> None:
    mean, low, high = mean_interval(catches(results[name]), confidence=CONFIDENCE)
    axes.plot(x, mean, color=_LINE[name], linestyle=style, linewidth=1.4)
    axes.fill_between(x, low, high, color=_LINE[name], alpha=0.3, linewidth=0)
    quiet_grid(axes)
