"""The pictures of docs/meta_learning.md."""

from collections.abc import Mapping

import numpy as np

from envs.pictures import Figure, own_style
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.training.pictures.parameters import parameters_figure
from fnnq_torchrl.training.pictures.style import (
    LINES,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.score import Score

from .ball import jobs_of

SHOWN = "meta-learned α, T, γ (situations)"
"""The scheme whose parameters are shown."""

_DRAWN = (
    "decaying α",
    "constant α",
    "ObGD",
    "meta-learned α (situations)",
    SHOWN,
    "AutoTIDBD",
    "Swift-Sarsa",
)
"""The schemes in the figure of the changing ball; with all of them it would be crowded."""


@own_style()
def course_figure(ball: Experiment) -> Figure:
    """Return the course of α, temperature and γ beside the learning curve, from the middle α on."""
    jobs = jobs_of(ball, SHOWN)
    job = jobs[len(jobs) // 2]
    title = f"{SHOWN}, from α = {job.settings['alpha']:g}, {count_words([job.evaluations.runs])}"
    return parameters_figure(job.evaluations, Score.of(job.config), title)


@own_style()
def changing_figure(changing: Experiment, changes: Mapping[str, Mapping[str, object]]) -> Figure:
    """Return the mean score of some schemes against the situations, a panel for each change."""
    over = count_words([changing.runs])
    caption = f"lines: means over α and {over}; dotted: the change; the tables have more schemes"
    figure = new_figure(11.5, 4.4, "Catches before and after the world changes", caption)
    for axes, (name, change) in zip(
        figure.subplots(1, len(changes), sharey=True, squeeze=False)[0],
        changes.items(),
        strict=True,
    ):
        part, labels = changing, []
        for key, value in change.items():
            part = part.where(key, value)
        for scheme, (colour, style) in zip(_DRAWN, LINES, strict=False):
            if not (jobs := jobs_of(part, scheme)):
                continue
            scores = np.mean([job.evaluations.score.mean(axis=0) for job in jobs], axis=0)
            situations = jobs[0].evaluations.situations
            axes.plot(situations, scores, color=colour, linestyle=style, linewidth=1.3)
            labels.append(scheme)
        axes.set_xlim(0, situations[-1])
        axes.set_ylim(0, 5.1)
        axes.set_title(name, fontsize=10)
        axes.set_xlabel("learning situations")
        axes.set_ylabel(Score.of(part.jobs[0].config).words)
        quiet_grid(axes)
        if name == [*changes][-1]:
            figure.draw_without_rendering()  # the layout gives the axes their height
            label_ends(axes, labels)
        axes.axvline(part.jobs[0].settings["env.change_at"], color="0.4", linestyle=":")
    return figure
