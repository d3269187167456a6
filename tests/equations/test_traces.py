import pytest
import torch
from torch import Tensor

from fnnq_torchrl.equations.traces import (
    ClearingTrace,
    Correction,
    Credit,
    DutchTrace,
    GradientTrace,
    OutputTrace,
    ReplacingTrace,
    WindowTrace,
    squared_norm,
)


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_squared_norm_is_over_all_of_a_runs_weights() -> None:
    matrix = torch.stack([torch.ones(2, 3), torch.full((2, 3), 2.0)], dim=-1)
    vector = torch.tensor([[1.0, 3.0]])
    assert squared_norm([matrix, vector]).tolist() == [7.0, 33.0]
    assert squared_norm(iter([matrix, vector])).tolist() == [7.0, 33.0]


def test_the_two_readings_of_step_h() -> None:
    gradient = [real(0.5, 0.5, 1.0, 1.0).view(2, 2)]  # two runs with the same (0.5, 1)
    assert GradientTrace().scale(gradient) == 1
    assert torch.equal(OutputTrace().scale(gradient), real(0.8, 0.8))
    # For a table the two are the same, because its gradient is 1 in one place.
    table = [real(0.0, 1.0, 0.0).view(3, 1)]
    assert torch.equal(OutputTrace().scale(table), real(1.0))


def test_where_nothing_can_raise_the_output_nothing_is_added() -> None:
    flat_for_the_first_run = [real(0.0, 3.0).unsqueeze(0), real(0.0, 4.0).unsqueeze(0)]
    assert torch.equal(OutputTrace().scale(flat_for_the_first_run), real(0.0, 1 / 25))


def test_one_step_of_credit_by_hand() -> None:
    # Two weights, four runs: λ > 0; λ = 0; an end of the episode; a trace cut before this step.
    trace = real(2.0, -4.0).view(2, 1).expand(2, 4)
    gradient = real(0.5, 0.25).view(2, 1).expand(2, 4)
    credit = Credit(
        past_error=real(-1.0, -1.0, -1.0, -1.0),
        present_error=real(2.0, 2.0, 2.0, 2.0),
        decay=real(0.5, 0.0, 0.5, 0.5),
        keeps=real(1.0, 1.0, 1.0, 0.0),
        goes_on=real(1.0, 1.0, 0.0, 1.0),
        at_once=False,
    )
    # The decayed trace is e = (1, −2). Δw = −(1, −2) + 2·(0.5, 0.25) = (0, 2.5), and the new trace
    # is e + (0.5, 0.25).
    [(direction, after)] = GradientTrace().update([trace], [gradient], credit)
    assert torch.equal(direction, real(0.0, 1.0, 0.0, 1.0, 2.5, 0.5, 2.5, 0.5).view(2, 4))
    assert torch.equal(after, real(1.5, 0.5, 0.0, 0.5, -1.75, 0.25, 0.0, 0.25).view(2, 4))
    # The reading ``output`` adds f/‖f‖², with ‖f‖² = 0.3125.
    [(direction, after)] = OutputTrace().update([trace], [gradient], credit)
    assert torch.equal(direction, real(0.0, 1.0, 0.0, 1.0, 2.5, 0.5, 2.5, 0.5).view(2, 4))
    expected = real(2.6, 1.6, 0.0, 1.6, -1.2, 0.8, 0.0, 0.8).view(2, 4)
    torch.testing.assert_close(after, expected, rtol=1e-15, atol=0)


def test_a_replacing_trace_by_hand() -> None:
    # The trace decays from (2, −4, 0.5) to (1, −2, 0.25), and f = (0.5, −3, 0.25).
    trace, gradient = (real(*x).view(3, 1) for x in ((2.0, -4.0, 0.5), (0.5, -3.0, 0.25)))
    credit = Credit(real(-1.0), real(2.0), real(0.5), None, real(1.0), at_once=False)
    for at_once, direction in ((False, (0.0, -4.0, 0.25)), (True, (2.0, -6.0, 0.5))):
        credit = credit._replace(at_once=at_once)
        [(found, after)] = ReplacingTrace().update([trace], [gradient], credit)
        # Either −(1, −2, 0.25) + 2f, or 2·(1, −3, 0.25).
        assert found.flatten().tolist() == list(direction)
        assert after.flatten().tolist() == [1.0, -3.0, 0.25]
        at_an_end = credit._replace(goes_on=real(0.0))
        [(_, over)] = ReplacingTrace().update([trace], [gradient], at_an_end)
        assert (over == 0).all()


def test_a_clearing_trace_by_hand() -> None:
    # Two states of two actions each; the trace decays from (2, 1, 4, 0) to (1, 0.5, 2, 0). The
    # second action of the first state is chosen, so its trace is 1, and the other's is 0.
    trace, gradient, of_all = (
        real(*x).view(4, 1) for x in ((2.0, 1.0, 4.0, 0.0), (0.0, 1.0, 0, 0), (1.0, 1.0, 0, 0))
    )
    credit = Credit(real(9.0), real(2.0), real(0.5), None, real(1.0), at_once=True, of_all=[of_all])
    [(direction, after)] = ClearingTrace().update([trace], [gradient], credit)
    assert after.flatten().tolist() == [0.0, 1.0, 2.0, 0.0]
    assert direction.flatten().tolist() == [0.0, 2.0, 4.0, 0.0]


def test_a_dutch_trace_by_hand() -> None:
    # α = 0.5, γλ = 0.5, e = (2, 0), f = (1, 1): e·f = 2, so z = (1, 0) + (1 − 0.5·0.5·2)f =
    # (1.5, 0.5). With δ′ = 3 and Q − Q_old = 1, Δw = 4z − f = (5, 1).
    trace, gradient = real(2.0, 0.0).view(2, 1), real(1.0, 1.0).view(2, 1)
    credit = Credit(
        past_error=real(-7.0),  # unused
        present_error=real(3.0),
        decay=real(0.5),
        keeps=None,
        goes_on=real(1.0),
        at_once=True,
        correction=Correction(alpha=real(0.5), change=real(1.0)),
    )
    [(direction, after)] = DutchTrace().update([trace], [gradient], credit)
    assert after.flatten().tolist() == [1.5, 0.5]
    assert direction.flatten().tolist() == [5.0, 1.0]
    # The overlap e·f is that of all tensors of weights together.
    halves = [x.split(1) for x in (trace, gradient)]
    both = DutchTrace().update(*map(list, halves), credit)
    assert [x.item() for _, x in both] == [1.5, 0.5]
    with pytest.raises(ValueError, match="a dutch trace needs a correction"):
        DutchTrace().update([trace], [gradient], credit._replace(correction=None))


def test_a_window_by_hand() -> None:
    # One weight and a window of two gradients: 8 one step ago, 4 two steps ago; γλ = 0.5. Runs: one
    # that goes on; one whose trace is cut before this step; one at an end of the episode.
    gradients = real(8.0, 4.0).view(2, 1, 1).expand(2, 1, 3)
    credit = Credit(
        past_error=real(-1.0, -1.0, -1.0),
        present_error=real(2.0, 2.0, 2.0),
        decay=real(0.5, 0.5, 0.5),
        keeps=real(1.0, 0.0, 1.0),
        goes_on=real(1.0, 1.0, 0.0),
        at_once=False,
    )
    present = real(1.0).view(1, 1).expand(1, 3)
    [(direction, after)] = WindowTrace(2).update([gradients], [present], credit)
    # Δw of the first run is −(0.5·8 + 0.25·4) + 2·1. The oldest gradient is dropped.
    assert direction.flatten().tolist() == [-3.0, 2.0, -3.0]
    assert after.squeeze(1).tolist() == [[1.0, 1.0, 0.0], [8.0, 0.0, 0.0]]


def test_a_trace_starts_empty() -> None:
    weights = torch.ones(3, 2)
    assert torch.equal(OutputTrace().start(weights), torch.zeros(3, 2))
    assert torch.equal(WindowTrace(4).start(weights), torch.zeros(4, 3, 2))
