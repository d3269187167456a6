"""From a network to rules, to a file, and back to a network."""

from pathlib import Path

import pytest
import torch

from fnnq_torchrl.agent.rules import RuleBase, RulesError, explain, rule_bases
from fnnq_torchrl.agent.values import make_value_network
from tests.agent.test_values import CANDIDATES, VARIANTS
from tests.compositions import config_of


@pytest.mark.parametrize("ending", ["json", "txt", "fll", "fis"])
@pytest.mark.parametrize("name", ["mixed", "nearest", "zero", "minimum_mixed", "learned"])
def test_a_networks_labels_and_t_norm_come_back_from_a_file(
    name: str, ending: str, tmp_path: Path
) -> None:
    config = config_of(*VARIANTS[name])
    network = make_value_network(config.value, CANDIDATES, 1)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weight in network.parameters():
            weight.normal_(generator=generator)
    rules = RuleBase.from_network(network, config.value, config.env, run=0)
    path = tmp_path / f"rules.{ending}"
    gaps = any(variable.gaps() for variable in rules.inputs)
    if gaps and (ending == "fis" or (ending == "fll" and network.elsewhere == "nearest")):
        with pytest.raises(RulesError, match=rf"^\.{ending} can't say what fires at bearing "):
            rules.export(path)
        return
    rules.export(path)
    read = RuleBase.read(path)
    assert (read.t_norm, read.elsewhere) == (network.t_norm, network.elsewhere)
    bearing = torch.linspace(-1, 1, 41, dtype=torch.float64).view(1, -1, 1)
    again = RuleBase.from_system(read, rules.candidates).to_network(dtype=torch.float64)
    torch.testing.assert_close(again(bearing), network(bearing), rtol=1e-9, atol=1e-12)


GROUPS = "value.rules=[[sonar_right_m,sonar_front_m],[sonar_front_m,sonar_left_m]]"


def test_a_sum_of_rule_bases_is_a_single_one() -> None:
    config = config_of("task=wander", "value=fnnq_sum", GROUPS)
    network = make_value_network(config.value, CANDIDATES, 2)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weight in network.parameters():
            weight.normal_(generator=generator)
    parts = rule_bases(network, config.value, config.env, run=1)
    rules = RuleBase.from_sum(parts, network.in_keys)
    assert [len(part.states) for part in parts] == [2, 2]
    assert [each.name for each in rules.states] == network.in_keys
    seen = torch.rand(2, 50, 3, generator=generator, dtype=torch.float64) * 2
    expected = network(*seen.split(1, dim=-1))[1]
    torch.testing.assert_close(rules.action_values(seen[1]), expected)
    observation = dict(zip(network.in_keys, seen[1, 0].tolist(), strict=True))
    told = explain(parts, observation)
    torch.testing.assert_close(told.values, expected[0])
    torch.testing.assert_close(told.firing.sum(-1), torch.full((21,), 2.0).double())
    with pytest.raises(RulesError, match="sonar_right_m is missing; the rules are about"):
        explain(parts, {"sonar_left_m": 1.0})


def test_a_sum_that_is_no_single_rule_base_is_told() -> None:
    gaps = "{triangle: [0, 1, 2]}, {triangle: [3, 4, 5]}"
    labels = f"value.inputs.sonar_left_m=[{gaps}]"
    config = config_of("task=wander", "value=fnnq_sum", labels, "value.elsewhere=zero")
    network = make_value_network(config.value, CANDIDATES, 1)
    parts = rule_bases(network, config.value, config.env)
    with pytest.raises(RulesError, match="for labels with gaps, elsewhere=nearest"):
        RuleBase.from_sum(parts, network.in_keys)
