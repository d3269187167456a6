"""Rule bases: their values, their tables, controllers and explanations."""

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from fnnq_torchrl import FNNQValue, RuleBase, load_config
from fnnq_torchrl.agent.rules import FuzzySystem, Label, RulesError, Variable, partition
from fnnq_torchrl.agent.rules.system import fit_words
from tests.oracles.fuzzy import action_value
from tests.rule_bases import paper, systems

BEARING = [(-0.5, 0.4), (-0.1, 0.1), (0.0, 0.05), (0.1, 0.1), (0.5, 0.4)]
STEER = [(-1.0, 0.4), (-0.4, 0.3), (0.4, 0.3), (1.0, 0.4)]


def ramp(name: str) -> Variable:
    """Return a variable with two labels, whose degrees on [0, 1] are 1 − x and x."""
    low, high = Label("low", "triangle", (-1, 0, 1)), Label("high", "triangle", (0, 1, 2))
    return Variable(name, (low, high), 0, 1)


@given(bearing=st.floats(-1, 1), steer=st.floats(-1, 1))
@settings(max_examples=15)
def test_the_value_is_the_papers_equation_8(bearing: float, steer: float) -> None:
    rules = paper()
    expected = action_value(
        rules.consequents.flatten().tolist(), [bearing, steer], [BEARING, STEER]
    )
    given = rules.evaluate(torch.tensor([bearing, steer], dtype=torch.float64))
    assert given.item() == pytest.approx(expected, abs=1e-12)


def test_from_a_network_and_back() -> None:
    config = load_config()
    network = FNNQValue(config.value.inputs, config.value.action, torch.linspace(-1, 1, 21), runs=3)
    torch.nn.init.normal_(network.weight, generator=torch.Generator().manual_seed(2))
    rules = RuleBase.from_network(network, config.value, config.env, run=1)
    x = torch.linspace(-1e4, 1e4, 7).reshape(1, -1, 1)  # far outside, too: nothing underflows
    ours = rules.action_values(x[0].double())
    torch.testing.assert_close(network(x.expand(3, -1, -1))[1].double(), ours, atol=1e-5, rtol=0)
    again = rules.to_network(runs=2)
    assert torch.equal(again.weight, network.weight[1:2].expand(2, -1, -1))
    assert torch.equal(again.candidates, network.candidates)
    mean = RuleBase.from_network(network, config.value, config.env)
    torch.testing.assert_close(mean.consequents, network.weight.double().mean(0))


def test_by_the_minimum_t_norm_by_hand() -> None:
    """At (0.2, 0.6) the rules fire at 0.4 (low, low), 0.6 (low, high), 0.2 and 0.2 (high, …)."""
    numbers = torch.tensor([[1.0, 2.0], [3.0, 4.0]]).double()
    system = FuzzySystem((ramp("a"), ramp("b")), "q", numbers, "minimum")
    point = torch.tensor([0.2, 0.6]).double()
    assert system.evaluate(point).item() == pytest.approx((0.4 + 1.2 + 0.6 + 0.8) / 1.4)
    product = FuzzySystem((ramp("a"), ramp("b")), "q", numbers)
    assert product.evaluate(point).item() == pytest.approx(0.32 + 0.96 + 0.24 + 0.48)


@pytest.mark.parametrize(("elsewhere", "value"), [("nearest", 7.0), ("zero", 0.0)])
def test_where_no_label_fires(elsewhere: str, value: float) -> None:
    labels = (Label("a", "triangle", (0, 1, 2)), Label("b", "triangle", (5, 6, 7)))
    variable = Variable("x", labels, 0, 10)
    numbers = torch.tensor([3.0, 7.0]).double()
    system = FuzzySystem((variable,), "y", numbers, elsewhere=elsewhere)
    assert system.evaluate(torch.tensor([4.0])).item() == value
    assert system.evaluate(torch.tensor([1.5])).item() == 3
    [(_, start), (end, _), (last, _)] = [variable.gaps()[i] for i in (0, 1, 2)]
    assert (start, end, last) == (0, pytest.approx(2, abs=1e-3), pytest.approx(7, abs=1e-3))


@given(systems())
@settings(max_examples=10)
def test_strengths_are_shares(system: FuzzySystem) -> None:
    points = torch.linspace(-6, 6, 5).double().unsqueeze(-1).expand(-1, len(system.inputs))
    firing = system.firing(points).flatten(1)
    assert firing.min() >= 0
    fires = torch.ones(5).double()
    if system.elsewhere == "zero":  # a rule fires where a label of each input does
        for variable in system.inputs:
            fires *= (variable.log_degrees(points[:, 0]) > -math.inf).any(0)
    torch.testing.assert_close(firing.sum(1), fires)
    low, high = system.consequents.aminmax()
    values = system.evaluate(points)
    assert torch.equal(values[fires == 0], torch.zeros(int((fires == 0).sum())).double())
    if (fires == 1).any():
        inside = values[fires == 1]
        assert low - 1e-6 <= inside.min() <= inside.max() <= high + 1e-6


def test_words_and_signs() -> None:
    """+0.5 rad is to the left, Δv = +1 turns right."""
    rules = paper()
    first, last = rules.table()[0], rules.table()[-1]
    assert list(first.values())[:2] == ["far_right", "hard_left"]
    assert list(last.values())[:2] == ["far_left", "hard_right"]
    assert last["value"] == rules.consequents[-1, -1]
    assert (
        str(rules)
        .splitlines()[0]
        .startswith("if bearing is far_right and steer is hard_left then value is ")
    )
    assert rules._repr_markdown_().startswith("| bearing | steer | value |\n| --- |")


def test_labels_without_words_are_numbered() -> None:
    config = load_config("value.inputs.bearing=[[0,1],[1,1]]")
    bearing, steer = partition(config.value, config.env)
    assert bearing.names == ["label_1", "label_2"]
    assert steer.names == ["hard_left", "left", "right", "hard_right"]
    assert (bearing.low, bearing.high) == (-1, 1)


def test_the_controller_of_a_switch() -> None:
    """The best action is hard left for a ball on the left of the switch, else hard right."""
    rules = paper()
    numbers = torch.zeros(5, 4).double()
    numbers[:3, 3], numbers[3:, 0] = 1, 1  # hard_right to the right, hard_left to the left
    controller = RuleBase(rules.inputs, "value", numbers).controller()
    assert [stretch.action for stretch in controller.stretches] == [1, -1]
    [switch] = controller.switches
    at = torch.tensor([[switch.low - 1e-9], [switch.low + 1e-9]]).double()
    assert RuleBase(rules.inputs, "value", numbers).greedy(at).tolist() == [1, -1]
    assert controller.sentences()[0] == "if bearing is far_right then steer hard_right (+1.00)"
    assert controller.sentences()[-1] == "if bearing is far_left then steer hard_left (-1.00)"
    assert controller.distilled.consequents.abs().max() <= 1
    assert 0 < controller.mean_difference < controller.largest_difference <= 2


def test_the_controller_of_two_inputs_is_told_for_each_label_of_the_second() -> None:
    """If something is near, the best action is hard right, else as in the test before."""
    bearing, steer = paper().inputs
    labels = Label("near", "gaussian", (0.0, 0.1)), Label("far", "gaussian", (1.0, 0.1))
    sonar = Variable("sonar_m", labels, 0.2, 5)
    numbers = torch.zeros(5, 2, 4).double()
    numbers[:3, :, 3], numbers[3:, 1, 0], numbers[3:, 0, 3] = 1, 1, 1
    rules = RuleBase((bearing, sonar, steer), "value", numbers)
    controller = rules.controller()
    told = [(each.others, each.action) for each in controller.stretches]
    near, far = {"sonar_m": "near"}, {"sonar_m": "far"}
    assert told == [(near, 1), (far, 1), (far, -1)]
    [switch] = controller.switches
    at = torch.tensor([[switch.low - 1e-9, 1], [switch.low + 1e-9, 1]]).double()
    assert rules.greedy(at).tolist() == [1, -1]
    assert [(each.low, each.high) for each in controller.stretches[:2]] == [
        (-1, 1),
        (-1, switch.low),
    ]


def test_many_combinations_of_labels_are_not_told() -> None:
    bearing, steer = paper().inputs
    for labels, told in ((2, True), (3, False)):  # 50 and 75 combinations
        last = Variable("x4", bearing.labels[:labels], -1, 1)
        others = Variable("x2", bearing.labels, -1, 1), Variable("x3", bearing.labels, -1, 1), last
        numbers = torch.zeros(2, 5, 5, labels, 4).double()
        controller = RuleBase((ramp("x1"), *others, steer), "value", numbers).controller()
        assert (controller.stretches != []) == told


def test_a_policy_that_rules_can_say_is_distilled_exactly() -> None:
    """The least-squares fit to a policy of this form returns the policy's numbers."""
    from fnnq_torchrl.agent.rules.controller import distil

    numbers = torch.tensor([0.5, -0.25, 0.0, 0.125, -1.0]).double()
    bearing, steer = paper().inputs
    base = FuzzySystem((bearing,), "steer", numbers)
    controller = distil([bearing], steer, base.evaluate)
    torch.testing.assert_close(controller.distilled.consequents, numbers, atol=1e-6, rtol=0)
    assert controller.largest_difference < 1e-6


def test_an_explanation_adds_up() -> None:
    rules = paper()
    explanation = rules.explain({"bearing": 0.3})
    state = torch.tensor([0.3]).double()
    torch.testing.assert_close(explanation.values, rules.action_values(state))
    assert explanation.action == rules.greedy(state)
    added = sum(added for *_, added in explanation.fired(least=0))
    assert added == pytest.approx(explanation.values.max().item())
    assert f"{added:.4g}" in str(explanation).splitlines()[0]
    # Two labels are equally far from 0.3: the rule that adds more comes first, the same everywhere.
    tied = [
        row for row in explanation.fired(least=0.05) if row[1] == pytest.approx(0.103, abs=1e-3)
    ]
    assert len(tied) == 2
    assert abs(tied[0][3]) > abs(tied[1][3])
    with pytest.raises(RulesError, match=r"^'baring': did you mean bearing\?$"):
        rules.explain({"baring": 0.3})


@pytest.mark.parametrize(
    ("names", "fitted"),
    [
        (["left", "right"], ["left", "right"]),
        (["not poor?", "not poor!"], ["not_poor", "not_poor_2"]),
        (["Left", "left", "left_2"], ["Left", "left_2", "left_2_2"]),
        (["1st", "", "is", "é"], ["_1st", "_", "_is", "__2"]),
    ],
)
def test_names_are_made_fit_without_collisions(names: list[str], fitted: list[str]) -> None:
    assert fit_words(names) == fitted
    assert fit_words(fitted) == fitted


def test_what_is_no_rule_base() -> None:
    rules = paper()
    with pytest.raises(RulesError, match="must be \\[5, 4\\], not \\[4, 5\\]"):
        RuleBase(rules.inputs, "value", rules.consequents.T)
    with pytest.raises(RulesError, match="no finite number"):
        RuleBase(rules.inputs, "value", rules.consequents * math.nan)
    with pytest.raises(RulesError, match="two labels 'a'"):
        Variable("x", (Label("a", "gaussian", (0, 1)),) * 2)
    with pytest.raises(RulesError, match="did you mean gaussian"):
        Label("a", "gausian", (0, 1))
