"""Invented result files of the two experiments about extrapolation."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import torch

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.results import write_evaluations
from fnnq_torchrl.training.weights import save_snapshots

from .compositions import config_of
from .experiment_files import invented
from .programs import SMALL_WORLD

RUNS = 4
SITUATIONS = (0, 5, 50, 200, 400)
ON_ONE_SIDE = ("env=follow_one_side", "env.switch_side_after=200", "env.other_view_rad=0.2")


@cache
def extrapolating(*overrides: str) -> Config:
    """Return a configuration of the experiment in the small world."""
    common = (f"num_seeds={RUNS}", "situations=400", *ON_ONE_SIDE, *SMALL_WORLD)
    return config_of(*common, *overrides)


def write_job(directory: Path, config: Config, level: float) -> None:
    """Write a finished job: its configuration and invented evaluations."""
    settings = asdict(config)
    (directory / ".hydra").mkdir(parents=True)
    (directory / ".hydra" / "config.yaml").write_text(json.dumps(settings))
    write_evaluations(directory / "evaluations.csv", invented(settings, level))
    (directory / "summary.json").write_text("{}")  # says that the job has finished


def write_snapshots(directory: Path, config: Config) -> None:
    """Write snapshots that begin with the network's initial weights and change at random."""
    candidates = make_candidates(config)
    seed = torch.arange(RUNS)
    start = make_value_network(config.value, candidates, 1).start(seed.unsqueeze(-1))
    generator = torch.Generator().manual_seed(0)
    weights = {}
    for name, first in start.items():
        steps = 0.1 * torch.randn(len(SITUATIONS), *first.shape, generator=generator)
        steps[0] = 0
        weights[name] = first + steps.cumsum(0)
    lam, path = [config.lam] * RUNS, directory / "snapshots.pt"
    save_snapshots(path, weights, SITUATIONS, seed.tolist(), lam, {"kind": config.value.kind})


def write_results(root: Path, kinds: Sequence[str]) -> None:
    """Write both experiments of these value functions; the best of α = 0.05, 0.1, 0.2 is 0.1.

    A kind with a comma, as in "fnnq, triangles", has two triangles as its labels.
    """
    for number, kind in enumerate(kinds):
        of_kind, _, labels = kind.partition(", ")
        two = "value.inputs.bearing=[{triangle: [-1.5, -0.5, 0.5]}, {triangle: [-0.5, 0.5, 1.5]}]"
        config = extrapolating(f"value={of_kind}", "alpha=0.1", *[two] * bool(labels))
        for place, decay in enumerate((config.alpha_decay, 1.0)):
            job = root / "extrapolation" / "2026-01-02_03-04-05" / str(2 * number + place)
            write_job(job, replace(config, alpha_decay=decay), 4.0)
            write_snapshots(job, config)
        for place, alpha in enumerate((0.05, 0.1, 0.2)):
            job = root / "value_functions" / "2026-01-02_03-04-05" / str(3 * number + place)
            write_job(job, replace(config, alpha=alpha), 4.5 - abs(alpha - 0.1) * 10)
