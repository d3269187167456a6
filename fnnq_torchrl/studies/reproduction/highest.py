"""The best job of an experiment, in words."""

import numpy as np

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.figures.job_words import job_words
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import bootstrap_interval

from .markdown import interval_words


def highest(experiment: Experiment, measure: str, without: str | None = None) -> str:
    """Return in words the job with the highest mean of a measure, and this mean."""
    of = MEASURES[measure].of
    best = max(experiment.jobs, key=lambda job: of(job.evaluations).mean())
    mean = bootstrap_interval(np.mean, of(best.evaluations))
    return f"{job_words(experiment, best, without)}, {interval_words(mean)}"
