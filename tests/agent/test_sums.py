"""Rule bases that add up."""

import pytest
import torch

from envs.core.parameters import ConfigError
from fnnq_torchrl.agent.values import FNNQSumValue, FNNQValue
from fnnq_torchrl.launch.composition import load_config
from tests.compositions import config_of

LABELS = {"near": [(0.0, 0.5), (1.0, 0.5)], "far": [(-1.0, 1.0), (0.0, 0.3), (1.0, 1.0)]}
ACTION = [(-1.0, 0.5), (1.0, 0.5)]
CANDIDATES = torch.linspace(-1, 1, 5, dtype=torch.float64)
SEEN = torch.rand(2, 4, 1, dtype=torch.float64)


def filled(network: torch.nn.Module) -> torch.nn.Module:
    generator = torch.Generator().manual_seed(0)
    for weight in network.parameters():
        weight.data.copy_(torch.randn(weight.shape, generator=generator, dtype=torch.float64))
    return network


def test_one_group_of_all_inputs_is_the_whole_rule_base():
    whole = filled(FNNQValue(LABELS, ACTION, CANDIDATES, runs=4))
    one = filled(FNNQSumValue(LABELS, ACTION, [["near", "far"]], CANDIDATES, runs=4))
    assert one(*SEEN).equal(whole(*SEEN))


def test_groups_add_up():
    both = filled(FNNQSumValue(LABELS, ACTION, [["near"], ["far", "near"]], CANDIDATES, runs=4))
    first, second = both.parts
    assert first.weight.shape == (4, 2, 2)
    assert second.weight.shape == (4, 3, 2, 2)
    near, far = SEEN
    action = torch.rand(4, 1, dtype=torch.float64)
    for chosen in (None, action):
        parts = first(near, action=chosen) + second(far, near, action=chosen)
        assert both(near, far, action=chosen).equal(parts)


def test_the_configuration_says_which():
    task = ("task=follow_obstacles", "value=fnnq_sum")
    config = config_of(*task)
    assert config.value.groups == [[name] for name in config.value.inputs]
    rules = "value.rules=[[bearing],[sonar_left_m,sonar_front_m,sonar_right_m]]"
    network = FNNQSumValue.from_config(config_of(*task, rules).value, CANDIDATES, 1)
    assert sum(weight.numel() for weight in network.parameters()) == 4 * (5 + 2 * 2 * 2)


@pytest.mark.parametrize(
    ("rules", "line"),
    [
        ("[[bearing]]", "must be groups that include every input, also sonar_left_m"),
        ("[[ball]]", "must be groups of the inputs: bearing, sonar_left_m, sonar_front_m, "),
        ("[[]]", "must be a list of groups [name, …] of different names, or null"),
        ("[[bearing,bearing]]", "must be a list of groups [name, …] of different names, or null"),
    ],
)
def test_groups_that_are_none_are_told_in_a_line(rules, line):
    with pytest.raises(ConfigError, match=r"^value\.rules=") as refused:
        load_config("task=follow_obstacles", "value=fnnq_sum", f"value.rules={rules}")
    assert line in str(refused.value)
