import math
from collections.abc import Sequence

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.equations.membership import (
    defuzzify,
    firing_shares,
    log_membership,
    moved_labels,
)
from fnnq_torchrl.equations.membership_functions import even_labels, rule_width
from tests.oracles.fuzzy import action_value, membership, normalised_firing_strengths

LABELS = [(-0.5, 0.4), (-0.1, 0.1), (0.0, 0.05), (0.1, 0.1), (0.5, 0.4)]


def labels_of(labels: Sequence[tuple[float, float]]) -> tuple[Tensor, Tensor]:
    """Centres and inverse widths."""
    centres, widths = torch.tensor(labels, dtype=torch.float64).T
    return centres, 1 / widths


CENTRES, INVERSE_WIDTHS = labels_of(LABELS)

labels = st.lists(
    st.tuples(st.floats(-2, 2), st.floats(0.05, 2)), min_size=1, max_size=6, unique=True
)


def test_membership_is_one_at_the_centre_and_falls_off_by_the_width() -> None:
    x = torch.tensor([0.1, 0.2, 0.0, 0.3]).double()  # at 0.1, and 1, 1 and 2 widths from it
    mu = log_membership(x, CENTRES, INVERSE_WIDTHS).exp()
    assert mu.shape == (5, 4)
    expected = torch.tensor([1.0, 0.606530659712633, 0.606530659712633, 0.135335283236613]).double()
    torch.testing.assert_close(mu[3], expected)


def test_shares_at_zero_by_hand() -> None:
    # μ(0): exp(-0.78125) = 0.457833 at the far labels, exp(-0.5) = 0.606531 at the near ones, 1 in
    # the middle; together 3.128728.
    shares = firing_shares(torch.zeros(1).double(), CENTRES, INVERSE_WIDTHS).flatten()
    expected = torch.tensor([0.146332, 0.193859, 0.319619, 0.193859, 0.146332]).double()
    torch.testing.assert_close(shares, expected, rtol=0, atol=5e-7)


@given(labels, st.lists(st.floats(-3, 3), min_size=1, max_size=4))
def test_shares_are_each_labels_part_of_all_membership(
    labels: list[tuple[float, float]], xs: list[float]
) -> None:
    shares = firing_shares(torch.tensor(xs, dtype=torch.float64), *labels_of(labels))
    torch.testing.assert_close(shares.sum(0), torch.ones(len(xs), dtype=torch.float64))
    for x, column in zip(xs, shares.T, strict=True):
        mu = [membership(x, label) for label in labels]
        if sum(mu) > 1e-100:  # else it is the plain quotient that has lost its digits
            expected = torch.tensor([m / sum(mu) for m in mu], dtype=torch.float64)
            torch.testing.assert_close(column, expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("x", [3.0, 50.0, 1e3, 1e6])
def test_far_outside_it_is_the_nearest_and_widest_label(x: float, dtype: torch.dtype) -> None:
    labels = CENTRES.to(dtype), INVERSE_WIDTHS.to(dtype)
    shares = firing_shares(torch.tensor([x, -x], dtype=dtype), *labels)
    assert shares.isfinite().all()
    torch.testing.assert_close(shares.sum(0), torch.ones(2, dtype=dtype))
    assert shares.argmax(0).tolist() == [4, 0]


def test_defuzzify_with_two_inputs_is_the_plain_double_sum() -> None:
    dimensions = [LABELS, [(-1.0, 0.7), (0.0, 0.4), (2.0, 1.0)], [(-1.0, 0.4), (1.0, 0.6)]]
    generator = torch.Generator().manual_seed(0)

    def random(*shape: int) -> torch.Tensor:
        return torch.randn(shape, generator=generator, dtype=torch.float64)

    runs, steps, actions = 2, 3, 4
    consequents, x, y, a = (
        random(5, 3, 2, runs),
        random(steps, runs),
        random(steps, runs),
        random(actions, steps, runs),
    )
    parts = [
        firing_shares(value, *labels_of(labels))
        for value, labels in zip((x, y, a), dimensions, strict=True)
    ]
    q = defuzzify(consequents, parts[:2], parts[2])
    assert q.shape == (actions, steps, runs)
    for i in range(actions):
        for t in range(steps):
            for run in range(runs):
                point = [x[t, run].item(), y[t, run].item(), a[i, t, run].item()]
                weights = consequents[..., run].flatten().tolist()
                expected = action_value(weights, point, dimensions)
                assert q[i, t, run].item() == pytest.approx(expected, rel=1e-12, abs=1e-14)


def test_normalised_strengths_factor_into_shares() -> None:
    x, a = 0.03, 0.7
    action = [(-1.0, 0.4), (-0.4, 0.3), (0.4, 0.3), (1.0, 0.4)]
    shares = firing_shares(torch.tensor([x]).double(), CENTRES, INVERSE_WIDTHS)
    action_shares = firing_shares(torch.tensor([a]).double(), *labels_of(action))
    expected = torch.tensor(normalised_firing_strengths([x, a], [LABELS, action])).double()
    product = (shares * action_shares.T).flatten()
    torch.testing.assert_close(product, expected, rtol=1e-6, atol=1e-9)


@given(
    st.lists(st.floats(-2, 2), min_size=1, max_size=5, unique=True),
    st.lists(st.floats(-3, 3), min_size=10, max_size=10),
    st.floats(0.01, 1),
)
def test_moved_labels_keep_their_order_and_a_least_width(
    places: list[float], moves: list[float], least: float
) -> None:
    labels, *_ = start = labels_of([(place, 0.3) for place in sorted(places)])
    count = len(labels)
    middle, widths, gaps = torch.tensor(moves).double().unsqueeze(-1).split([1, 5, 4])
    centres, inverse_widths = moved_labels(
        *start,
        middle=middle,
        widths=widths[:count],
        gaps=gaps[: count - 1] if count > 1 else None,
        least_width=least,
    )
    assert centres.shape == inverse_widths.shape == (count, 1)
    assert (centres.diff(dim=0) >= 0).all()
    assert (1 / inverse_widths >= 0.3 * least * (1 - 1e-9)).all()
    torch.testing.assert_close(centres.mean(), labels.mean() + 0.3 * middle.squeeze())


def test_labels_that_do_not_move_are_where_they_were() -> None:
    zeros = torch.zeros(5, 2).double()
    moves = {"middle": zeros[:1], "widths": zeros, "gaps": zeros[:4]}
    moved = moved_labels(CENTRES, INVERSE_WIDTHS, least_width=0.1, **moves)
    for now, before in zip(moved, (CENTRES, INVERSE_WIDTHS), strict=True):
        torch.testing.assert_close(now, before.unsqueeze(-1).expand(5, 2))


def test_even_labels_are_half_of_one_halfway_to_their_neighbours() -> None:
    labels = even_labels(-1, 2, 4)
    assert [numbers[0] for _, numbers in labels] == pytest.approx([-1, 0, 1, 2])
    assert membership(0.5, labels[1][1]) == membership(0.5, labels[2][1]) == pytest.approx(0.5)
    assert even_labels(-1, 2, 1) == [("gaussian", (0.5, 1.5))]


def test_a_variance_is_the_square_of_the_width() -> None:
    assert rule_width(0.09, "sigma") == 0.09
    assert rule_width(0.09, "variance") == pytest.approx(0.3)
    assert rule_width(0.05, "variance") == math.sqrt(0.05)
