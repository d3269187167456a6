from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from envs import make_world
from fnnq_torchrl.training.results import Outcome
from fnnq_torchrl.training.trainer import Trainer
from tests.compositions import config_of
from tests.programs import config, make_learner, make_runs

RUNS = 22
SETTINGS = config("situations=10")


def train(*, threads: int = 1, **changes: Any) -> tuple[Outcome, Tensor]:
    """Return the outcome of a short training, and the weights."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads)
    trainer = Trainer.of(replace(SETTINGS, **changes))
    trainer.learn()
    outcome = trainer.evaluate()
    torch.set_num_threads(before)
    return outcome, trainer.weights["weight"]


@pytest.fixture(scope="module")
def batch() -> tuple[Outcome, Tensor]:
    return train(num_seeds=RUNS, seed=7)


def test_every_run_has_a_row_and_padding_has_none(batch: tuple[Outcome, Tensor]) -> None:
    outcome, weights = batch
    assert outcome.seed.tolist() == list(range(7, 7 + RUNS))
    assert outcome.lam.tolist() == [0.2] * RUNS
    assert outcome.situations.tolist() == [0, 5, 10]
    assert outcome.steps.shape == outcome.catches.shape == (RUNS, 3)
    assert weights.shape == (RUNS, 5, 4)
    assert (outcome.steps[:, 0] == 0).all()
    in_five_situations = np.diff(outcome.steps)
    assert in_five_situations.min() >= 5 * 10
    assert in_five_situations.max() <= 5 * 14
    assert outcome.catches.min() >= 0
    assert outcome.catches.max() <= 5
    assert len(np.unique(outcome.catches)) > 2
    assert len(weights.unique(dim=0)) == RUNS


def test_a_run_alone_is_the_run_in_a_batch(batch: tuple[Outcome, Tensor]) -> None:
    outcome, weights = batch
    its_outcome, its_weights = train(seed=16)
    assert its_outcome.seed.tolist() == [16]
    assert its_outcome.steps.tolist() == outcome.steps[9:10].tolist()
    assert its_outcome.catches.tolist() == outcome.catches[9:10].tolist()
    assert torch.equal(its_weights, weights[9:10])


def test_on_two_threads_in_a_larger_batch(batch: tuple[Outcome, Tensor]) -> None:
    outcome, weights = batch
    its_outcome, its_weights = train(num_seeds=40, seed=0, threads=2)
    assert its_outcome.steps[7 : 7 + RUNS].tolist() == outcome.steps.tolist()
    assert its_outcome.catches[7 : 7 + RUNS].tolist() == outcome.catches.tolist()
    assert torch.equal(its_weights[7 : 7 + RUNS], weights)


@torch.no_grad()
def test_the_weights_are_those_of_the_last_evaluation(batch: tuple[Outcome, Tensor]) -> None:
    outcome, weights = batch
    run = make_runs(SETTINGS, 32, seed=torch.arange(7, 39))
    learner = make_learner(SETTINGS, run)
    state = learner.begin(run)
    last = outcome.steps[:, -1]
    for step in range(1, last.max() + 1):
        state = learner.step(run, state)
        for i in np.flatnonzero(last == step):
            assert state["situations"][i] == 10
            assert torch.equal(state["weights", "weight"][i], weights[i])


def test_it_tells_how_far_it_is() -> None:
    trainer = Trainer.of(replace(SETTINGS, num_seeds=3))
    assert trainer.situations_to_learn == 3 * 10
    assert trainer.situations_to_play == 3 * 3 * 5
    learned: list[int] = []
    played: list[int] = []
    trainer.learn(learned.append)
    outcome = trainer.evaluate(played.append)
    for progress, whole in ((learned, 30), (played, 45)):
        assert progress == sorted(progress)
        assert progress[-1] == whole
    assert outcome.train_seconds > 0
    assert outcome.evaluate_seconds > 0


def test_evaluating_changes_nothing() -> None:
    trainer = Trainer.of(replace(SETTINGS, num_seeds=3, situations=5))
    trainer.learn()
    weights = trainer.weights.clone()
    catches = trainer.evaluate().catches.tolist()
    assert trainer.evaluate().catches.tolist() == catches
    assert (trainer.weights == weights).all()


def test_the_global_random_state_is_neither_read_nor_touched(
    batch: tuple[Outcome, Tensor],
) -> None:
    torch.manual_seed(123)
    generator, grad = torch.get_rng_state(), torch.is_grad_enabled()
    _, weights = train(seed=7)
    assert torch.equal(torch.get_rng_state(), generator)
    assert torch.is_grad_enabled() is grad
    assert torch.equal(weights, batch[1][:1])


def learned(**changes: Any) -> Tensor:
    trainer = Trainer.of(replace(SETTINGS, situations=5, **changes))
    trainer.learn()
    return trainer.weights["weight"]


@pytest.fixture(scope="module")
def default_weights() -> Tensor:
    return learned()


@pytest.mark.parametrize(
    "change",
    [
        {"lam": 0.8},
        {"trace": "gradient"},
        {"action": replace(SETTINGS.action, candidates=5)},
        {"value": replace(SETTINGS.value, width="variance")},
        {"env": replace(SETTINGS.env, speed_mps=0.29)},
    ],
    ids=lambda change: next(iter(change)),
)
def test_the_configuration_reaches_the_learner(
    change: dict[str, Any], default_weights: Tensor
) -> None:
    assert not torch.equal(learned(**change), default_weights)


def test_double_precision() -> None:
    assert learned(machine=replace(SETTINGS.machine, dtype="float64")).dtype == torch.float64


def test_without_tests_the_scores_are_those_of_the_situations_learned_from() -> None:
    """In random walks, whose returns are the ends' rewards, and whose steps are all counted."""
    settings = config_of(
        "task=random_walk", "situations=4", "evaluation.every=2", "num_seeds=8", "engine=eager"
    )
    trainer = Trainer.of(settings)
    trainer.learn()
    outcome = trainer.evaluate()
    assert outcome.situations.tolist() == [0, 2, 4]
    assert np.isnan(outcome.returns[:, 0]).all()
    assert np.isnan(outcome.lengths[:, 0]).all()
    # Of two walks with k ends on the right, the mean return is (k − (2 − k))/2.
    assert np.array_equal(outcome.returns[:, 1:], outcome.catches[:, 1:] - 1.0)
    assert np.array_equal(outcome.lengths[:, 1:] * 2, np.diff(outcome.steps))
    assert outcome.lengths[:, 1:].min() >= 10
    assert {*outcome.catches[:, 1:].flatten().tolist()} == {0, 1, 2}
    # The rewards are those of the runs' own walks.
    env = make_world(settings.env, [8], seed=0)
    state, sums = env.reset(), torch.zeros(8, 1)
    while (state["episode"] < 2).any():
        counts = state["episode"] < 2
        after = env.step(state.set("action", torch.zeros(8, 1)))["next"]
        sums += torch.where(counts, after["reward"], 0)
        state = env.restart(after)
    assert np.array_equal(outcome.returns[:, 1], sums.squeeze(-1).numpy() / 2)


def test_rows_come_at_the_end_only_if_nothing_else_is_said() -> None:
    assert config_of("task=random_walk", "situations=30").evaluation.every == 30
