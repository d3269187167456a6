"""The learner whose parameters adapt, beside its twin in plain Python."""

from itertools import islice

import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.equations import reward_means
from tests.compositions import config_of
from tests.oracles.ring import doya
from tests.programs import advance, make_learner, make_runs

RUNS, STEPS = 6, 150


def ring(*overrides: str) -> Config:
    world = ("task=ring", "env.states=4", "env.far_reward=6", "env.situation_steps=50")
    return config_of(*world, "adaptive=doya", "machine.dtype=float64", *overrides)


def different_runs(settings: Config) -> TensorDict:
    among = torch.arange(RUNS, dtype=torch.float64)
    return make_runs(
        settings,
        RUNS,
        alpha=0.1 + among / 10,
        temperature=1 / (1 + among),
        gamma=0.99 - among / 20,
        adaptive_rate=among / 20,
        adaptive_period=1 + 7 * among,
        adaptive_short=5 + among,
        adaptive_long=9 - among,
    )


def twin(run: TensorDict, settings: Config):
    values = {key: run[key].item() for key in ("seed", "alpha", "temperature", "gamma")}
    values |= {key: run[f"adaptive_{key}"].item() for key in ("rate", "short", "long")}
    return doya(
        values.pop("seed"),
        4,
        6,
        period=int(run["adaptive_period"]),
        affine=settings.adaptive_beta == "affine",
        parameters=tuple(settings.adaptive_parameters),
        **values,
    )


@pytest.mark.parametrize(
    "overrides",
    [
        ("adaptive_beta=exponential",),
        ("adaptive_beta=affine",),
        ("adaptive_parameters=[temperature]",),
        ("adaptive_parameters=[alpha,temperature]",),
    ],
    ids=" ".join,
)
def test_a_learner_that_adapts_is_its_twin(overrides: tuple[str, ...]) -> None:
    settings = ring(*overrides)
    runs = different_runs(settings)
    learned = advance(make_learner(settings, runs), runs, STEPS)
    for i in range(RUNS):
        expected = next(islice(twin(runs[i], settings), STEPS - 1, None))
        q = torch.tensor(expected.q, dtype=torch.float64)
        torch.testing.assert_close(learned["weights", "weight"][i], q, rtol=1e-8, atol=1e-10)
        assert learned["world", "state"][i].item() == expected.state
        found = {"alpha": learned["alpha"], "long_mean": learned["adaptive", "long_mean"]}
        found |= {key: learned["adaptive"].get(key, runs[key]) for key in ("temperature", "gamma")}
        for key, value in found.items():
            assert value[i].item() == pytest.approx(getattr(expected, key), rel=1e-8), key


def test_a_situation_of_a_world_without_end_truncates_nothing() -> None:
    """With a trace, one more situation than steps would end changes nothing but their number."""
    trace = ("adaptive=none", "lam=0.9")
    learned = []
    for settings in (ring(*trace), ring(*trace, "env.situation_steps=100000")):
        runs = make_runs(settings, RUNS)
        learned.append(advance(make_learner(settings, runs), runs, STEPS))
    for key in ("weights", "trace", "world"):
        assert (learned[0][key] == learned[1][key]).all(), key
    assert (learned[0]["situations"] == STEPS // 50).all()
    assert (learned[1]["situations"] == 0).all()


@torch.no_grad()
def test_the_watch_sees_what_the_twins_means_say(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its means are over 100 steps, and its record begins again after each evaluation."""
    monkeypatch.setattr(reward_means, "SETTLING_STEPS", 350)
    easy = ("env.states=2", "env.far_reward=3", "temperature=0.1", "alpha=0.5", "gamma=0.5")
    settings = ring(*easy, "adaptive=none", "env.situation_steps=500", "evaluation.every=1")
    runs = make_runs(settings, 3, temperature=torch.tensor([0.1, 0.2, 5]))
    learner = make_learner(settings, runs)
    state, shares = learner.begin(runs), []
    for _ in range(500):
        state = learner.step(runs, state)
        shares.append(state["watch", "long"].flatten())
    late = torch.stack(shares)[350:]  # the best mean is 1
    told = {key: value.flatten() for key, value in state["snapshot", "told"].items()}
    assert told["solved"].tolist() == (late > 0.95).any(0).tolist() == [True, True, False]
    for i in range(2):
        rest = late[(late[:, i] > 0.95).int().argmax() :, i]
        assert told["lowest"][i] == rest.min()
        assert told["later"][i] == len(rest)
        assert told["above"][i] == (rest > 0.95).sum()
    assert not state["watch", "solved"].any()
    assert torch.equal(state["watch", "long"].flatten(), shares[-1])


@torch.no_grad()
def test_a_reward_that_is_not_a_number_stops_its_run_alone() -> None:
    settings = ring()
    runs = different_runs(settings)
    learner = make_learner(settings, runs)
    usual = learner.env.transition

    def spoilt(state, action):
        after = usual(state, action)
        spoils = (state["step"] == 20) & (state["seed"] == 2)
        return after | {"reward": after["reward"].masked_fill(spoils, torch.nan)}

    learner.env.transition = spoilt
    found = advance(learner, runs, 100)
    expected = advance(make_learner(settings, runs), runs, 100)
    others = torch.arange(RUNS) != 2
    assert found["diverged"].flatten().tolist() == (~others).tolist()
    assert (found[others] == expected[others]).all()
