"""Rows of weights that a step leaves as they are aren't computed, and no bit of them changes."""

from collections.abc import Callable

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import EagerLoop, Step
from fnnq_torchrl.engine.native import NativeLoop
from fnnq_torchrl.engine.native.translation import source

pytestmark = pytest.mark.usefixtures("compiler")

CELLS, STEPS = 30, 80
Trace = Callable[[Tensor, Tensor, TensorDict], tuple[Tensor, Tensor]]
"""A function of γλe, f and the step's numbers that returns z and the direction of the weights."""


def replacing(faded: Tensor, f: Tensor, now: TensorDict) -> tuple[Tensor, Tensor]:
    z = torch.where(f.abs() >= faded.abs(), f, faded)
    return z, now["error"] * z


def accumulating(faded: Tensor, f: Tensor, now: TensorDict) -> tuple[Tensor, Tensor]:
    return faded + f, now["error"] * faded + now["error"] * f


def of_another_sign(faded: Tensor, f: Tensor, now: TensorDict) -> tuple[Tensor, Tensor]:
    return -1.0 * (faded + f), now["error"] * faded


def clearing(faded: Tensor, f: Tensor, now: TensorDict) -> tuple[Tensor, Tensor]:
    z = torch.where(f.flip(-1) != 0, f, faded)
    return z, z * now["error"]


def with_a_constant(faded: Tensor, f: Tensor, now: TensorDict) -> tuple[Tensor, Tensor]:
    return faded + f, now["error"] * f + 1e-3  # changes every row


TRACES: dict[str, Trace] = {
    f.__name__: f for f in (replacing, accumulating, of_another_sign, clearing, with_a_constant)
}


def make_step(trace: Trace, *, mirrored: bool = False) -> Step:
    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        now = TensorDict(
            {key: stays[key].gather(1, state["t"]).unsqueeze(-1) for key in stays.keys()},  # noqa: SIM118
            state.batch_size,
        )
        w, e = state["w"], state["e"]
        at = now["cell"].long().expand(-1, 1, 2)
        f = torch.zeros_like(w).scatter(1, at, 1.0)
        if mirrored:
            f = f + torch.zeros_like(w).scatter(1, CELLS - 1 - at, 1.0)
        z, direction = trace(now["decay"] * e, f, now)
        return TensorDict(
            {"w": w + 0.1 * direction, "e": now["goes_on"] * z, "t": state["t"] + 1},
            state.batch_size,
        )

    return step


def lanes(factor: float = 1.0) -> tuple[TensorDict, TensorDict]:
    """Return random walks with rare and short episodes, and weights of which some are −0."""
    generator = torch.Generator().manual_seed(5)

    def uniform() -> Tensor:
        return torch.rand(LANES, STEPS, generator=generator)

    stays = TensorDict(
        {
            "cell": (uniform() * CELLS / 2).floor(),
            "error": (uniform() - 0.5) * factor,
            "decay": uniform().mul(1.2).clamp(max=0.9),
            "goes_on": (uniform() > 0.1).float(),
        },
        [LANES],
    )
    w = torch.zeros(LANES, CELLS, 2)
    w[::3] = -0.0
    w[::5, ::2] = torch.randn(w[::5, ::2].shape, generator=generator)
    state = {"w": w, "e": torch.zeros_like(w), "t": torch.zeros(LANES, 1, dtype=torch.int64)}
    return stays, TensorDict(state, [LANES])


def bits(state: TensorDictBase) -> TensorDictBase:
    return state.apply(lambda x: x.clone().view(torch.int32) if x.is_floating_point() else x)


def assert_same_bits(step: Step, stays: TensorDict, state: TensorDict) -> TensorDictBase:
    made = [loop(lambda _: step, stays, state)(stays, state) for loop in (EagerLoop, NativeLoop)]
    for running in made:
        for _ in range(2):  # the second call begins with traces
            running.advance(STEPS // 2)
    eager, native = (bits(running.state) for running in made)
    same = eager == native
    assert same.all()
    return made[1].state


@pytest.mark.parametrize("name", TRACES)
def test_no_bit_changes(name: str) -> None:
    assert_same_bits(make_step(TRACES[name]), *lanes())


def test_a_step_may_visit_several_rows() -> None:
    step, (stays, state) = make_step(replacing, mirrored=True), lanes()
    assert "rows_0" in source(step, stays[:2], state[:2])
    assert_same_bits(step, stays, state)


@pytest.mark.parametrize("name", ["replacing", "accumulating"])
def test_a_factor_that_is_not_finite_reaches_every_row(name: str) -> None:
    stays, state = lanes()
    stays["error"][4, 50] = torch.inf  # 0 · inf is NaN
    after = assert_same_bits(make_step(TRACES[name]), stays, state)
    assert after["w"][4].isnan().sum() > CELLS
    assert after["w"][5].isfinite().all()


def test_a_negative_factor_makes_zeros_negative() -> None:
    stays, state = lanes()
    stays["goes_on"][7, -1] = -1.0
    after = assert_same_bits(make_step(replacing), stays, state)
    assert torch.signbit(after["e"][7][after["e"][7] == 0]).any()


@pytest.mark.parametrize(
    ("name", "expected"),
    [(name, name in ("replacing", "accumulating", "clearing")) for name in TRACES],
)
def test_rows_are_left_out_if_they_stay_as_they_are(name: str, expected: bool) -> None:
    stays, state = lanes()
    assert ("rows_0" in source(make_step(TRACES[name]), stays[:2], state[:2])) == expected


def test_a_run_alone_is_the_run_in_a_batch() -> None:
    stays, state = lanes()
    step = make_step(replacing)
    loop = NativeLoop(lambda _: step, stays, state)
    together = loop(stays, state)
    alone = loop(*(half[6:7].expand(LANES).clone() for half in (stays, state)))
    for running in (together, alone):
        running.advance(STEPS)
    one, same = bits(together.state[6]), bits(alone.state[0])
    assert torch.equal(one["w"], same["w"])
    assert torch.equal(one["e"], same["e"])


def test_a_choice_in_two_loops_is_made_with_the_number_before_the_step() -> None:
    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        w, a, n = state["w"], state["a"], state["n"]
        f = torch.where(torch.arange(CELLS) == n, a, 0.0)
        total = (f * w).sum(-1, keepdim=True)  # a loop of its own, before that of w
        return TensorDict({"w": w + f * total, "a": a * 0.5 + 1, "n": n + 1}, state.batch_size)

    w = torch.linspace(-1, 1, LANES * CELLS).view(LANES, CELLS)
    state = {"w": w, "a": torch.ones(LANES, 1), "n": torch.zeros(LANES, 1, dtype=torch.int64)}
    assert_same_bits(step, TensorDict({}, [LANES]), TensorDict(state, [LANES]))
