"""The figures of the page on prior knowledge."""

from collections.abc import Sequence
from itertools import cycle

from torch import Tensor

from envs.pictures import Axes, Figure
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import (
    LINES,
    count_words,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.results import CONFIDENCE

from .arms import HOPES, NOTHING, Arm


def curves_figure(arms: Sequence[Arm]) -> Figure:
    """Draw the learning curves of the arms, in a panel for each margin."""
    told = [arm for arm in arms if arm.source not in (NOTHING, HOPES)]
    untold = [arm for arm in arms if arm not in told]
    margins = sorted({arm.margin for arm in told})
    over = count_words([arm.job.evaluations.runs for arm in arms])
    figure = new_figure(
        5.6 * len(margins) + 1,
        4.4,
        f"Learning from what is known before, {over} each",
        f"line: mean over {over}; band: its {100 * CONFIDENCE:g} % interval (Student's t)",
    )
    row = figure.subplots(1, len(margins), sharey=True, squeeze=False)[0]
    shown = [[*untold, *(arm for arm in told if arm.margin == margin)] for margin in margins]
    for axes, of_panel, margin in zip(row, shown, margins, strict=True):
        for arm, (colour, style) in zip(of_panel, cycle(LINES), strict=False):
            evaluations = arm.job.evaluations
            mean, low, high = mean_interval(evaluations.score, confidence=CONFIDENCE, axis=0)
            x = evaluations.situations
            axes.plot(x, mean, color=colour, linestyle=style, linewidth=1.4, label=arm.source)
            axes.fill_between(x, low, high, color=colour, alpha=0.3, linewidth=0)
        axes.set_title(f"margin = {margin:g}", fontsize=10)
        axes.set_xlabel("learning situations")
        axes.set_ylim(0, 5.15)
        axes.set_xlim(0, evaluations.situations[-1])
        # Labels at the ends of the lines would overlap: all lines end at nearly the same score.
        axes.legend(loc="lower right", frameon=False)
        quiet_grid(axes)
    row[0].set_ylabel("score (catches, of 5)")
    return figure


def rules_figure(arms: Sequence[Arm]) -> Figure:
    """Draw the consequents before and after learning, in a row of two grids for each arm."""
    figure = new_figure(
        9.0,
        2.3 * len(arms) + 0.6,
        "The rules before and after learning",
        f"after: mean over {count_words([arm.job.evaluations.runs for arm in arms])}",
    )
    grids = figure.subplots(len(arms), 2, squeeze=False, sharex=True, sharey=True)
    most = max(float(each.abs().max()) for arm in arms for each in (arm.start, arm.learned.mean(0)))
    for (before, after), arm in zip(grids, arms, strict=True):
        _grid(before, arm, arm.start, most, f"{arm.source}: before")
        _grid(after, arm, arm.learned.mean(0), most, "after")
    return figure


def _grid(axes: Axes, arm: Arm, values: Tensor, most: float, title: str) -> None:
    [state] = arm.rules.states
    axes.imshow(values.numpy(), cmap="RdBu_r", vmin=-most, vmax=most, aspect="auto")
    axes.set_title(title, fontsize=10)
    axes.set_xticks(range(len(arm.rules.action.names)), labels=arm.rules.action.names, fontsize=8)
    axes.set_yticks(range(len(state.names)), labels=state.names, fontsize=8)
    for i, row in enumerate(values.tolist()):
        for j, value in enumerate(row):
            colour = "white" if abs(value) > 0.6 * most else "black"
            words = f"{value:z.2f}"
            axes.text(j, i, words, ha="center", va="center", fontsize=8, color=colour)
