"""Fuzzy Q-learning: each rule chooses an action, and the executed action is their mean."""

from itertools import islice
from pathlib import Path

import gymnasium
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from tensordict import TensorDict

from envs import make_world
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.eligibility_trace import EligibilityTrace
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy, make_policy
from fnnq_torchrl.agent.rules import ChoiceRules, RulesError, explain, rule_bases
from fnnq_torchrl.agent.rules.formats import read_system
from fnnq_torchrl.agent.values import FuzzyQValue, make_value_network
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.launch.composition import load_config
from tests.compositions import config_of
from tests.oracles.fuzzy_q import fuzzy_q_learning
from tests.programs import SMALL_WORLD, make_learner, make_runs

IN_DOUBLE = ("value=fuzzy_q", "machine.dtype=float64")
HILLS = ("task=mountain_car", "env.time_limit_steps=20", "env.start_position=[0.35,0.45]")
RANGE = torch.tensor([-1.0, 1.0], dtype=torch.float64)


def network_of_two_rules(runs: int = 1) -> FuzzyQValue:
    """Return a network whose rules fire with 1 − x and x; they choose among −1, 0.5 and 1."""
    inputs = {"x": [{"triangle": [-1, 0, 1]}, {"triangle": [0, 1, 2]}]}
    action = [{"triangle": [a - 0.1, a, a + 0.1]} for a in (-1.0, 0.5, 1.0)]
    network = FuzzyQValue(inputs, action, RANGE, runs=runs)
    with torch.no_grad():
        network.weight.copy_(torch.tensor([[0.0, 2.0, 1.0], [4.0, 3.0, 0.0]]))
    return network


def state_at(x: float, runs: int = 1, episode: int = 0) -> dict[str, torch.Tensor]:
    whole = torch.zeros(runs, 1, dtype=torch.int64)
    return {
        "x": torch.full((runs, 1), x, dtype=torch.float64),
        "seed": torch.arange(runs).unsqueeze(-1),
        "episode": whole + episode,
        "step": whole,
    }


def test_a_step_by_hand() -> None:
    """x = 0.25, so φ = (0.75, 0.25); rule 1 chooses 0.5 with q = 2, rule 2 chooses −1 with q = 4.

    a = 0.75·0.5 − 0.25·1 = 0.125; Q = V = 0.75·2 + 0.25·4 = 2.5. The step ends at x = 1 with r = 1,
    where V = 4, so δ = δ′ = 1 + 0.5·4 − 2.5 = 0.5, and both rules' choices change by αφδ = 0.1φ.
    """
    network = network_of_two_rules()
    state = EpsilonGreedyPolicy(network, 0.0)(TensorDict(state_at(0.25), [1]))
    assert state["choices"].tolist() == [[0.5, -1.0]]
    assert state["action"].item() == pytest.approx(0.125)
    after = state_at(1.0) | {
        "reward": torch.ones(1, 1).double(),
        "terminated": torch.zeros(1, 1, dtype=torch.bool),
        "done": torch.zeros(1, 1, dtype=torch.bool),
    }
    batch = state.set("next", TensorDict(after, [1]))
    loss = PengQLambdaLoss(network, gamma=0.5)
    trace = EligibilityTrace(loss, 0.8, Rule("naive", "gradient"))
    losses = trace(batch, loss(batch))
    assert losses["chosen_action_value"].item() == pytest.approx(2.5)
    assert losses["td_error"].item() == losses["chosen_td_error"].item() == pytest.approx(0.5)
    losses["loss"].backward()
    step = -0.2 * network.weight.grad[0]
    torch.testing.assert_close(step, torch.tensor([[0, 0.075, 0], [0.025, 0, 0]]).double())
    # From x = 1 only rule 2 fires. If it now chooses 1 with q = 0, V(s′) = 0 and r = 0, then δ′ = 0
    # and δ = −4: Peng's variant takes 0.4·4 of φ from the earlier choices, the source's nothing.
    choices = torch.tensor([[0.5, 1.0]]).double()
    now = {"choices": choices, "action_value": network(torch.ones(1, 1).double())}
    after = {
        **after,
        "reward": torch.zeros(1, 1).double(),
        "terminated": torch.ones(1, 1).bool(),
    }
    batch = TensorDict({**state_at(1.0), **now, "next": TensorDict(after, [1])}, [1])
    for variant, lost in (("naive", 0.0), ("peng", 1.6), ("watkins", 0.0)):
        hook = EligibilityTrace(loss, 0.8, Rule(variant, "gradient"))
        hook.load_state_dict(trace.state_dict())
        network.weight.grad = None
        hook(batch, loss(batch))["loss"].backward()
        expected = torch.tensor([[0, 0.75 * lost, 0], [0.25 * lost, 0, 0]]).double()
        torch.testing.assert_close(network.weight.grad[0], expected)
        # Watkins' cut: rule 2 didn't choose its best.
        kept = 0.0 if variant == "watkins" else 0.3
        assert hook.trace["weight"][0, 0, 1].item() == pytest.approx(kept)


@pytest.mark.parametrize("variant", ["naive", "peng", "watkins"])
@pytest.mark.parametrize("world", [SMALL_WORLD, HILLS], ids=["ball", "hills"])
@torch.no_grad()
def test_it_is_its_twin(variant: str, world: tuple[str, ...]) -> None:
    config = config_of(*world, *IN_DOUBLE, f"variant={variant}")
    columns = {
        "seed": torch.tensor([3, 2**40, 7]),
        "lam": torch.tensor([0.0, 0.6, 0.9]).double(),
        "alpha": torch.tensor([0.2, 0.1, 0.4]).double(),
        "alpha_decay": torch.tensor([1.0, 0.9, 0.99]).double(),
        "gamma": torch.tensor([0.9, 1.0, 0.95]).double(),
        "epsilon": torch.tensor([0.3, 0.1, 0.0]).double(),
    }
    runs = make_runs(config, 3, epsilon_final=columns["epsilon"], **columns)
    learner = make_learner(config, runs)
    state, history = learner.begin(runs), []
    for _ in range(45):
        state = learner.step(runs, state)
        both = (state[name, "weight"].flatten(1, -2).clone() for name in ("weights", "trace"))
        history.append([*both])
    assert (state["situations"] >= 1).all()
    for i in range(3):
        env = make_world(config.env, [1], seed=0, dtype=torch.float64)
        own = {key: column[i].item() for key, column in columns.items()}
        labels, actions = config.value.inputs, [centre for centre, _ in config.value.action]
        twin = fuzzy_q_learning(env, labels, actions, variant=variant, **own)
        for (q, e), learned in zip(islice(twin, 45), history, strict=True):
            for expected, found in zip((q, e), learned, strict=True):
                expected = torch.tensor(expected, dtype=torch.float64)
                torch.testing.assert_close(found[i], expected, rtol=1e-9, atol=1e-12)


def test_every_rule_has_random_numbers_of_its_own() -> None:
    config = config_of("task=mountain_car", *IN_DOUBLE)
    network = make_value_network(config.value, make_candidates(config, torch.float64), 2_000)
    env = make_world(config.env, [2_000], seed=0, dtype=torch.float64)
    choices = EpsilonGreedyPolicy(network, 1.0)(env.reset())["choices"]
    assert choices.shape == (2_000, 30)
    first, second = choices[:, :-1].flatten().long(), choices[:, 1:].flatten().long()
    pairs = (3 * first + second).bincount(minlength=9).numpy()
    assert stats.chisquare(pairs).pvalue > 0.01
    again = EpsilonGreedyPolicy(network, 1.0)(env.reset())["choices"]  # the next episode's
    assert 0.3 < (again == choices).double().mean() < 0.37


@given(st.floats(-0.5, 1.5), st.sampled_from(["epsilon_greedy", "boltzmann"]))
def test_the_executed_action_lies_between_the_choices(x: float, exploration: str) -> None:
    network = network_of_two_rules(runs=8)
    policy = make_policy(exploration, network, 0.7)
    state = policy(TensorDict(state_at(x, 8), [8]))
    choices, action = state["choices"], state["action"]
    assert (choices.amin(-1, keepdim=True) <= action + 1e-12).all()
    assert (choices.amax(-1, keepdim=True) >= action - 1e-12).all()
    value = network(state["x"], action=choices)
    assert (value <= network.best(state["action_value"]) + 1e-12).all()
    best = state["action_value"].amax(-1).sum(-1, keepdim=True)
    torch.testing.assert_close(network.best(state["action_value"]), best)


def test_no_action_lies_beyond_the_range() -> None:
    """Neither that of a label whose middle does, nor a mean whose weights sum to 1 + 10⁻⁷."""
    inputs = {"x": [{"gaussian": [centre, 0.3]} for centre in (-1.0, -0.4, 0.3, 1.0)]}
    action = [{"triangle": [a - 1, a, a + 1]} for a in (-1.5, 0.0, 1.5)]
    network = FuzzyQValue(inputs, action, RANGE.float())
    assert network.candidates.tolist() == [-1, 0, 1]
    with torch.no_grad():
        network.weight[..., -1] = 1
    x = torch.linspace(-1, 1, 3_000).view(1, -1, 1)
    assert network._strengths(x).sum(0).max() > 1
    assert network.greedy(x).max() == 1


def test_the_boltzmann_policy_compares_the_rules_own_values() -> None:
    network = network_of_two_rules(runs=20_000)
    policy = make_policy("boltzmann", network, 0.5)
    chosen = policy(TensorDict(state_at(0.001, 20_000), [20_000]))["choices"][:, 1]
    # Rule 2 hardly fires, but chooses by its q = (4, 3, 0), not by its share of Q.
    expected = torch.softmax(torch.tensor([4.0, 3.0, 0.0]) / 0.5, 0)
    for action, share in zip((-1.0, 0.5, 1.0), expected.tolist(), strict=True):
        assert (chosen == action).double().mean().item() == pytest.approx(share, abs=0.015)


@pytest.mark.parametrize("ending", ["fll", "fis", "json", "txt"])
def test_the_greedy_policy_is_a_controller_in_every_format(ending: str, tmp_path: Path) -> None:
    config = config_of("task=mountain_car", *IN_DOUBLE)
    network = make_value_network(config.value, make_candidates(config, torch.float64), 2)
    with torch.no_grad():
        network.weight.normal_(generator=torch.Generator().manual_seed(0))
    [rules] = rule_bases(network, config.value, config.env, run=1)
    assert isinstance(rules, ChoiceRules)
    low, high = torch.tensor([-1.2, -0.07]), torch.tensor([0.5, 0.07])
    states = low + (high - low) * torch.rand(50, 2, dtype=torch.float64)
    expected = network.greedy(*states.expand(2, -1, -1).split(1, -1))[1].squeeze(-1)
    torch.testing.assert_close(rules.greedy(states), expected)
    assert rules.controller().largest_difference == 0
    seen = states.expand(2, -1, -1).split(1, -1)
    value = network.best(network(*seen))[1].squeeze(-1)
    torch.testing.assert_close(rules.state_values(states), value)
    assert (
        rules.firing(torch.cat([states, states[:, :1]], -1))
        .sum((1, 2, 3))
        .allclose(torch.ones(50).double())
    )
    [path] = rules.export(tmp_path / f"controller.{ending}", controller="full")
    torch.testing.assert_close(
        read_system(path).system.evaluate(states), expected, rtol=1e-7, atol=1e-8
    )
    with pytest.raises(RulesError, match=r"^controller=full or distilled is needed"):
        rules.export(tmp_path / f"values.{ending}")
    with pytest.raises(RulesError, match=r"^explain: fuzzy Q-learning compares no actions"):
        explain([rules], {"position": 0.0, "velocity": 0.0})


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["variant=sarsa"], "variant=sarsa: must be peng, watkins or naive with value=fuzzy_q"),
        (
            ["variant=expected_sarsa"],
            "variant=expected_sarsa: must be peng, watkins or naive with value=fuzzy_q",
        ),
        (
            ["exploration=noise"],
            "exploration=noise: must be epsilon_greedy or boltzmann with value=fuzzy_q",
        ),
        (
            ["task=gymnasium", "env.id=CartPole-v1", "value.labels_of_input=2"],
            "value.kind=fuzzy_q: must be another: gymnasium takes no action between two of its "
            "fixed set",
        ),
        (
            ["value.elsewhere=zero"],
            "value.elsewhere=zero: must be nearest, since a rule must choose",
        ),
        (
            ["value.action=[[1,0.1],[2,0.1]]"],
            "value.action=[[1, 0.1], [2, 0.1]]: must be labels with different middles in the range",
        ),
    ],
)
def test_what_choosing_rules_cant_do_is_told(overrides: list[str], line: str) -> None:
    with pytest.raises(ConfigError) as refused:
        load_config("value=fuzzy_q", *overrides)
    assert str(refused.value) == line


def test_what_choosing_rules_cant_do_is_told_in_python() -> None:
    network = network_of_two_rules()
    with pytest.raises(ValueError, match=r"^bootstrap='chosen': must be best"):
        PengQLambdaLoss(network, 0.9, bootstrap="chosen")
    with pytest.raises(ValueError, match=r"^exploration='noise': the rules must choose among"):
        make_policy("noise", network, 0.1)


def test_a_force_between_two_actions_is_gymnasiums() -> None:
    """MountainCarContinuous-v0 has the same dynamics, with a force from −1 to 1."""
    config = config_of("task=mountain_car", "env=mountain_car_gymnasium", "env.force=0.0015")
    env = make_world(config.env, [1], seed=0, dtype=torch.float64)
    theirs = gymnasium.make("MountainCarContinuous-v0")
    theirs.reset(seed=0)
    state = env.reset()
    theirs.unwrapped.state = torch.cat([state["position"], state["velocity"]], -1)[0].numpy()
    for force in torch.linspace(-1, 1, 60).double().tolist():
        given = torch.tensor([[force + 1]]).double()
        state = env.restart(env.step(state.set("action", given))["next"])
        theirs.step([force])
        ours = torch.cat([state["position"], state["velocity"]], -1)[0].numpy()
        assert ours == pytest.approx(theirs.unwrapped.state, rel=1e-6)  # theirs is in float32
        theirs.unwrapped.state = ours.copy()
