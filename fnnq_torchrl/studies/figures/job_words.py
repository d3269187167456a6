"""The names that figures and pages give to an experiment's jobs."""

from fnnq_torchrl.equations.names import EXPLORATIONS
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.training.pictures.words import setting_words


def job_words(experiment: Experiment, job: Job, without: str | None = None) -> str:
    """Return the settings that tell a job from the others of its experiment, in words.

    Args:
        experiment: the experiment.
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
    """Return a job's differences from its experiment's first job; "default" if there are none."""
    first = experiment.jobs[0].settings
    changes = [
        setting_words(key, job.settings[key])
        for key in experiment.varied
        if key != without and job.settings[key] != first[key]
    ]
    return ", ".join(changes) or "default"
