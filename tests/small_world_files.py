"""Invented results of the experiments on the chain and on the two states."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.studies.chain import exact_values
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.training.results import Evaluations
from fnnq_torchrl.training.weights import save_checkpoint

from .experiment_files import changed_config, grid, job_of

RUNS = 12
JOBS = {
    "chain": grid({"env.length": "5,20,40", "trace": "gradient,replacing", "lam": "0,0.2,0.8"}),
    "sensitivity_values": grid(
        {"variant": "peng,watkins", "lam": "0,0.5,0.9", "epsilon": "0.1,0.6"}
    ),
    "two_states": [
        *grid({"env.time_limit_steps": "1,2", "lam": "0,0.8"}),
        *grid({"env.time_limit_steps": "1,2", "lam": "0,0.8"}, "value=rbf"),
        *grid({"env.time_limit_steps": "1,2", "lam": "0,0.8"}, "value=fnnq"),
    ],
}


def invent_small_worlds(root: Path) -> dict[str, Experiment]:
    """Return the three experiments; the tables of the values are files in a directory."""
    return {name: Experiment(name, [*_jobs(root, name)]) for name in JOBS}


def _jobs(root: Path, name: str) -> Iterator[Job]:
    for number, overrides in enumerate(JOBS[name]):
        config = changed_config((f"+experiment={name}", *overrides), RUNS)
        job = job_of(config, evaluations(config), root / name / str(number))
        if name == "sensitivity_values":
            job.directory.mkdir(parents=True)
            _write_values(job.directory / "checkpoint.pt", config)
        yield job


def evaluations(config: Config) -> Evaluations:
    """Return runs of a chain with 2 + run wrong situations, or of the two states."""
    situations = np.arange(0, config.situations + 1, config.evaluation.every)
    shape = (RUNS, len(situations))
    lengths, diverged = np.ones(shape), np.zeros(shape, dtype=bool)
    if config.env.kind == "chain":
        lengths = config.env.length + wrong_steps(config)
    else:
        diverged[:, 1:] = config.value.kind == "rbf" and config.env.time_limit_steps == 1
    return Evaluations(
        seed=np.arange(RUNS),
        lam=np.full(RUNS, config.lam),
        situations=situations,
        steps=np.concatenate([np.zeros((RUNS, 1)), lengths[:, 1:].cumsum(1)], 1).astype(np.int64),
        catches=np.ones(shape, dtype=np.int64),
        diverged=diverged,
        returns=np.zeros(shape),
        lengths=lengths,
    )


def wrong_steps(config: Config) -> NDArray[np.float64]:
    """Return the steps beyond the shortest way: n² without traces, else 2n, ``[runs, rows]``."""
    situations = np.arange(config.situations // config.evaluation.every + 1)
    length = config.env.length
    extra = length**2 if config.lam == 0 else 2 * length
    return extra * (situations <= 2 + np.arange(RUNS)[:, None]).astype(np.float64)


def _write_values(path: Path, config: Config) -> None:
    """Write tables that are λε off from Q*, or exact for Watkins."""
    off = config.lam * config.epsilon if config.variant == "peng" else 0.0
    own: Mapping[str, torch.Tensor] = {
        "weight": torch.from_numpy(exact_values(config.env, config.gamma) + off).repeat(RUNS, 1, 1)
    }
    save_checkpoint(path, own, np.arange(RUNS), np.full(RUNS, config.lam), asdict(config))
