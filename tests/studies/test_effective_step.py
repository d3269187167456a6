import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from fnnq_torchrl.agent.values import FNNQValue
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.studies.effective_step import effective_step, squared_gradient
from tests.programs import config

ACTIONS = torch.linspace(-1, 1, 21, dtype=torch.float64)


@pytest.mark.parametrize("width", ["sigma", "variance"])
@given(st.floats(-1, 1), st.floats(-1, 1))
def test_the_norm_is_that_of_the_networks_gradient(
    width: str, bearing: float, action: float
) -> None:
    labels = config().value
    network = FNNQValue(labels.inputs, labels.action, ACTIONS, width=width)
    s, a = (torch.tensor([[x]], dtype=torch.float64) for x in (bearing, action))
    (gradient,) = torch.autograd.grad(network(s, action=a).sum(), [network.weight])
    norm = squared_gradient([(labels.inputs["bearing"], s), (labels.action, a)], width)
    torch.testing.assert_close(norm.squeeze(), gradient.square().sum(), rtol=1e-10, atol=0)
    assert 1 / 20 - 1e-9 <= norm <= 1  # f has 20 shares, whose sum is 1


@pytest.mark.parametrize("trace", ["output", "gradient"])
@pytest.mark.parametrize("decay", [0.0, 0.19, 0.76])
def test_a_step_after_long_at_one_pair_is_as_large_as_derived(trace: str, decay: float) -> None:
    gradient = torch.tensor([0.5, 0.3, 0.2], dtype=torch.float64).unsqueeze(-1)
    one, decays = torch.ones(1, dtype=torch.float64), torch.tensor([decay], dtype=torch.float64)
    e = torch.zeros_like(gradient)
    for _ in range(300):
        rule = Rule(trace=trace)
        credit = rule.credit(one, one, decays, None, one)
        [(direction, e)] = rule.trace.update([e], [gradient], credit)
    alpha = 0.4
    moved = alpha * (direction * gradient).sum(0)  # the movement of Q(s, a) for an error of 1
    expected = effective_step(gradient.square().sum(0), alpha, decays, trace)
    torch.testing.assert_close(moved, expected, rtol=1e-12, atol=0)


def test_in_a_table_both_readings_are_the_same() -> None:
    one, decay = torch.ones(1), torch.linspace(0, 0.9, 5)
    steps = [effective_step(one, 0.4, decay, trace) for trace in ("output", "gradient")]
    torch.testing.assert_close(*steps)
    torch.testing.assert_close(steps[0], 0.4 / (1 - decay))
