"""The chain and the two states have the steps and the values that hand calculation gives them."""

import numpy as np
import pytest
import torch

from envs import PureEnv, make_world
from envs.classic.chain import right_action
from fnnq_torchrl.training.trainer import Trainer
from tests.compositions import config_of


def chain(*overrides: str, runs: int) -> PureEnv:
    config = config_of("task=chain", *overrides)
    return make_world(config.env, [runs], seed=0, dtype=torch.float64)


@pytest.mark.parametrize(
    ("setback", "back"), [("1", [1, 1, 2, 3, 4]), ("2", [1, 1, 1, 2, 3]), ("null", [1] * 5)]
)
def test_the_right_action_leads_on_and_others_set_back(setback: str, back: list[int]) -> None:
    """Run i stands in state i + 1; the last of them reaches the end by the right action."""
    env = chain("env.length=5", "env.choices=3", f"env.setback={setback}", runs=5)
    state = env.reset()
    state["place"][:, 0] = places = torch.arange(1.0, 6.0).double()
    right = right_action(places, 3).unsqueeze(-1)
    for other in (1, 2):
        after = env.step(state.clone().set("action", (right + other) % 3))["next"]
        assert after["place"].flatten().tolist() == back
        assert not after["done"].any()
        assert not after["reward"].any()
    after = env.step(state.set("action", right))["next"]
    assert after["place"].flatten().tolist() == [2, 3, 4, 5, 6]
    assert after["reward"].flatten().tolist() == [0, 0, 0, 0, 1]
    assert after["terminated"].flatten().tolist() == [False] * 4 + [True]


def test_neighbours_have_other_right_actions() -> None:
    """0.618, 0.236, 0.854, 0.472, 0.090, 0.708 are the fractions of the first six multiples."""
    assert right_action(torch.arange(1, 7).double(), 2).tolist() == [1, 0, 1, 0, 0, 1]
    counts = torch.bincount(right_action(torch.arange(1, 301).float(), 3).int())
    assert counts.tolist() == pytest.approx([100, 100, 100], abs=2)


def test_an_unlearned_walk_takes_n_times_n_plus_1_steps() -> None:
    runs, length = 2_000, 4
    env = chain(f"env.length={length}", runs=runs)
    state, ends = env.reset(), torch.zeros(runs)
    actions = torch.Generator().manual_seed(0)
    for step in range(1, 250):
        state["action"] = torch.randint(2, (runs, 1), generator=actions).double()
        after = env.step(state)["next"]
        ends[(ends == 0) & after["done"].flatten()] = step
        state = env.restart(after)
    assert (ends > 0).all()
    error = ends.std().item() / runs**0.5
    assert ends.mean().item() == pytest.approx(length * (length + 1), abs=4 * error)


def test_a_table_learns_the_exact_values_of_the_chain() -> None:
    """The world is deterministic, so steps of α = 1 store each value exactly."""
    values = ["alpha=1", "lam=0", "epsilon=0.5", "gamma=0.5", "machine.dtype=float64"]
    trainer = Trainer.of(
        config_of(
            "task=chain", "env.length=4", *values, "situations=60", "num_seeds=2", "engine=eager"
        )
    )
    trainer.learn()
    of_state = np.array([1 / 8, 1 / 4, 1 / 2, 1])
    right = right_action(torch.arange(1.0, 5.0), 2).int().numpy()
    exact = np.empty((4, 2))
    exact[np.arange(4), right] = of_state
    exact[np.arange(4), 1 - right] = of_state[[0, 0, 1, 2]] / 2
    for table in trainer.weights["weight"].numpy():
        np.testing.assert_array_equal(table, exact)


@pytest.mark.parametrize("limit", [1, 2])
def test_the_weight_of_one_gaussian_spreads_as_calculated(limit: int) -> None:
    """E w² follows a linear recursion: w ← w + αφ(±1 + γw − φw), with φ = 1/2 or 1."""
    alpha, gamma, episodes, runs = 0.4, 0.95, 30, 4_000
    trainer = Trainer.of(
        config_of(
            *("task=two_states", "value.kind=rbf", "value.inputs={place: [[2, 0.849322]]}"),
            *(f"alpha={alpha}", "lam=0", f"env.time_limit_steps={limit}", "engine=eager"),
            *(f"situations={episodes}", f"num_seeds={runs}"),
        )
    )
    trainer.learn()
    squares = trainer.weights["weight"].flatten().square().double()

    def moved(square: float, phi: float) -> float:
        return square * (1 + alpha * phi * (gamma - phi)) ** 2 + (alpha * phi) ** 2

    expected = 0.0
    for _ in range(episodes):
        ends = []
        for phi in (0.5, 1.0):
            square = expected
            for step in range(limit):
                square = moved(square, phi if step == 0 else 1.0)
            ends.append(square)
        expected = sum(ends) / 2
    error = squares.std().item() / runs**0.5
    assert squares.mean().item() == pytest.approx(expected, abs=4 * error)
