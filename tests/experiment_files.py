"""Invented results of experiments, in memory or in files, for the figures and pages."""

import json
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from fnnq_torchrl.config.checking import flat
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.training.results import Evaluations, write_evaluations

from .compositions import config_of

Settings = dict[str, Any]
Level = Callable[[Settings], float]
"""A function from settings to the final score, of 5, of runs with these settings."""


GROUPS = ("+experiment", "env", "task", "value")
"""Keys of overrides that Hydra composes; all others set a value of the configuration."""


@cache
def _composed(*choices: str) -> Config:
    return config_of(*choices)


def changed_config(overrides: tuple[str, ...], runs: int) -> Config:
    """Return a configuration without composing it once more: many jobs differ in values only."""
    typed = [override.partition("=") for override in overrides]
    choices = [f"{key}={text}" for key, _, text in typed if key in GROUPS]
    values = {key: text for key, _, text in typed if key not in GROUPS}
    return _changed(_composed(*choices), values | {"num_seeds": str(runs)})


def _changed(node: Any, values: Mapping[str, str]) -> Any:
    """Return a part of a configuration with other values, by keys such as ``env.length``."""
    own, below = {}, defaultdict[str, dict[str, str]](dict)
    for key, text in values.items():
        name, _, rest = key.partition(".")
        if rest:
            below[name][rest] = text
        else:
            own[name] = type(getattr(node, name))(text)
    parts = {name: _changed(getattr(node, name), part) for name, part in below.items()}
    return replace(node, **own, **parts)


def invented(settings: Settings, level: float) -> Evaluations:
    """Return runs whose scores rise to a level; each run has its own random numbers."""
    runs, every = settings["num_seeds"], settings["evaluation"]["every"]
    situations = every * np.arange(settings["situations"] // every + 1)
    rng = np.random.default_rng([runs, int(1000 * level)])
    own = rng.normal(0, 0.05, size=(runs, 1))
    chance = np.clip(level / 5 + own, 0, 1) * (1 - np.exp(-situations / (4 * every)))
    return Evaluations(
        seed=np.arange(runs),
        lam=np.full(runs, settings["lam"]),
        situations=situations,
        steps=60 * np.tile(situations, (runs, 1)),
        catches=rng.binomial(5, chance),
        diverged=np.zeros(chance.shape, dtype=bool),
        returns=np.zeros(chance.shape),
        lengths=np.zeros(chance.shape),
    )


def invent_experiment(
    name: str, jobs: list[tuple[str, ...]], level: Level, runs: int = 22
) -> Experiment:
    """Return an experiment with a job for each tuple of overrides, as if read from files."""
    return Experiment(name, [_invent(overrides, level, runs) for overrides in jobs])


def _invent(overrides: tuple[str, ...], level: Level, runs: int) -> Job:
    config = changed_config(overrides, runs)
    settings = asdict(config)
    return job_of(config, invented(settings, level(settings)))


def job_of(config: Config, evaluations: Evaluations, directory: Path = Path("nowhere")) -> Job:
    """Return a finished job of which no files are read."""
    settings = asdict(config)
    del settings["logger"]
    return Job(flat(settings), evaluations, config, directory)


def write_experiment(
    sweep: Path, jobs: list[tuple[str, ...]], level: Level, runs: int = 22
) -> None:
    """Write a sweep's directory with a job for each tuple of overrides."""
    for number, overrides in enumerate(jobs):
        settings = asdict(changed_config(overrides, runs))
        directory = sweep / str(number)
        (directory / ".hydra").mkdir(parents=True)
        (directory / ".hydra" / "config.yaml").write_text(json.dumps(settings))
        evaluations = invented(settings, level(settings))
        write_evaluations(directory / "evaluations.csv", evaluations)
        (directory / "summary.json").write_text("{}")  # says that the job has finished


def grid(values: Mapping[str, str], *common: str) -> list[tuple[str, ...]]:
    """Return all combinations of the keys' values, which are separated by commas."""
    sweeps = [[f"{key}={value}" for value in text.split(",")] for key, text in values.items()]
    return [(*common, *job) for job in product(*sweeps)]


MANY = "0.01,0.016,0.025,0.04,0.063,0.1,0.16,0.25,0.4,0.63,1"
"""Values of α, as many and with labels as long as in conf/experiment/adaptive.yaml."""

LAMS = "0,0.1,0.2,0.4,0.7,0.8,1"
EXPERIMENTS = {
    "fig2": grid({"lam": "0,0.1,0.4,0.8"}),
    "fig3": grid({"lam": "0,0.2"}),
    "traces": grid({"trace": "output,gradient", "lam": LAMS}),
    "decay": grid({"alpha": "0.1,0.4", "alpha_decay": "0.9,0.97,0.99,0.997,1"}),
    "adaptive": [
        *grid({"step_size": "decay,obgd,alpha_bound", "alpha": MANY, "lam": "0.2,0.8"}),
        *grid({"alpha": MANY, "lam": "0.2,0.8"}, "step_size=constant", "alpha_decay=1"),
    ],
    "stability": grid(
        {"value.layer_norm": "1,", "step_size": "constant,obgd", "alpha": "0.1,0.4,0.8"},
        *("value=mlp", "lam=0.8", "alpha_decay=1"),
    ),
    "step_sizes": [
        *grid({"alpha": "0.1,0.4", "lam": "0.2,0.8"}),
        *grid(
            {"step_size": "constant,idbd,tidbd", "alpha": "0.1,0.4", "lam": "0.2,0.8"},
            "alpha_decay=1",
        ),
        *grid(
            {"step_size": "constant,swift", "alpha": "0.1,0.4", "lam": "0.2,0.8"},
            *("alpha_decay=1", "variant=sarsa", "trace=dutch"),
        ),
    ],
    "exploration": [
        *grid({"epsilon": "0,0.1,0.3"}, "exploration=epsilon_greedy"),
        *grid({"temperature": "0.01,0.1"}, "exploration=boltzmann"),
        *grid({"noise_std": "0.1,1"}, "exploration=noise"),
    ],
    "variants": [
        *grid({"variant": "peng,watkins", "trace": "output,replacing", "lam": "0.2,0.8"}),
        *grid({"window": "1,5", "lam": "0.2,0.8"}, "trace=window"),
    ],
    "open_choices": [
        *grid({"lam": "0,0.2"}),
        *grid({"env.speed_mps": "0.2,0.4", "lam": "0,0.2"}),
        *grid({"env.bearing_noise_rad": "0,0.05", "lam": "0,0.2"}),
        *grid({"action.candidates": "5,101", "lam": "0,0.2"}),
        *grid({"value.width": "variance", "lam": "0,0.2"}),
        *grid({"trace": "gradient", "lam": "0,0.2"}),
        *grid({"alpha_decay": "0.97,1", "lam": "0,0.2"}),
    ],
}
EXPERIMENTS |= {
    "sensitivity": grid(
        {
            "variant": "peng,watkins",
            "trace": "output,gradient",
            "lam": "0,0.2,0.8",
            "epsilon": "0.03,0.3",
        }
    ),
    "best_exploration": [
        *grid({"epsilon": "0.03,0.1"}, "exploration=epsilon_greedy"),
        *grid({"temperature": "0.01,0.1"}, "exploration=boltzmann"),
    ],
    "fig2_large": EXPERIMENTS["fig2"],
    "fig3_large": EXPERIMENTS["fig3"],
    "decay_large": grid({"alpha_decay": "0.9,0.97,0.99,0.997,1"}),
}


def paper_level(settings: Settings) -> float:
    """Return the score as in the paper: λ = 0.2 is best, and larger values are worse."""
    lam = settings["lam"]
    if settings["trace"] != "output":
        return 3.7 - 0.8 * lam
    return 4.5 - 4 * abs(lam - 0.2) + 0.5 * (lam <= 0.1)
