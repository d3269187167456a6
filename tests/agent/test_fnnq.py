import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.agent.values import FNNQValue
from tests.oracles.fuzzy import action_value, normalised_firing_strengths

BEARING = [(-0.5, 0.4), (-0.1, 0.1), (0.0, 0.05), (0.1, 0.1), (0.5, 0.4)]
ACTION = [(-1.0, 0.4), (-0.4, 0.3), (0.4, 0.3), (1.0, 0.4)]
SPEED = [(0.0, 0.5), (1.0, 0.5)]
CANDIDATES = torch.linspace(-1, 1, 21, dtype=torch.float64)


def papers_network(
    runs: int = 1, width: str = "sigma", dtype: torch.dtype = torch.float64
) -> FNNQValue:
    return FNNQValue({"bearing": BEARING}, ACTION, CANDIDATES.to(dtype), runs=runs, width=width)


def fill(network: FNNQValue, seed: int = 0) -> FNNQValue:
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        network.weight.normal_(generator=generator)
    return network


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_all_weights_are_zero_at_the_start_and_so_is_q() -> None:
    network = papers_network(runs=3)
    assert network.weight.shape == (3, 5, 4)
    assert list(dict(network.named_parameters())) == ["weight"]
    q = network(real(0.2, -0.7, 0.0).view(3, 1))
    assert torch.equal(q, torch.zeros(3, 21, dtype=torch.float64))


# The consequents are w = 10·i + j for bearing label i and action label j. The first value is their
# mean, since the labels are symmetric. The others are eq. 7 and 8, computed in plain Python.
@pytest.mark.parametrize(
    ("width", "bearing", "action", "expected"),
    [
        ("sigma", 0.0, 0.0, 21.5),
        ("sigma", 0.05, 0.4, 25.29907452909103),
        ("sigma", -0.3, -0.7, 6.322125769223298),
        ("variance", 0.0, 0.0, 21.5),
        ("variance", 0.05, 0.4, 22.69864005951116),
    ],
)
def test_q_of_the_papers_labels(width: str, bearing: float, action: float, expected: float) -> None:
    network = papers_network(width=width)
    weight = torch.tensor([[10.0 * i + j for j in range(4)] for i in range(5)])
    with torch.no_grad():
        network.weight.copy_(weight)
    q = network(real(bearing).view(1, 1), action=real(action).view(1, 1))
    torch.testing.assert_close(q, real(expected).view(1, 1), rtol=1e-13, atol=0)


def test_the_gradient_by_hand() -> None:
    # The shares at Δθ = 0 are 0.457833, 0.606531, 1, …, divided by their sum 3.128728. At Δv = 0.4
    # they are exp(-6.125) = 0.002187, exp(-3.555556) = 0.028566, 1 and exp(-1.125) = 0.324652,
    # divided by their sum 1.355406.
    bearing = torch.tensor([0.146332, 0.193859, 0.319619, 0.193859, 0.146332]).double()
    action = torch.tensor([0.001614, 0.021075, 0.737787, 0.239524]).double()
    network = fill(papers_network())
    network(real(0.0).view(1, 1), action=real(0.4).view(1, 1)).sum().backward()
    expected = bearing.unsqueeze(1) * action
    torch.testing.assert_close(network.weight.grad[0], expected, rtol=0, atol=1e-6)


@given(st.floats(-1, 1), st.floats(-1, 1), st.integers(0, 2**31))
def test_the_gradient_is_the_normalised_firing_strength_whatever_the_weights(
    bearing: float, action: float, seed: int
) -> None:
    network = fill(papers_network(), seed)
    q = network(real(bearing).view(1, 1), action=real(action).view(1, 1))
    (gradient,) = torch.autograd.grad(q.sum(), [network.weight])
    strengths = normalised_firing_strengths([bearing, action], [BEARING, ACTION])
    torch.testing.assert_close(gradient.flatten(), real(*strengths), rtol=1e-9, atol=1e-14)
    torch.testing.assert_close(gradient.sum(), real(1.0).squeeze())
    torch.testing.assert_close(q.squeeze(), (gradient * network.weight).sum())


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("far", [5.0, 100.0, 1e4, 1e6])
def test_far_outside_every_centre_q_is_the_nearest_rules(far: float, dtype: torch.dtype) -> None:
    network = fill(papers_network(dtype=dtype))
    bearing = torch.tensor([far, far, -far, -far], dtype=dtype).view(4, 1)
    action = torch.tensor([far, -far, far, -far], dtype=dtype).view(4, 1)
    q = network(bearing, action=action)
    (gradient,) = torch.autograd.grad(q.sum(), [network.weight])
    corners = network.weight.detach()[0, [4, 4, 0, 0], [3, 0, 3, 0]]
    torch.testing.assert_close(q.detach().flatten(), corners)
    assert gradient.isfinite().all()
    assert network(bearing).isfinite().all()


@given(st.permutations(range(5)), st.permutations(range(4)), st.floats(-1, 1), st.floats(-1, 1))
def test_the_order_of_the_rules_does_not_matter(
    rows: list[int], columns: list[int], bearing: float, action: float
) -> None:
    network = fill(papers_network())
    other = FNNQValue(
        {"bearing": [BEARING[i] for i in rows]},
        [ACTION[j] for j in columns],
        CANDIDATES,
    )
    with torch.no_grad():
        other.weight.copy_(network.weight[:, rows][:, :, columns])
    observation, chosen = real(bearing).view(1, 1), real(action).view(1, 1)
    for actions in (None, chosen):
        expected = network(observation, action=actions)
        q = other(observation, action=actions)
        torch.testing.assert_close(q, expected, rtol=1e-12, atol=1e-14)


def test_several_inputs() -> None:
    inputs = {"bearing": BEARING, "speed": SPEED}
    candidates = real(-0.5, 0.0, 0.3)
    network = fill(FNNQValue(inputs, ACTION, candidates, runs=2))
    assert network.in_keys == ["bearing", "speed"]
    assert network.weight.shape == (2, 5, 2, 4)
    bearing, speed = real(0.2, -0.4).view(2, 1), real(0.9, 0.1).view(2, 1)
    q = network(bearing, speed)
    assert q.shape == (2, 3)
    for run in range(2):
        for i in range(3):
            point = [bearing[run].item(), speed[run].item(), candidates[i].item()]
            weights = network.weight[run].flatten().tolist()
            expected = action_value(weights, point, [BEARING, SPEED, ACTION])
            assert q[run, i].item() == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("inputs", [{"bearing": BEARING}, {"bearing": BEARING, "speed": SPEED}])
@torch.no_grad()
def test_a_batch_of_runs_equals_each_runs_own_network(inputs: dict) -> None:
    runs, steps = 3, 5
    network = fill(FNNQValue(inputs, ACTION, CANDIDATES, runs=runs))
    generator = torch.Generator().manual_seed(1)
    *observations, action = (
        torch.randn(runs, steps, 1, generator=generator, dtype=torch.float64)
        for _ in range(len(inputs) + 1)
    )
    for actions, count in ((action, 1), (None, len(CANDIDATES))):
        q = network(*observations, action=actions)
        assert q.shape == (runs, steps, count)
        for run in range(runs):
            alone = FNNQValue(inputs, ACTION, CANDIDATES)
            alone.weight.copy_(network.weight[run : run + 1])
            for t in range(steps):  # each state of the sequence alone gives the same
                its = [x[run : run + 1, t] for x in observations]
                its_action = None if actions is None else actions[run : run + 1, t]
                own = alone(*its, action=its_action)
                torch.testing.assert_close(own[0], q[run, t], rtol=1e-12, atol=1e-14)


@torch.no_grad()
def test_the_network_of_a_single_run_serves_any_batch() -> None:
    network = fill(papers_network())
    generator = torch.Generator().manual_seed(1)
    bearing = torch.randn(7, 3, 1, generator=generator, dtype=torch.float64)
    q = network(bearing)
    assert q.shape == (7, 3, 21)
    torch.testing.assert_close(q[4:5, 2], network(bearing[4:5, 2]))
    assert network(bearing, action=bearing).shape == (7, 3, 1)


@torch.no_grad()
def test_q_of_the_candidates_is_q_of_each_as_an_action() -> None:
    network = fill(papers_network(runs=2))
    bearing = real(0.1, -0.6).view(2, 1)
    each = [network(bearing, action=candidate.expand(2, 1)) for candidate in CANDIDATES]
    torch.testing.assert_close(network(bearing), torch.cat(each, dim=-1), rtol=1e-13, atol=1e-15)


def test_a_saved_network_holds_what_was_learned_and_how_it_is_read() -> None:
    network, other = fill(papers_network(runs=2)), papers_network(runs=2)
    other.load_state_dict(network.state_dict())
    bearing = real(0.1, -0.6).view(2, 1)
    assert torch.equal(other(bearing), network(bearing))


def test_the_weights_have_the_runs_last_in_memory() -> None:
    assert papers_network(runs=8).weight.movedim(0, -1).is_contiguous()


def test_the_width_has_two_readings_only() -> None:
    with pytest.raises(ValueError, match="width='stddev': must be 'sigma' or 'variance'"):
        papers_network(width="stddev")
