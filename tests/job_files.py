"""Files of finished jobs: invented ones, as the loggers read them, and trained ones."""

import json
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imsave
from PIL import Image

from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.results import (
    Evaluations,
    Outcome,
    summarise,
    write_evaluations,
    write_summary,
)

from .compositions import config_of
from .experiment_files import invented


def keys_read(schema: type, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Return a set that collects the keys of a schema that are read from now on."""
    keys = set()

    def recording(self: object, name: str) -> object:
        if name in schema.__dataclass_fields__:
            keys.add(name)
        return object.__getattribute__(self, name)

    monkeypatch.setattr(schema, "__getattribute__", recording)
    return keys


def write_job(directory: Path, *overrides: str, sweep: Path | None = None) -> Job:
    """Write the files of a finished job with these overrides; its pictures have a single colour."""
    job = Job(config_of("situations=40", *overrides), directory, sweep)
    directory.mkdir(parents=True, exist_ok=True)
    evaluations = invented(asdict(job.config), 4.0)
    outcome = Outcome(
        **{field.name: getattr(evaluations, field.name) for field in fields(Evaluations)},
        batch_runs=evaluations.runs,
        batch_learning_steps=evaluations.learning_steps,
        train_seconds=2.0,
        compile_seconds=1.0,
        evaluate_seconds=0.5,
    )
    write_evaluations(directory / "evaluations.csv", outcome)
    write_summary(directory / "summary.json", summarise(outcome))
    imsave(directory / "learning_curve.png", np.full((6, 8, 3), [1.0, 0.5, 0.0]))
    if job.config.logger.video:
        frames = [Image.new("RGB", (6, 4), colour) for colour in ("red", "blue")]
        frames[0].save(directory / "robot.gif", save_all=True, append_images=frames[1:])
    return job


def train_job(directory: Path, *overrides: str) -> Path:
    """Train a job in a directory, and write the configuration as the train command does."""
    config, settings = config_of(*overrides), directory / ".hydra"
    settings.mkdir(parents=True)
    run_job(config, directory)
    (settings / "config.yaml").write_text(json.dumps(asdict(config)))
    task = {"overrides": {"task": overrides}}
    (settings / "hydra.yaml").write_text(json.dumps({"hydra": task}))
    return directory
