"""What figures and pages call a job of an experiment."""

from fnnq_torchrl.equations.names import EXPLORATIONS
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.training.pictures.words import setting_words


def job_words(experiment: Experiment, job: Job, without: str | None = None) -> str:
    """What sets a job apart from the others of its experiment.

    Args:
        experiment: the job's.
        job: one of its jobs.
        without: a key to leave out, because colours or an axis show it.
    """
    settings = job.settings
    idle = set(EXPLORATIONS.values()) - {EXPLORATIONS[settings["exploration"]]}
    if settings["trace"] != "window":
        idle.add("window")
    if settings["step_size"] != "obgd":
        idle.add("kappa")
    keys = [key for key in experiment.varied if key != without and key not in idle]
    return ", ".join(setting_words(key, settings[key]) for key in keys)


def change_words(experiment: Experiment, job: Job, without: str | None = None) -> str:
    """How a job differs from the first of its experiment; «default» where it doesn't."""
    first = experiment.jobs[0].settings
    changes = [
        setting_words(key, job.settings[key])
        for key in experiment.varied
        if key != without and job.settings[key] != first[key]
    ]
    return ", ".join(changes) or "default"
