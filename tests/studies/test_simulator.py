"""The page on learning among obstacles, written from made-up results."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl.studies.experiments import NoResults, read_experiment
from fnnq_torchrl.studies.rules.comparison import Comparison, compare
from fnnq_torchrl.studies.rules.job import read_job
from fnnq_torchrl.studies.simulator.page import write_page
from fnnq_torchrl.studies.simulator.rules import by_distance, outcomes, read_rules
from fnnq_torchrl.training.results import write_evaluations
from fnnq_torchrl.training.weights import save_checkpoint
from tests.compositions import config_of
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
    """A finished sweep, whose rules steer hard right if something is near on the left.

    The test is cut off after a few steps, so that it is played fast.
    """
    directory = tmp_path_factory.mktemp("sweep")
    for number, (overrides, level) in enumerate(JOBS.items()):
        job = directory / str(number)
        (job / ".hydra").mkdir(parents=True)
        settings = asdict(config_of(*overrides, f"num_seeds={RUNS}", "env.time_limit_steps=60"))
        (job / ".hydra" / "config.yaml").write_text(json.dumps(settings))
        evaluations = invented(settings, level)
        lengths = np.full(evaluations.lengths.shape, 400.0)
        lengths[:, 0] = 100
        write_evaluations(job / "evaluations.csv", replace(evaluations, lengths=lengths))
        (job / "summary.json").write_text("{}")
        weight = torch.zeros(RUNS, 5, 2, 2, 2, 4)
        weight[..., 1] = 1  # left
        weight[:, :, 0, :, :, 3] = 8  # hard right if something is near on the left
        seed, lam = np.arange(RUNS), np.zeros(RUNS)
        if job.name == "2":  # the rules without sonars
            weight = weight[:, :, 0, 0, 0]
        save_checkpoint(job / "checkpoint.pt", {"weight": weight}, seed, lam, settings)
    return directory


@pytest.fixture(scope="module")
def compared(sweep: Path) -> Comparison:
    return compare(read_job(sweep / "1"))


def test_the_page_has_the_results(sweep: Path) -> None:
    text = write_page(read_experiment(sweep, "simulator"))
    assert "drives 4.000 [4.000, 4.000] times as long" in text.replace("4.00 ", "4.000 ")
    assert "catches fewer (−" in text or "catches fewer (-" in text
    assert "| left | hard right (100%)" in text
    assert "| right | left (100%)" in text
    assert "near, in front and on the left: steer hard right (100%) if the ball is ahead" in text
    assert "one number for each of 40\ncombinations" in text
    assert "{" not in text


def test_rules_are_read_by_the_names_of_their_inputs(compared: Comparison, sweep: Path) -> None:
    advice = read_rules(compared)
    for each in advice:
        steering = {words for words, _ in each.steering.values()}
        assert steering == ({"hard right"} if "left" in each.near else {"left"})
    # Each step of a run's test fires rules whose firing strengths add up to 1.
    steps = compared.learned.counts.sum() / RUNS
    assert sum(each.steps for each in advice) == pytest.approx(float(steps))
    with pytest.raises(NoResults, match="the rules must have the inputs bearing, sonar_front_m"):
        read_rules(compare(read_job(sweep / "2")))


def test_every_situation_has_one_end(compared: Comparison) -> None:
    for played in (compared.learned, compared.distilled):
        ends = outcomes(played, -1)
        assert (ends.catches + ends.collisions + ends.late == 10).all()
        assert (ends.catches == played.successes.numpy()).all()
        # A collision pays −1, a catch +1, and the time limit −0.5.
        paid = ends.catches - ends.collisions - 0.5 * ends.late
        assert paid / 10 == pytest.approx(played.returns.numpy(), abs=1e-6)


def test_steps_are_divided_by_distance(compared: Comparison) -> None:
    partly, otherwise = by_distance(compared)
    assert (partly.all + otherwise.all == compared.learned.counts.sum((0, 2)).numpy()).all()
    assert (partly.opposite <= partly.all).all()
    # The learned rules turn right from a share of 1/9 of near, the distilled ones from 0.4/1.4.
    assert 0 < partly.opposite.sum() < partly.all.sum()
    assert (partly.as_near == partly.opposite).all()
    assert otherwise.opposite.sum() < partly.opposite.sum()


def test_a_job_that_is_missing_is_told(sweep: Path) -> None:
    experiment = read_experiment(sweep, "simulator")
    with pytest.raises(NoResults, match=r"lacks λ = 0, λ = 0\.2 or the job without sonars"):
        write_page(type(experiment)("simulator", experiment.jobs[1:]))
