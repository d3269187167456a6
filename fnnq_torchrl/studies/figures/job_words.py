"""The names that figures and pages give to an experiment's jobs."""

from fnnq_torchrl.equations.names import EXPLORATIONS, STEP_SIZES, TRACES
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.training.pictures.words import setting_words


def job_words(experiment: Experiment, job: Job, without: str | None = None) -> str:
    """Return the settings that distinguish a job from the others of its experiment, in words.

    Args:
        experiment: the experiment.
        job: a job of the experiment.
        without: a key to leave out, because colours or an axis show it.
    """
    settings, idle = job.settings, set()
    if settings["exploration"] in EXPLORATIONS:
        idle = {*EXPLORATIONS.values()} - {EXPLORATIONS[settings["exploration"]]}
    if settings["trace"] in TRACES and settings["trace"] != "window":
        idle.add("window")
    if settings["step_size"] in STEP_SIZES and settings["step_size"] != "obgd":
        idle.add("kappa")
    keys = [key for key in experiment.varied if key != without and key not in idle]
    return ", ".join(setting_words(key, settings[key]) for key in keys)


def change_words(experiment: Experiment, job: Job, without: str | None = None) -> str:
    """Return in words how a job differs from its experiment's first job, or "default".

    Args:
        experiment: the experiment.
        job: a job of the experiment.
        without: a key to leave out, because colours or an axis show it.
    """
    first = experiment.jobs[0].settings
    changes = [
        setting_words(key, job.settings[key])
        for key in experiment.varied
        if key != without and job.settings[key] != first[key]
    ]
    return ", ".join(changes) or "default"
