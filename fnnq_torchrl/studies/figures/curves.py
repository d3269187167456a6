"""A figure of an experiment's learning curves."""

from envs.pictures import Figure
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.training.pictures.curve import Curve
from fnnq_torchrl.training.pictures.curves import curves_figure
from fnnq_torchrl.training.pictures.words import key_words, setting_words
from fnnq_torchrl.training.score import Score


def experiment_curves_figure(experiment: Experiment, key: str) -> Figure:
    """Draw the learning curve and band of each job of an experiment that varies one key."""
    curves = [
        Curve(
            setting_words(key, job.settings[key]),
            job.evaluations.situations,
            job.evaluations.score,
            job.evaluations.diverged_runs,
        )
        for job in experiment.jobs
    ]
    score = Score.of(experiment.jobs[0].config)
    return curves_figure(curves, f"values of {key_words(key)}", score)
