"""A measure of the runs of every job, one row below the other."""

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.studies.figures.job_words import job_words
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import bootstrap_interval, interquartile_mean
from fnnq_torchrl.training.pictures.style import (
    COLOURS,
    LABEL_PITCH_PT,
    LABEL_PT,
    count_words,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.pictures.words import setting_words

from .lines import INTERVAL

RowWords = Callable[[Experiment, Job, str | None], str]


def dots_figure(
    experiment: Experiment, measure: str, colours: str | None = None, words: RowWords = job_words
) -> Figure:
    """Draw each job's mean, its interval, and its interquartile mean.

    Args:
        experiment: what to draw.
        measure: of :data:`fnnq_torchrl.studies.measures.MEASURES`.
        colours: a key of which each value has a colour of its own, in the same rows.
        words: what a row is called.
    """
    rows = list(dict.fromkeys(words(experiment, job, colours) for job in experiment.jobs))
    hues = experiment.values(colours) if colours else [None]
    over = count_words([experiment.runs])
    name = MEASURES[measure].words
    figure = new_figure(
        7.5,
        1.6 + 0.3 * len(rows),
        f"{name.partition(' (')[0].capitalize()} of {len(experiment.jobs)} configurations, "
        f"{over} each",
        f"dot: mean over {over}; line: its {INTERVAL}; tick: interquartile mean",
    )
    axes = figure.add_subplot()
    offsets = np.linspace(-0.15, 0.15, len(hues)) if len(hues) > 1 else [0.0]
    first_row = [job for job in experiment.jobs if words(experiment, job, colours) == rows[0]]
    for job in experiment.jobs:
        hue = hues.index(job.settings[colours]) if colours else 0
        place = rows.index(words(experiment, job, colours)) + offsets[hue]
        scores = MEASURES[measure].of(job.evaluations)
        mean, low, high = bootstrap_interval(np.mean, scores)
        colour = COLOURS[hue % len(COLOURS)]
        axes.plot([low, high], [place, place], linewidth=1.6, color=colour)
        axes.plot(mean, place, "o", markersize=5, color=colour)
        axes.plot(interquartile_mean(scores), place, "|", markersize=9, color=colour)
        if colours and job in first_row:
            axes.annotate(
                setting_words(colours, hues[hue]),
                xy=(1.0, place),
                xycoords=axes.get_yaxis_transform(),
                xytext=(6, -LABEL_PITCH_PT / 2 * (hue - (len(hues) - 1) / 2)),
                textcoords="offset points",
                verticalalignment="center",
                fontsize=LABEL_PT,
                color=colour,
                annotation_clip=False,
            )
    axes.set_yticks(range(len(rows)), labels=rows)
    axes.set_ylim(-0.9, len(rows) - 0.4)
    axes.invert_yaxis()
    axes.set_xlabel(name)
    quiet_grid(axes)
    return figure
