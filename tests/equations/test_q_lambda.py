import pytest
import torch
from torch import Tensor

from fnnq_torchrl.equations.q_lambda import (
    Rule,
    credit,
    credit_replacing,
    credit_window,
    squared_norm,
    step_h_scale,
    td_errors,
)


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_the_two_errors() -> None:
    # Runs: a greedy action; an exploratory one; the same at an end, where V(s′) counts as 0.
    td_error, chosen_td_error = td_errors(
        reward=real(1.0, 1.0, 1.0),
        terminated=torch.tensor([False, False, True]),
        value=real(3.0, 3.0, 3.0),
        chosen_value=real(3.0, 2.0, 2.0),
        next_value=real(4.0, 4.0, 4.0),
        gamma=real(0.5, 0.25, 0.25),
    )
    assert td_error.tolist() == [0.0, -1.0, -2.0]
    assert chosen_td_error.tolist() == [0.0, 0.0, -1.0]


def test_an_end_has_no_value_even_where_the_network_has_none() -> None:
    nothing = real(float("nan"))
    errors = td_errors(real(-0.5), torch.tensor([True]), real(1.0), real(1.0), nothing, real(0.9))
    assert [error.item() for error in errors] == [-1.5, -1.5]


def test_squared_norm_is_over_all_of_a_runs_weights() -> None:
    matrix = torch.stack([torch.ones(2, 3), torch.full((2, 3), 2.0)], dim=-1)
    vector = torch.tensor([[1.0, 3.0]])
    assert squared_norm([matrix, vector]).tolist() == [7.0, 33.0]
    assert squared_norm(iter([matrix, vector])).tolist() == [7.0, 33.0]


def test_the_two_readings_of_step_h() -> None:
    gradient = [real(0.5, 0.5, 1.0, 1.0).view(2, 2)]  # of two runs: (0.5, 1) and (0.5, 1)
    assert step_h_scale(gradient, "gradient") == 1
    assert torch.equal(step_h_scale(gradient, "output"), real(0.8, 0.8))
    # For a table they are the same: the gradient is 1 in one place.
    table = [real(0.0, 1.0, 0.0).view(3, 1)]
    assert torch.equal(step_h_scale(table, "output"), real(1.0))


def test_one_step_of_credit_by_hand() -> None:
    # Two weights, three runs: λ > 0; λ = 0; an end.
    trace = real(2.0, -4.0).view(2, 1).expand(2, 3)
    gradient = real(0.5, 0.25).view(2, 1).expand(2, 3)
    direction, after = credit(
        trace,
        gradient,
        past_error=real(-1.0, -1.0, -1.0),
        present_error=real(2.0, 2.0, 2.0),
        decay=real(0.5, 0.0, 0.5),
        scale=real(2.0, 2.0, 2.0),
        goes_on=real(1.0, 1.0, 0.0),
    )
    # e = (1, −2): Δw = −(1, −2) + 2·(0.5, 0.25) = (0, 2.5), then e + 2·(0.5, 0.25) = (2, −1.5).
    assert torch.equal(direction, real(0.0, 1.0, 0.0, 2.5, 0.5, 2.5).view(2, 3))
    assert torch.equal(after, real(2.0, 1.0, 0.0, -1.5, 0.5, 0.0).view(2, 3))


def test_where_nothing_can_raise_the_output_nothing_is_added() -> None:
    flat_for_the_first_run = [real(0.0, 3.0).unsqueeze(0), real(0.0, 4.0).unsqueeze(0)]
    assert torch.equal(step_h_scale(flat_for_the_first_run, "output"), real(0.0, 1 / 25))


def test_a_replacing_trace_by_hand() -> None:
    # e fades from (2, −4, 0.5) to (1, −2, 0.25), and f = (0.5, −3, 0.25).
    trace, gradient = (real(*x).view(3, 1) for x in ((2.0, -4.0, 0.5), (0.5, -3.0, 0.25)))
    errors = real(-1.0), real(2.0)
    for at_once, direction in ((False, (0.0, -4.0, 0.25)), (True, (2.0, -6.0, 0.5))):
        found, after = credit_replacing(
            trace, gradient, *errors, real(0.5), real(1.0), at_once=at_once
        )
        # −(1, −2, 0.25) + 2f, or 2·(1, −3, 0.25).
        assert found.flatten().tolist() == list(direction)
        assert after.flatten().tolist() == [1.0, -3.0, 0.25]
        _, over = credit_replacing(trace, gradient, *errors, real(0.5), real(0.0), at_once=at_once)
        assert (over == 0).all()


def test_a_window_by_hand() -> None:
    # One weight, two steps kept: 8 one step ago, 4 two steps ago; γλ = 0.5. Runs: going on; cut
    # before this step; at an end.
    gradients = real(8.0, 4.0).view(2, 1, 1).expand(2, 1, 3)
    direction, after = credit_window(
        gradients,
        real(1.0).view(1, 1).expand(1, 3),
        past_error=real(-1.0, -1.0, -1.0),
        present_error=real(2.0, 2.0, 2.0),
        decay=real(0.5, 0.5, 0.5),
        keeps=real(1.0, 0.0, 1.0),
        goes_on=real(1.0, 1.0, 0.0),
    )
    # −(0.5·8 + 0.25·4) + 2·1; the oldest is dropped.
    assert direction.flatten().tolist() == [-3.0, 2.0, -3.0]
    assert after.squeeze(1).tolist() == [[1.0, 1.0, 0.0], [8.0, 0.0, 0.0]]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"trace": "ouput"}, "trace='ouput': must be output, gradient, replacing or window"),
        ({"variant": "peg"}, "variant='peg': must be peng, watkins or naive"),
        ({"window": 0}, "window=0: must be at least 1"),
    ],
)
def test_there_is_no_other_rule(wrong: dict[str, str | int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Rule(**wrong)
