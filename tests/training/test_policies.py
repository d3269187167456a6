"""The policy of a finished job drives a rollout."""

from pathlib import Path

import pytest
import torch

from envs import FollowBall
from fnnq_torchrl import load_policy
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.weights import load_checkpoint
from tests.compositions import config_of
from tests.programs import SMALL_WORLD

CONFIG = config_of("situations=30", "num_seeds=4", "seed=5", "engine=eager", *SMALL_WORLD)


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("job")
    run_job(CONFIG, directory)
    return directory


def test_it_plays_as_the_job_was_tested(job: Path) -> None:
    """Only the sensor's noise differs, since it is new in each evaluation."""
    situations = torch.tensor(CONFIG.evaluation.situations)
    scores = read_evaluations(job / "evaluations.csv").catches[:, -1]
    caught = []
    for seed in range(5, 9):
        env = FollowBall(CONFIG.env, [1], situations=situations[0], seed=seed)
        caught.append(env.rollout(14, load_policy(job, seed))["next", "success"].any().item())
    assert 0 <= sum(caught) <= 4
    assert scores.max() > 0


def test_a_run_is_found_by_its_seed(job: Path) -> None:
    weights = load_checkpoint(job / "checkpoint.pt").weights["weight"]
    every = load_policy(str(job))
    assert torch.equal(every.value_network.weight, weights)
    assert torch.equal(load_policy(job, seed=7).value_network.weight, weights[2:3])
    assert every.epsilon == 0
    state = FollowBall(CONFIG.env, [4], seed=0).reset()
    assert torch.equal(
        every(state.clone())["action"][2:3], load_policy(job, 7)(state[2:3])["action"]
    )


def test_there_is_no_such_run(job: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"has no run with seed=3; it has 5 to 8$"):
        load_policy(job, seed=3)
    with pytest.raises(FileNotFoundError):
        load_policy(tmp_path)
