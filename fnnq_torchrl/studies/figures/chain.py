"""The figure of the steps to learn a chain against its length."""

import numpy as np

from envs.pictures import Figure, ScalarFormatter
from fnnq_torchrl.studies.chain import steps_to_learn
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import (
    LINES,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.pictures.words import setting_words
from fnnq_torchrl.training.results import CONFIDENCE


def chain_figure(experiment: Experiment) -> Figure:
    """Draw the geometric mean of the steps to learn, a panel for each trace, a line for each λ.

    Args:
        experiment: the results of ``+experiment=chain``.

    Raises:
        NoResults: if a combination of trace, λ and length is missing.
    """
    lengths = sorted(experiment.values("env.length"))
    lams, traces = sorted(experiment.values("lam")), experiment.values("trace")
    over = count_words([experiment.runs])
    figure = new_figure(
        1 + 4.6 * len(traces),
        4.2,
        f"Steps to learn the way along a chain, {over} each",
        f"line: geometric mean over {over}; band: its {100 * CONFIDENCE:g} % interval",
    )
    row = figure.subplots(1, len(traces), sharey=True, squeeze=False)[0]
    for axes, trace in zip(row, traces, strict=True):
        for lam, (colour, style) in zip(lams, LINES, strict=False):
            found = [
                mean_interval(np.log(steps_to_learn(experiment.job_with(settings))))
                for settings in ({"trace": trace, "lam": lam, "env.length": n} for n in lengths)
            ]
            means, lows, highs = (np.exp([each[i] for each in found]) for i in range(3))
            axes.plot(lengths, means, style, color=colour, linewidth=1.4, marker="o", ms=3.5)
            axes.fill_between(lengths, lows, highs, color=colour, alpha=0.3, linewidth=0)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xticks(lengths)
        axes.xaxis.set_major_formatter(ScalarFormatter())
        axes.minorticks_off()
        axes.set_xlabel("states")
        axes.set_title(
            "accumulating trace" if trace == "gradient" else setting_words("trace", trace)
        )
        quiet_grid(axes)
    for axes in row:
        axes.set_ylabel("steps to learn")
    figure.draw_without_rendering()
    for axes in row:
        label_ends(axes, [setting_words("lam", lam) for lam in lams])
    return figure
