"""The page on learning among obstacles, written from made-up results."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.studies.experiments import NoResults, read_experiment
from fnnq_torchrl.studies.simulator.page import write_page
from fnnq_torchrl.studies.simulator.rules import in_words, read_rules
from fnnq_torchrl.training.results import write_evaluations
from fnnq_torchrl.training.weights import save_checkpoint
from tests.experiment_files import invented

HUNT = "task=follow_obstacles"
JOBS = {
    (HUNT, "lam=0"): 4.0,
    (HUNT, "lam=0.2"): 4.5,
    (HUNT, "lam=0.2", "value/labels@value=follow"): 2.0,
    ("task=wander", "lam=0"): 4.0,
    ("task=wander", "lam=0.2"): 4.0,
}
RUNS = 20


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished sweep, whose rules steer hard right if something is near on the left."""
    directory = tmp_path_factory.mktemp("sweep")
    for number, (overrides, level) in enumerate(JOBS.items()):
        job = directory / str(number)
        (job / ".hydra").mkdir(parents=True)
        settings = asdict(load_config(*overrides, f"num_seeds={RUNS}"))
        (job / ".hydra" / "config.yaml").write_text(json.dumps(settings))
        evaluations = invented(settings, level)
        lengths = np.full(evaluations.lengths.shape, 400.0)
        lengths[:, 0] = 100
        write_evaluations(job / "evaluations.csv", replace(evaluations, lengths=lengths))
        (job / "summary.json").write_text("{}")
        weight = torch.zeros(RUNS, 5, 2, 2, 2, 4)
        weight[..., 1] = 1  # left
        weight[:, :, 0, :, :, 3] = 2  # hard right if something is near on the left
        seed, lam = np.arange(RUNS), np.zeros(RUNS)
        save_checkpoint(job / "checkpoint.pt", {"weight": weight}, seed, lam, settings)
    return directory


def test_the_page_has_the_results(sweep: Path) -> None:
    text = write_page(read_experiment(sweep, "simulator"))
    assert "drives 4.000 [4.000, 4.000] times as long" in text.replace("4.00 ", "4.000 ")
    assert "catches fewer (−" in text or "catches fewer (-" in text
    assert "| left | hard right (100%)" in text
    assert "| right | left (100%)" in text
    assert "near, in front and on the left: steer hard right if the ball is ahead" in text
    assert "{" not in text


def test_rules_are_read_by_the_names_of_their_inputs(sweep: Path) -> None:
    job = read_experiment(sweep, "simulator").jobs[1]
    for advice in read_rules(job):
        steering = {dv for dv, _ in advice.steering.values()}
        assert steering == ({1.0} if "left" in advice.near else {-0.4})
    with pytest.raises(NoResults, match="its rules must have the inputs bearing, sonar_front_m"):
        read_rules(read_experiment(sweep, "simulator").jobs[2])


def test_steering_in_words() -> None:
    words = [in_words(dv) for dv in (-1, -0.4, 0.4, 1)]
    assert words == ["hard left", "left", "right", "hard right"]


def test_a_job_that_is_missing_is_told(sweep: Path) -> None:
    experiment = read_experiment(sweep, "simulator")
    with pytest.raises(NoResults, match=r"lacks λ = 0, λ = 0\.2 or the job without sonars"):
        write_page(type(experiment)("simulator", experiment.jobs[1:]))
