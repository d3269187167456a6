"""The compiled engine against the eager one, and against itself."""

from pathlib import Path

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch._dynamo.utils import counters
from torch._inductor import config as inductor

from fnnq_torchrl.autograd import gradient
from fnnq_torchrl.compiled import CompiledLoop, _leaves, _trace
from fnnq_torchrl.config import Config, ConfigError
from fnnq_torchrl.learning import Learning
from fnnq_torchrl.loops import Step, eager_loop
from fnnq_torchrl.program import Program
from fnnq_torchrl.snapshots import SnapshotBook
from fnnq_torchrl.work import work_through

from .programs import config, in_lanes, make_program, make_runs

LANES = 32

# -- a tiny step ----------------------------------------------------------------------------------


def tiny_step(rate: float = 0.01, offset: float = 0.5) -> Step:
    """Downhill, in both precisions: its rate is a number in the graph, its offset a tensor."""
    offsets = torch.tensor([0.0, offset, -offset])

    def downhill(w: Tensor, x: Tensor) -> tuple[Tensor, Tensor]:
        def height(weights: dict[str, Tensor]) -> tuple[Tensor, Tensor]:
            sums = (weights["w"].cumsum(-1) + offsets.to(w.dtype)) * x
            return sums.square().sum(), sums.detach().amax(-1, keepdim=True)

        slope, highest = gradient(height, {"w": w})
        return w - rate * slope["w"], highest

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        single, _ = downhill(state["single"], stays["x"])
        double, highest = downhill(state["deep", "double"], stays["x"].double())
        deep = {"double": double, "rose": highest > state["highest"]}
        return TensorDict(
            {"single": single, "deep": deep, "highest": highest, "n": state["n"] + 1},
            state.batch_size,
        )

    return step


@pytest.fixture(scope="module")
def tiny() -> tuple[TensorDict, TensorDict]:
    """What stays, and a state."""
    generator = torch.Generator().manual_seed(0)
    w = torch.randn(LANES, 3, generator=generator)
    state = {
        "single": w,
        "deep": {"double": w.double(), "rose": torch.zeros(LANES, 1, dtype=torch.bool)},
        "highest": torch.zeros(LANES, 1, dtype=torch.float64),
        "n": torch.zeros(LANES, 1, dtype=torch.int64),
    }
    x = torch.randn(LANES, 3, generator=generator)
    return TensorDict({"x": x}, [LANES]), TensorDict(state, [LANES])


@pytest.fixture(scope="module")
def tiny_loop(compiler: None, tiny: tuple[TensorDict, TensorDict]) -> CompiledLoop:
    return CompiledLoop(tiny_step(), *tiny)


def different(state: TensorDictBase, other: TensorDictBase) -> list[str]:
    """The entries that aren't the same bits."""
    leaves, others = (td.flatten_keys("/").to_dict() for td in (state, other))
    assert leaves.keys() == others.keys()
    return [key for key in leaves if not torch.equal(leaves[key], others[key])]


def assert_close(state: TensorDictBase, other: TensorDictBase) -> None:
    """The same whole numbers and booleans; the same to rounding, each in its own precision."""
    leaves, others = (td.flatten_keys("/").to_dict() for td in (state, other))
    assert leaves.keys() == others.keys()
    for key, leaf in leaves.items():
        torch.testing.assert_close(leaf, others[key], msg=lambda text, key=key: f"{key}: {text}")


def test_a_graph_has_the_steps_arithmetic(tiny: tuple[TensorDict, TensorDict]) -> None:
    stays, state = tiny
    graph = _trace(tiny_step(), stays, state)
    for _ in range(3):
        leaves = _leaves(state)
        traced = graph(*_leaves(stays).values(), *leaves.values())
        state = tiny_step()(stays, state)
        for (key, leaf), value in zip(_leaves(state).items(), traced, strict=True):
            torch.testing.assert_close(value, leaf, msg=key)


def branch(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    after = state.clone()
    return after if state["n"].sum() > 3 else after.apply_(torch.neg)


def count(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    after = state.clone()
    for _ in range(int(state["n"].amax())):
        after["n"] += 1
    return after


def look_for(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    after = state.clone()
    for lane in (stays["x"][:, 0] > 0).nonzero().flatten().tolist():
        after["n"][lane] += 1
    return after


@pytest.mark.parametrize("step", [branch, count, look_for], ids=lambda step: step.__name__)
def test_a_step_whose_python_looks_at_data_is_refused(
    tiny: tuple[TensorDict, TensorDict], step: Step
) -> None:
    # Traced once, it would do for ever what it did for the first state.
    with pytest.raises(RuntimeError, match=r"(?i)data.dependent|dynamic output shape"):
        CompiledLoop(step, *tiny)


@pytest.mark.parametrize("steps", [1, 2, 25])
def test_a_compiled_loop_is_so_many_steps(
    tiny_loop: CompiledLoop, tiny: tuple[TensorDict, TensorDict], steps: int
) -> None:
    after = tiny_loop(*tiny, steps)
    assert_close(after, eager_loop(tiny_step(), *tiny)(*tiny, steps))
    assert (after["n"] == steps).all()
    assert after.batch_size == tiny[1].batch_size


def test_no_steps_are_the_identity_and_a_state_goes_on_where_it_was(
    tiny_loop: CompiledLoop, tiny: tuple[TensorDict, TensorDict]
) -> None:
    stays, state = tiny
    kept = state.clone()
    assert not different(tiny_loop(stays, state, 0), state)
    on_and_on = tiny_loop(stays, tiny_loop(stays, state, 7), 9)
    assert not different(on_and_on, tiny_loop(stays, state, 16))
    assert not different(state, kept)


def test_what_stays_is_read_anew_each_time(
    tiny_loop: CompiledLoop, tiny: tuple[TensorDict, TensorDict]
) -> None:
    stays, state = tiny
    other = stays * 2
    assert_close(tiny_loop(other, state, 5), eager_loop(tiny_step(), other, state)(other, state, 5))


def cache_hits() -> tuple[int, int]:
    return tuple(counters["inductor"][f"fxgraph_cache_{what}"] for what in ("hit", "miss"))


def test_a_program_that_differs_in_one_number_only_is_another(
    tiny_loop: CompiledLoop, tiny: tuple[TensorDict, TensorDict]
) -> None:
    for step in (tiny_step(rate=0.02), tiny_step(offset=0.25)):
        after = CompiledLoop(step, *tiny)(*tiny, 5)
        assert_close(after, eager_loop(step, *tiny)(*tiny, 5))
        assert "single" in different(after, tiny_loop(*tiny, 5))


def test_a_compiler_that_fails_is_told_in_one_line(
    compiler: None, tiny: tuple[TensorDict, TensorDict], tmp_path: Path
) -> None:
    broken = tmp_path / "g++"
    broken.write_text("#!/bin/sh\necho this machine has no headers >&2\nexit 1\n")
    broken.chmod(0o755)
    with (
        inductor.patch({"cpp.cxx": (str(broken),)}),
        pytest.raises(ConfigError, match=r"^engine=compiled: .*engine=eager") as refused,
    ):
        CompiledLoop(tiny_step(rate=0.03), *tiny)
    assert len(str(refused.value).splitlines()) == 1


# -- the learning program -------------------------------------------------------------------------

RUNS, STEPS = 40, 50
LONGER = 300  # so that a difference in a last bit shows
Compiled = tuple[TensorDict, Program, CompiledLoop]


def compile_learning(settings: Config, run: TensorDict) -> Compiled:
    program = make_program(settings, run)
    with torch.no_grad():
        return run, program, CompiledLoop(program.step, run, program.begin(run))


@torch.no_grad()
def learn(compiled: Compiled, steps: int) -> TensorDict:
    run, program, loop = compiled
    return loop(run, program.begin(run), steps)


@torch.no_grad()
def learn_eagerly(compiled: Compiled, steps: int) -> TensorDict:
    run, program, _ = compiled
    state = program.begin(run)
    return eager_loop(program.step, run, state)(run, state, steps)


@pytest.fixture(scope="module")
def batch(compiler: None) -> Compiled:
    run = make_runs(config(), RUNS, lam=torch.linspace(0, 1, RUNS))
    return compile_learning(config(), in_lanes(run))


def test_it_learns_what_the_eager_engine_learns(batch: Compiled) -> None:
    state, expected = learn(batch, STEPS), learn_eagerly(batch, STEPS)
    assert state["situations"].min() >= 3  # ends and catches were among the steps
    for key in ("situations", "steps", "alpha", "snapshot"):
        assert_close(state.select(key), expected.select(key))
    weights = state["weights", "weight"]
    torch.testing.assert_close(weights, expected["weights", "weight"], rtol=1e-4, atol=1e-5)
    assert weights.abs().max() > 0.1


def test_a_run_alone_is_the_run_in_the_batch(batch: Compiled) -> None:
    run, _, _ = batch
    alone = compile_learning(config(), in_lanes(run[13:14]))
    assert len(alone[0]) < len(run)
    assert not different(learn(alone, LONGER)[:1], learn(batch, LONGER)[13:14])


def test_the_same_program_is_compiled_once(batch: Compiled) -> None:
    hits, misses = cache_hits()
    again = compile_learning(config(), batch[0])
    assert cache_hits() == (hits + 1, misses)
    assert not different(learn(again, STEPS), learn(batch, STEPS))


def test_a_program_of_another_world_is_another(batch: Compiled) -> None:
    hits, misses = cache_hits()
    other = compile_learning(config("env.catch_distance_m=0.3"), batch[0])
    assert cache_hits() == (hits, misses + 1)
    state, expected = learn(other, STEPS), learn_eagerly(other, STEPS)
    assert torch.equal(state["situations"], expected["situations"])
    assert not torch.equal(state["situations"], learn(batch, STEPS)["situations"])


def test_neither_lanes_nor_workers_matter_to_runs_that_take_turns(batch: Compiled) -> None:
    _, program, loop = batch
    runs, every, evaluations = 150, config().evaluation.every, 3
    run = make_runs(config(), runs)

    def learned(workers: int, order: Tensor) -> TensorDict:
        blank = dict(program.loss.value_network.named_parameters())
        with torch.no_grad():
            book = SnapshotBook(blank, runs, every, evaluations)
            last = every * (evaluations - 1)
            task = Learning(program, loop, run[order], last, book, lambda done: None)
            work_through(task, runs, len(batch[0]), workers)
        return book.pages[:, order.argsort()]

    in_order, shuffled = torch.arange(runs), torch.randperm(runs, generator=torch.Generator())
    pages = learned(1, in_order)
    assert (pages["steps"][-1] > 0).all()
    assert not different(learned(2, in_order), pages)
    assert not different(learned(2, shuffled), pages)


# -- many loops, last, since others may not come after a failure ----------------------------------


def test_any_number_of_loops_are_made_in_one_process(
    tiny_loop: CompiledLoop, tiny: tuple[TensorDict, TensorDict]
) -> None:
    # A sweep makes two a job; torch.compile gives up on a function that it has compiled 8 times.
    expected = tiny_loop(*tiny, 5)
    for _ in range(9):
        assert not different(CompiledLoop(tiny_step(), *tiny)(*tiny, 5), expected)
