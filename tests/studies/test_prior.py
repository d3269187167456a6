"""The page on prior knowledge, written from made-up results."""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl import prior
from fnnq_torchrl.studies.experiments import Experiment, NoResults, newest_experiment
from fnnq_torchrl.studies.prior.arms import NOTHING, ROUGH, WRONG, find, read_arms
from fnnq_torchrl.studies.prior.page import write_page
from fnnq_torchrl.training.results import write_evaluations
from fnnq_torchrl.training.start import read_start
from fnnq_torchrl.training.weights import save_checkpoint
from tests.compositions import config_of
from tests.experiment_files import invented

RUNS = 40
LEVELS = {
    ("rules=none",): 4.0,
    ("rules=hopeful",): 4.4,
    ("rules=rough", "rules.margin=0.1"): 4.1,
    ("rules=rough", "rules.margin=0.5"): 4.8,
    ("rules=wrong", "rules.margin=0.1"): 3.0,
    ("rules=wrong", "rules.margin=0.5"): 3.5,
    ("rules=operator", "rules.margin=0.1"): 4.0,
    ("rules=operator", "rules.margin=0.5"): 4.6,
}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Made-up jobs, in all of which the runs learned the rough controller."""
    root = tmp_path_factory.mktemp("outputs")
    rough = read_start(config_of("rules=rough"))
    assert rough is not None
    for number, (overrides, level) in enumerate(LEVELS.items()):
        directory = root / "prior" / "2026-01-02_03-04-05" / str(number)
        (directory / ".hydra").mkdir(parents=True)
        settings = asdict(config_of(*overrides, f"num_seeds={RUNS}"))
        (directory / ".hydra" / "config.yaml").write_text(json.dumps(settings))
        write_evaluations(directory / "evaluations.csv", invented(settings, level))
        weights = rough.consequents.expand(RUNS, 5, 4).float().clone()
        save_checkpoint(
            directory / "checkpoint.pt", {"weight": weights}, range(RUNS), [0.2] * RUNS, settings
        )
        (directory / "summary.json").write_text("{}")
    return root


@pytest.fixture(scope="module")
def experiment(results: Path) -> Experiment:
    return newest_experiment(results, "prior")


def test_the_arms(experiment: Experiment) -> None:
    arms = read_arms(experiment)
    assert [arm.words for arm in arms[:4]] == [
        "nothing",
        "high hopes",
        "rough controller, 0.1",
        "rough controller, 0.5",
    ]
    rough, wrong, nothing = find(arms, ROUGH, 0.5), find(arms, WRONG, 0.5), find(arms, NOTHING)
    assert float(nothing.start.abs().max()) == 0
    # The wrong controller's values are the rough controller's, with the states in reverse order.
    torch.testing.assert_close(wrong.start, rough.start.flip(0))
    np.testing.assert_array_equal(rough.distance_to(rough.start), np.zeros(RUNS))
    # All runs steer like the rough controller, so their distance is that of the two controllers.
    bearings = torch.linspace(-0.9, 0.9, 181, dtype=torch.float64).unsqueeze(-1)
    greedy = [
        type(arm.rules)(arm.rules.inputs, "value", arm.start).greedy(bearings)
        for arm in (rough, wrong)
    ]
    expected = float((greedy[0] - greedy[1]).abs().mean())
    np.testing.assert_allclose(rough.distance_to(wrong.start), np.full(RUNS, expected), atol=1e-6)


def test_the_page_says_what_the_results_say(experiment: Experiment) -> None:
    text = write_page(read_arms(experiment))
    rough, wrong, operator, hope, margin = [
        line for line in text.splitlines() if line.startswith("* **")
    ]
    assert " more in the first 10 evaluations, and " in rough
    assert wrong.endswith("Learning does not correct it.")
    assert " more in the first 10 evaluations" in operator
    assert " less, and the operator" in hope
    assert margin.startswith("* **The margin matters.** With 0.1 instead of 0.5")


def test_a_foreign_job_is_told(experiment: Experiment) -> None:
    job = experiment.jobs[0]
    job = type(job)(
        job.settings | {"rules.prior": "other.txt"}, job.evaluations, job.config, job.directory
    )
    with pytest.raises(NoResults, match="isn't a job of experiment=prior"):
        read_arms(Experiment("prior", [job]))


def test_the_command_writes_page_and_figures(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["prior", "--results", str(results), "--to", str(tmp_path)])
    prior.main()
    written = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()}
    figures = {f"figures/{name}{suffix}" for name in ("prior", "prior_rules")
               for suffix in (".png", ".svg")}  # fmt: skip
    assert written == {"prior.md"} | figures
