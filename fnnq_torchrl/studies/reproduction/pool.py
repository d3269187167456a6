"""The jobs of several experiments, found by their differences from the default configuration."""

from collections.abc import Iterable, Sequence
from typing import Any

from fnnq_torchrl.config.identity import WHICH_RUNS
from fnnq_torchrl.studies.experiments import HOW_IT_RUNS, Experiment, Job, NoResults
from fnnq_torchrl.training.pictures.words import setting_words

from .claims import Settings

# These keys change the number of runs and how they are computed, not the runs themselves.
_NO_DIFFERENCE = (*WHICH_RUNS, *HOW_IT_RUNS)


class Pool:
    """The jobs of several experiments; among jobs with equal settings, the one with most runs.

    Args:
        default: the settings of the default configuration.
        experiments: the experiments whose jobs are taken.
    """

    def __init__(self, default: Settings, experiments: Iterable[Experiment]) -> None:
        self._default = default
        self._jobs: dict[str, Job] = {}
        for experiment in experiments:
            for job in experiment.jobs:
                key = _key(job.settings)
                known = self._jobs.get(key)
                if known is None or known.evaluations.runs < job.evaluations.runs:
                    self._jobs[key] = job

    def job(self, changes: Settings) -> Job:
        """Return the job that differs from the default in these settings and no others.

        Raises:
            NoResults: if there is no such job.
        """
        found = self._jobs.get(_key({**self._default, **changes}))
        if found is None:
            raise NoResults(f"there are no results with {words(changes) or 'the defaults'}")
        return found

    def changes(self) -> list[dict[str, Any]]:
        """Return the settings in which each job differs from the default."""
        return [
            {
                key: value
                for key, value in job.settings.items()
                if key not in _NO_DIFFERENCE and self._default.get(key) != value
            }
            for job in self._jobs.values()
        ]


def words(changes: Settings) -> str:
    """Return settings in words, separated by commas."""
    return ", ".join(setting_words(key, value) for key, value in changes.items())


def default_settings(experiment: Experiment, changes: Settings) -> dict[str, Any]:
    """Return the settings of the default configuration.

    Args:
        experiment: an experiment that varies some keys, and has the defaults for all others.
        changes: the default values of the varied keys.
    """
    return {**experiment.jobs[0].settings, **changes}


def same_seeds(jobs: Sequence[Job]) -> int:
    """Return the number of runs of the smallest job, after checking that the seeds are the same.

    Raises:
        NoResults: if the seeds differ, so that the jobs can't be compared run by run.
    """
    runs = min(job.evaluations.runs for job in jobs)
    first = jobs[0].evaluations.seed[:runs]
    for job in jobs:
        if not (job.evaluations.seed[:runs] == first).all():
            raise NoResults("the results to be compared have different seeds")
    return runs


def _key(settings: Settings) -> str:
    """Return a text that is equal for equal settings; 0 and 0.0 are equal."""
    kept = {key: value for key, value in settings.items() if key not in _NO_DIFFERENCE}
    return repr(sorted((key, _plain(value)) for key, value in kept.items()))


def _plain(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_plain, value))}]"
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return repr(float(value)) if is_number else repr(value)
