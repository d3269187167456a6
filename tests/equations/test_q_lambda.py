import pytest
import torch
from torch import Tensor

from fnnq_torchrl.equations import names
from fnnq_torchrl.equations.q_lambda import VARIANTS, Rule, td_errors
from fnnq_torchrl.equations.step_size import STEP_SIZES
from fnnq_torchrl.equations.traces import TRACES


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_the_two_errors() -> None:
    # Runs: a greedy action; an exploratory one; an exploratory one at an end, where V(s′) is 0.
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


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"trace": "ouput"}, "trace='ouput': must be output, gradient, replacing, window, "),
        ({"variant": "peg"}, "variant='peg': must be peng, watkins, naive, sarsa or exp"),
        ({"trace": "dutch"}, "trace='dutch': needs variant='sarsa', not 'peng'"),
        ({"trace": "window", "window": 0}, "window=0: must be at least 1"),
        ({"trace": "window"}, "trace='window': needs window"),
    ],
)
def test_there_is_no_other_rule(wrong: dict[str, str | int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Rule(**wrong)


def test_the_names_are_those_of_the_registries() -> None:
    assert tuple(VARIANTS) == names.VARIANTS
    assert tuple(TRACES) == names.TRACES
    assert tuple(STEP_SIZES) == names.STEP_SIZES
    assert [*names.PER_WEIGHT] == [
        name for name, rule in STEP_SIZES.items() if rule().start(real(1.0), [real(0.0)])
    ]
