from math import inf

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.equations.step_size import alpha_bound, decayed, make_step_size, obgd
from tests.programs import advance, config, in_lanes, make_learner, make_runs


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_it_decays_after_a_success_only() -> None:
    alpha = decayed(real(0.4, 0.4), real(0.99, 0.5), torch.tensor([False, True]))
    assert torch.equal(alpha, real(0.4, 0.2))


def test_obgd_by_hand() -> None:
    # Two tensors of weights, three runs: a small error beyond the bound, a large error beyond the
    # bound, and an error within the bound.
    trace = [real(1, 1, 0.25).view(1, 3), real(-3, -3, 0, 0, 0, -0.25).view(2, 3)]
    step = obgd(real(0.5, 0.5, 0.5), real(2, 2, 2), real(0.25, 3, 1.5), trace)
    # ‖z‖₁ = 4, 4, 0.5 and δ̄ = 1, 3, 1.5, so M = 0.5·2·δ̄·‖z‖₁ = 4, 12, 0.75.
    assert torch.equal(step, real(0.5 / 4, 0.5 / 12, 0.5))


def test_alpha_bound_by_hand() -> None:
    trace = [real(1, 1, 1, 1).view(1, 4), real(2, 2, 2, 2).view(1, 4)]
    slope = [real(-2, -0.2, 6, 0).view(1, 4), real(-1, -0.1, -1, 0).view(1, 4)]
    # z·(γφ′ − φ) = −4, −0.4, 4, 0: bounds of 0.25 and 2.5, and two runs that have none.
    step = alpha_bound(real(0.5, 0.5, 0.5, 0.5), trace, slope)
    torch.testing.assert_close(step, real(0.25, 0.5, 0.5, 0.5), rtol=1e-15, atol=0)


def test_another_step_size_is_refused() -> None:
    with pytest.raises(ValueError, match=r"^step_size='obg': must be decay, .* or swift$"):
        make_step_size("obg")


numbers = st.floats(-10, 10, allow_subnormal=False)
vectors = st.lists(numbers, min_size=4, max_size=4).map(lambda x: real(*x).unsqueeze(-1))


@given(st.floats(0, 10), st.floats(1.01, 5), st.floats(0, 100), vectors)
def test_obgd_bounds_the_step(alpha: float, kappa: float, error: float, z: Tensor) -> None:
    step = obgd(real(alpha), real(kappa), real(error), [z]).item()
    reach = kappa * max(error, 1) * z.abs().sum().item()
    assert step <= alpha
    assert step * reach <= 1 + 1e-12
    assert step == alpha or step * reach == pytest.approx(1)  # the step is no smaller than needed


@given(st.floats(0.001, 10), numbers, vectors, vectors, vectors, st.floats(0, 1))
def test_a_linear_step_by_alpha_bound_turns_no_error(
    alpha: float, reward: float, z: Tensor, phi: Tensor, phi_ahead: Tensor, gamma: float
) -> None:
    """After w ← w + αδz from w = 0, the TD error of the same transition keeps its sign."""
    step = alpha_bound(real(alpha), [z], [gamma * phi_ahead - phi])
    assert step.item() <= alpha
    w = step * reward * z
    after = reward + ((gamma * phi_ahead - phi) * w).sum().item()
    assert after * reward >= -1e-9 * reward**2
    if step.item() < alpha:  # a reduced step is the largest that turns no error
        assert after == pytest.approx(0, abs=1e-9 * abs(reward))


BOUNDED = ("obgd", "alpha_bound")


@pytest.mark.parametrize("step_size", BOUNDED)
@torch.no_grad()
def test_a_run_alone_is_the_run_in_a_batch(step_size: str) -> None:
    settings = config(f"step_size={step_size}", "variant=watkins", "trace=gradient")
    runs = LANES + 8
    many = make_runs(settings, runs, kappa=torch.linspace(1.1, 4, runs))
    learned = [
        advance(make_learner(settings, run), run, 60)
        for run in (in_lanes(many), in_lanes(many[9:10]))
    ]
    for key in ("alpha", ("weights", "weight"), ("trace", "weight")):
        assert torch.equal(learned[0][key][9], learned[1][key][0])


@torch.no_grad()
def test_kappa_is_obgds_and_every_runs_own() -> None:
    settings = config("step_size=obgd")
    base = make_runs(settings, 3)
    changed = make_runs(settings, 3, kappa=real(2, 4, 2))
    learner = make_learner(settings, base)
    before, after = (advance(learner, run, 40) for run in (base, changed))
    differs = (before["weights", "weight"] != after["weights", "weight"]).flatten(1).any(1)
    assert differs.tolist() == [False, True, False]
    assert torch.equal(before["alpha"], base["alpha"])  # each step starts from the same α


@torch.no_grad()
def test_alpha_bound_never_grows_and_obgd_never_exceeds_its_alpha() -> None:
    settings = config("step_size=alpha_bound", "machine.dtype=float64", "lam=0.8")
    runs = make_runs(settings, 16)
    learner = make_learner(settings, runs)
    state, last = learner.begin(runs), torch.full((16, 1), inf)
    for _ in range(60):
        state = learner.step(runs, state)
        assert (state["alpha"] <= last).all()
        last = state["alpha"]
    assert (last < runs["alpha"]).all()
    assert (last > 0).all()
