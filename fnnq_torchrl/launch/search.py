"""A search for the best values of some keys: Optuna proposes jobs, which are launched in batches.

The search uses Optuna's ask-and-tell interface: it asks Optuna for a batch of proposals, the
launcher trains the batch, and the search tells Optuna the scores. Each batch is drawn with its own
seed, so the same command in the same directory proposes the same jobs again. The launcher then runs
only the missing jobs.
"""

import logging
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice, product
from pathlib import Path
from typing import Any

import numpy as np
import optuna
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import IntervalSweep, Override, RangeSweep
from hydra.core.utils import JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext
from omegaconf import DictConfig, OmegaConf
from optuna.distributions import (
    BaseDistribution,
    CategoricalDistribution,
    FloatDistribution,
    IntDistribution,
)
from optuna.samplers import BaseSampler, CmaEsSampler, RandomSampler, TPESampler
from optuna.trial import FrozenTrial, Trial, TrialState

from envs.core.parameters import check
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.config.search import SearchConfig
from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.drawing import draw_search

log = logging.getLogger(__name__)
optuna.logging.set_verbosity(logging.WARNING)  # at the default level, Optuna logs every trial

RESULTS = "optimization_results.yaml"
"""The file with the best values; Hydra's own plugin for Optuna uses the same name."""

_JOB = "fnnq_torchrl job"
"""The name of the trial attribute that holds the sweep's directory and the number of the job."""


class Search:
    """A search for the best values, in the directory of a multirun.

    Args:
        settings: the sweeper's settings, as in ``conf/hydra/sweeper/optuna.yaml``.
        context: Hydra's context.
        config: the configuration of the multirun, without the values of single jobs.
        launcher: the launcher that runs the jobs.
        arguments: the overrides, some of them with several values or an interval.

    Raises:
        ConfigError: if a setting isn't allowed, no key has several values, or the database can't be
            used.
    """

    def __init__(
        self,
        settings: Mapping[str, Any],
        context: HydraContext,
        config: DictConfig,
        launcher: Launcher,
        arguments: Sequence[str],
    ) -> None:
        others = {key: value for key, value in settings.items() if key != "params"}
        self._settings = SearchConfig(**others)
        check(self._settings, "hydra.sweeper.")
        self._directory, self._config = Path(config.hydra.sweep.dir), config
        self._launcher = launcher
        params = [f"{key}={values}" for key, values in (settings.get("params") or {}).items()]
        parser = OverridesParser.create(config_loader=context.config_loader)
        # A key's last override counts.
        overrides = {
            each.get_key_element(): each for each in parser.parse_overrides([*params, *arguments])
        }
        self._fixed = {
            key: each.get_value_element_as_str()
            for key, each in overrides.items()
            if not each.is_sweep_override()
        }
        self._space = {
            key: _distribution(each) for key, each in overrides.items() if each.is_sweep_override()
        }
        if not self._space:
            raise ConfigError(
                "hydra/sweeper=optuna: there is nothing to search; give a key several values or "
                "an interval, as lam=interval(0,1)"
            )
        self._keys = [*overrides]
        self._jobs: dict[tuple[str, ...], int] = {}  # the numbers of the jobs by their overrides
        self._scores: dict[int, float] = {}  # by the number of the job

    def run(self) -> None:
        """Run the search to its end.

        Raises:
            ConfigError: if a job isn't valid, or the database can't be used.
            Exception: the exception of a failed job, after Optuna was told the scores of the other
                jobs of the batch.
        """
        self._directory.mkdir(parents=True, exist_ok=True)
        OmegaConf.save(self._config, self._directory / "multirun.yaml")
        points = _grid(self._space) if self._settings.sampler == "grid" else None
        direction: Any = self._settings.direction
        with self._database():
            self._study = optuna.create_study(
                storage=self._settings.storage or None,
                study_name=self._settings.study_name,
                sampler=self._sampler(),
                pruner=optuna.pruners.NopPruner(),
                direction=direction,
                load_if_exists=True,
            )
            if points is not None:
                for point in islice(points, self._settings.n_trials):
                    self._study.enqueue_trial(point, skip_if_exists=True)
        self._run(self._begun())
        while trials := self._ask():
            self._run(trials)
        draw_search(self._study, self._directory)

    def _ask(self) -> list[Trial]:
        """Return the next batch of proposals; an empty list at the end of the search."""
        with self._database():
            trials = self._study.get_trials(deepcopy=False)
            counted = [t for t in trials if t.state is TrialState.COMPLETE or _JOB in t.user_attrs]
            missing = self._settings.n_trials - len(counted)
            if self._settings.sampler == "grid":
                missing = sum(t.state is TrialState.WAITING for t in trials)
            # Each batch has its own seed, so that a resumed search makes the same proposals as a
            # search that wasn't interrupted.
            self._study.sampler = self._sampler(len(trials))
            return [
                self._study.ask(self._space) for _ in range(min(missing, self._settings.n_jobs))
            ]

    def _run(self, trials: Sequence[Trial | FrozenTrial]) -> None:
        """Run the jobs of these trials, and tell Optuna their scores.

        Equal proposals share one job.
        """
        launched: list[tuple[str, ...]] = []
        jobs: list[int] = []  # the number of each trial's job
        known = len(self._jobs)
        with self._database():
            for trial in trials:
                values = self._fixed | trial.params
                overrides = tuple(f"{key}={values[key]}" for key in self._keys)
                if overrides not in self._jobs:
                    self._jobs[overrides] = len(self._jobs)
                    launched.append(overrides)
                jobs.append(self._jobs[overrides])
                if isinstance(trial, Trial):
                    trial.set_user_attr(_JOB, [self._place, jobs[-1]])
        returns = self._launcher.launch(launched, initial_job_idx=known) if launched else []
        for job, done in enumerate(returns, start=known):
            if done.status is JobStatus.COMPLETED:
                self._scores[job] = float(done.return_value)
        with self._database():
            for trial, job in zip(trials, jobs, strict=True):
                if job in self._scores:  # the trial of a failed job stays open and is tried again
                    self._study.tell(trial.number, self._scores[job], skip_if_finished=True)
        if repeated := len(trials) - len(launched):
            log.info(f"{repeated:,} of {len(trials):,} proposals repeat earlier jobs")
        if self._scores:
            self._write_best()
        for done in returns:
            _ = done.return_value  # raises the job's exception, if there was one

    def _write_best(self) -> None:
        best = self._study.best_trial
        params = {key: _plain(value) for key, value in best.params.items()}
        values = {"name": "optuna", "best_params": params, "best_value": best.value}
        with atomic_write(self._directory / RESULTS) as file:
            file.write(yaml.safe_dump(values, sort_keys=False, allow_unicode=True).encode())
        directory, job = best.user_attrs.get(_JOB, ["", best.number])
        name = f"job {job}" if directory == self._place else f"trial {best.number}"
        words = " ".join(f"{key}={value}" for key, value in best.params.items())
        log.info(f"best so far: {name} with {best.value:.4g}: {words}")

    def _begun(self) -> list[FrozenTrial]:
        """Return the trials of this directory from the database, in the order of their jobs."""
        with self._database():
            trials = self._study.get_trials(deepcopy=False)
        own = [t for t in trials if t.user_attrs.get(_JOB, [""])[0] == self._place]
        return sorted(own, key=lambda trial: (trial.user_attrs[_JOB][1], trial.number))

    @property
    def _place(self) -> str:
        return str(self._directory.absolute())

    def _sampler(self, batch: int = 0) -> BaseSampler:
        """Return the sampler for the batch that begins with the trial of this number."""
        [seed] = np.random.SeedSequence([self._settings.seed, batch]).generate_state(1).tolist()
        match self._settings.sampler:
            case "tpe":
                return TPESampler(seed=seed)
            case "cmaes":
                try:
                    return CmaEsSampler(seed=seed, warn_independent_sampling=False)
                except ImportError as error:
                    raise ConfigError(
                        "hydra.sweeper.sampler=cmaes: needs a library that isn't installed; "
                        "pip install cmaes"
                    ) from error
            case _:
                return RandomSampler(seed=seed)

    @contextmanager
    def _database(self) -> Iterator[None]:
        """Turn an error of the database inside the block into a ConfigError of one line."""
        storage = self._settings.storage
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
            try:
                yield
            except ConfigError:
                raise
            except Exception as error:
                if not storage:
                    raise
                reason = str(error).strip().partition("\n")[0] or type(error).__name__
                raise ConfigError(f"hydra.sweeper.storage={storage}: {reason}") from error


def _distribution(override: Override) -> BaseDistribution:
    """Return the distribution of a key whose override has several values or an interval.

    Raises:
        ConfigError: if the override has no value, or its scale can't be logarithmic.
    """
    sweep: Any = override.value()
    is_log = "log" in getattr(sweep, "tags", ())
    try:
        if isinstance(sweep, IntervalSweep):
            low: Any = sweep.start
            high: Any = sweep.end
            if isinstance(low, int) and isinstance(high, int):
                return IntDistribution(low, high, log=is_log)
            return FloatDistribution(low, high, log=is_log)
        texts = list(override.sweep_string_iterator())
        if not texts:
            raise ValueError("must have at least one value to sweep")
        if isinstance(sweep, RangeSweep):
            numbers: list[Any] = sorted(sweep.range())
            step = numbers[1] - numbers[0] if len(numbers) > 1 else 1
            of = IntDistribution if isinstance(numbers[0], int) else FloatDistribution
            if not is_log:
                return of(numbers[0], numbers[-1], step=step)
            return of(numbers[0], numbers[-1], log=True)
    except ValueError as error:
        raise ConfigError(f"{override.input_line}: {' '.join(str(error).split())}") from error
    return CategoricalDistribution(texts)


def _grid(space: Mapping[str, BaseDistribution]) -> Iterator[dict[str, Any]]:
    """Return all combinations of values; the last key's value changes fastest.

    Raises:
        ConfigError: if a key has infinitely many values.
    """
    columns: list[Sequence[Any]] = []
    for key, values in space.items():
        if isinstance(values, CategoricalDistribution):
            columns.append(values.choices)
        elif isinstance(values, IntDistribution) and not values.log:
            columns.append(range(values.low, values.high + 1, values.step))
        elif isinstance(values, FloatDistribution) and values.step is not None:
            count = round((values.high - values.low) / values.step) + 1
            columns.append([values.low + place * values.step for place in range(count)])
        else:
            raise ConfigError(
                f"hydra.sweeper.sampler=grid: {key} must have a list or a range of values"
            )
    return (dict(zip(space, point, strict=True)) for point in product(*columns))


def _plain(value: Any) -> Any:
    """Return a proposed value as a configuration has it; Optuna keeps a choice as text."""
    return yaml.safe_load(value) if isinstance(value, str) else value
