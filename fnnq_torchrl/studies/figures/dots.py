"""A figure of one measure, with a row for each job."""

from collections.abc import Callable

import numpy as np

from envs.pictures import Figure
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
from .outliers import CUT_OFF, limits, mark_left

RowWords = Callable[[Experiment, Job, str | None], str]


def dots_figure(
    experiment: Experiment, measure: str, colours: str | None = None, words: RowWords = job_words
) -> Figure:
    """Draw each job's mean of a measure, its interval, and the interquartile mean.

    Args:
        experiment: the jobs to draw.
        measure: a name in :data:`fnnq_torchrl.studies.measures.MEASURES`.
        colours: a key whose values have different colours; jobs that differ in it share a row.
        words: a function that returns the name of a job's row.
    """
    rows = list(dict.fromkeys(words(experiment, job, colours) for job in experiment.jobs))
    hues = experiment.values(colours) if colours else [None]
    over = count_words([experiment.runs])
    name = MEASURES[measure].words
    scores = [MEASURES[measure].of(job.evaluations) for job in experiment.jobs]
    found = [bootstrap_interval(np.mean, each) for each in scores]
    middles = [interquartile_mean(each) for each in scores]
    mean, low, high = np.transpose(found)
    shown = limits(mean, np.fmin(low, middles), np.fmax(high, middles))
    cut_off = bool((mean < shown.low).any())
    figure = new_figure(
        7.5,
        1.6 + 0.36 * len(rows),
        f"{name.partition(' (')[0].capitalize()} of {len(experiment.jobs)} configurations, "
        f"{over} each",
        f"dot: mean over {over}; line: its {INTERVAL}; tick: interquartile mean"
        + (f"\n{CUT_OFF}" if cut_off else ""),
    )
    axes = figure.add_subplot()
    offsets = np.linspace(-0.2, 0.2, len(hues)) if len(hues) > 1 else [0.0]
    first_row = [job for job in experiment.jobs if words(experiment, job, colours) == rows[0]]
    for job, interval, middle in zip(experiment.jobs, found, middles, strict=True):
        hue = hues.index(job.settings[colours]) if colours else 0
        place = rows.index(words(experiment, job, colours)) + offsets[hue]
        colour = COLOURS[hue % len(COLOURS)]
        if interval.value < shown.low:
            mark_left(axes, place, interval.value, colour)
        else:
            axes.plot([interval.low, interval.high], [place, place], linewidth=1.6, color=colour)
            axes.plot(interval.value, place, "o", markersize=5, color=colour)
            axes.plot(middle, place, "|", markersize=9, color=colour)
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
    axes.set_xlim(*shown)
    axes.set_ylim(-0.9, len(rows) - 0.4)
    axes.invert_yaxis()
    axes.set_xlabel(name)
    quiet_grid(axes)
    return figure
