"""Demonstrations, and consequents that follow them."""

from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from fnnq_torchrl.agent.imitation import Demonstrations, imitate, read_demonstrations
from fnnq_torchrl.agent.rules import RuleBase, RulesError
from tests.rule_bases import paper

VARIABLES = paper().inputs


def rule_base(consequents: torch.Tensor) -> RuleBase:
    return RuleBase(VARIABLES, "value", consequents, candidates=paper().candidates)


def demonstrated(rules: RuleBase, steps: int = 300, seed: int = 0) -> Demonstrations:
    generator = torch.Generator().manual_seed(seed)
    states = 2 * torch.rand(steps, 1, generator=generator, dtype=torch.float64) - 1
    return Demonstrations(states, rules.greedy(states))


def blank() -> RuleBase:
    return rule_base(torch.zeros(5, 4, dtype=torch.float64))


@given(st.integers(0, 10**6))
@settings(max_examples=6)
def test_an_operator_who_has_rules_is_followed(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    operator = rule_base(torch.randn(5, 4, generator=generator, dtype=torch.float64))
    demonstrations = demonstrated(operator, seed=seed)
    network = blank().to_network(dtype=torch.float64)
    fit = imitate(network, demonstrations, margin=0.5)
    greedy = rule_base(fit.weights[0]).greedy(demonstrations.states)
    assert fit.agreement >= 0.8  # the margin costs some states between two rules
    same = (greedy - demonstrations.actions).abs() < 1e-9
    assert float(same.double().mean()) == pytest.approx(fit.agreement)
    mean = float((greedy - demonstrations.actions).abs().mean())
    assert mean == pytest.approx(fit.mean_difference)


@pytest.mark.long
def test_the_order_of_the_steps_does_not_matter_and_what_is_careless_does_little() -> None:
    states = torch.linspace(-1, 1, 400, dtype=torch.float64).unsqueeze(-1)
    actions = torch.where(states.squeeze(-1) > 0, -1.0, 1.0)
    careless = actions.clone()
    careless[::5] = torch.linspace(-1, 1, 80, dtype=torch.float64)
    network = blank().to_network(dtype=torch.float64)
    fit = imitate(network, Demonstrations(states, careless), margin=0.5)
    turned = imitate(network, Demonstrations(states.flip(0), careless.flip(0)), margin=0.5)
    torch.testing.assert_close(fit.weights, turned.weights, rtol=1e-3, atol=1e-3)
    followed = rule_base(fit.weights[0]).greedy(states) == actions
    assert float(followed.double().mean()) > 0.9


def test_values_are_in_units_of_the_margin() -> None:
    demonstrations = demonstrated(paper())
    network = blank().to_network(dtype=torch.float64)
    one, ten = (imitate(network, demonstrations, margin=margin).weights for margin in (1, 10))
    torch.testing.assert_close(10 * one, ten, rtol=1e-3, atol=1e-3)


def test_it_starts_from_what_is_known_and_leaves_what_stays() -> None:
    known = rule_base(3 + torch.zeros(5, 4, dtype=torch.float64))
    learns = torch.ones(5, 4, dtype=torch.float64)
    learns[4], learns[0, 0] = 0, 0
    network = known.to_network(dtype=torch.float64)
    fit = imitate(network, demonstrated(paper()), margin=0.5, learns=learns)
    assert torch.equal(fit.weights[0] == 3, learns == 0)
    # In each state the mean over the actions has no say, so it stays near where it was.
    assert float((fit.weights[0, 1:4].mean(-1) - 3).abs().max()) < 1


def read(directory: Path, text: str) -> Demonstrations:
    path = directory / "operator.csv"
    path.write_text(text)
    return read_demonstrations(path, VARIABLES)


def test_read_in_any_order_of_columns(tmp_path: Path) -> None:
    read_back = read(tmp_path, "t, steer,bearing\n0,-0.5,0.25\n\n1,1e-1,-0.5\n")
    np.testing.assert_array_equal(read_back.states, [[0.25], [-0.5]])
    np.testing.assert_array_equal(read_back.actions, [-0.5, 0.1])


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", 1, "has no column bearing; expected columns bearing, steer"),
        ("bearing,action\n0,0\n", 1, "has no column steer"),
        ("bearing,steer,steer\n0,0,0\n", 1, "has two columns 'steer'"),
        ("bearing,steer\n", 1, "expected rows"),
        ("bearing,steer\n0,0\n0\n", 3, "has 1 columns; expected 2"),
        ("bearing,steer\n0,0\n0,x\n", 3, "steer 'x': expected a finite number"),
        ("bearing,steer\nnan,0\n", 2, "bearing 'nan': expected a finite number"),
        ("bearing,steer\n0,1.5\n", 2, "steer '1.5': expected a number in [-1, 1]"),
        ('bearing,steer\n0,0\n"0,0\n', 3, "is no CSV"),
    ],
)
def test_mistakes_are_told_with_their_line(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    with pytest.raises(RulesError) as refused:
        read(tmp_path, text)
    assert f"operator.csv:{line}:" in str(refused.value)
    assert words in str(refused.value)
