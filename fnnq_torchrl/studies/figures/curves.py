"""The learning curves of an experiment."""

from matplotlib.figure import Figure

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.training.pictures.curves import Curve, curves_figure
from fnnq_torchrl.training.pictures.words import key_words, setting_words


def experiment_curves_figure(experiment: Experiment, key: str) -> Figure:
    """Draw a curve and a band for each job of an experiment that varies one key."""
    curves = [
        Curve(
            setting_words(key, job.settings[key]),
            job.evaluations.situations,
            job.evaluations.score,
            job.evaluations.diverged_runs,
        )
        for job in experiment.jobs
    ]
    return curves_figure(curves, f"values of {key_words(key)}", experiment.jobs[0].best)
