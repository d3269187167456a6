"""Compiled loops equal the eager loop, and each other."""

from collections.abc import Callable

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.gradient import gradient
from fnnq_torchrl.agent.learning_step import Learner
from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.config.schema import PER_RUN, Config, ConfigError
from fnnq_torchrl.engine import choice as engine
from fnnq_torchrl.engine.graphs import leaves, trace
from fnnq_torchrl.engine.inductor import InductorLoop
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import EagerLoop, Loop, MakeLoop, Running, Step
from fnnq_torchrl.engine.native import NativeLoop, RunsMixed, Unsupported
from fnnq_torchrl.engine.native.translation import source
from fnnq_torchrl.engine.scheduler import work_through
from fnnq_torchrl.equations.names import PER_WEIGHT
from fnnq_torchrl.training.learning import Learning
from fnnq_torchrl.training.resume.ledger import Ledger
from tests.programs import config, in_lanes, make_learner, make_runs

pytestmark = pytest.mark.usefixtures("compiler")
INDUCTOR = pytest.param(InductorLoop, marks=pytest.mark.long)
KINDS = [NativeLoop, INDUCTOR]

# -- a tiny step ----------------------------------------------------------------------------------


def tiny_step(rate: float = 0.01, offset: float = 0.5) -> Callable[[int], Step]:
    """Return a step of gradient descent, for weights in single and in double precision.

    In the traced graph the rate becomes a number and the offset a tensor.
    """
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
            {
                "single": single,
                "deep": deep,
                "highest": highest,
                "n": state["n"] + 1,
                "before": state["n"].clone(),
                "long_before": state["before"].clone(),
            },
            state.batch_size,
        )

    return lambda lanes: step


@pytest.fixture(scope="module")
def tiny() -> tuple[TensorDict, TensorDict]:
    """Return ``stays``, the entries that no step changes, and a first state."""
    generator = torch.Generator().manual_seed(0)
    w = torch.randn(LANES, 3, generator=generator)
    zero = torch.zeros(LANES, 1, dtype=torch.int64)
    state = {
        "single": w,
        "deep": {"double": w.double(), "rose": zero.bool()},
        "highest": zero.double(),
        "n": zero.clone(),
        "before": zero - 1,
        "long_before": zero - 2,
    }
    x = torch.randn(LANES, 3, generator=generator)
    return TensorDict({"x": x}, [LANES]), TensorDict(state, [LANES])


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: kind.__name__)
def tiny_loop(request, compiler: None, tiny: tuple[TensorDict, TensorDict]) -> Loop:
    return request.param(tiny_step(), *tiny)


def run(loop: Loop, stays: TensorDictBase, state: TensorDictBase, steps: int) -> TensorDictBase:
    """Return the state after the given number of further steps."""
    running = loop(stays, state)
    running.advance(steps)
    return running.state


def different(state: TensorDictBase, other: TensorDictBase) -> list[str]:
    """Return the names of the entries whose bits differ."""
    some, others = (td.flatten_keys("/").to_dict() for td in (state, other))
    assert some.keys() == others.keys()
    return [key for key in some if not torch.equal(some[key], others[key])]


def assert_close(state: TensorDictBase, other: TensorDictBase) -> None:
    """Check that whole numbers and booleans are equal, and real numbers equal to rounding."""
    some, others = (td.flatten_keys("/").to_dict() for td in (state, other))
    assert some.keys() == others.keys()
    for key, leaf in some.items():
        torch.testing.assert_close(leaf, others[key], msg=lambda text, key=key: f"{key}: {text}")


def test_a_graph_has_the_steps_arithmetic(tiny: tuple[TensorDict, TensorDict]) -> None:
    stays, state = tiny
    step = tiny_step()(LANES)
    graph = trace(step, stays, state)
    for _ in range(3):
        traced = graph(*leaves(stays).values(), *leaves(state).values())
        state = step(stays, state)
        for (key, leaf), value in zip(leaves(state).items(), traced, strict=True):
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


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("step", [branch, count, look_for], ids=lambda step: step.__name__)
def test_a_step_whose_python_looks_at_data_is_refused(
    tiny: tuple[TensorDict, TensorDict], step: Step, kind: MakeLoop
) -> None:
    # A trace would repeat the branch that was taken for the first state.
    with pytest.raises(RuntimeError, match=r"(?i)data.dependent|dynamic output shape"):
        kind(lambda lanes: step, *tiny)


@pytest.mark.parametrize("steps", [1, 2, 25])
def test_a_loop_is_so_many_steps(
    tiny_loop: Loop, tiny: tuple[TensorDict, TensorDict], steps: int
) -> None:
    after = run(tiny_loop, *tiny, steps)
    assert_close(after, run(EagerLoop(tiny_step(), *tiny), *tiny, steps))
    assert (after["n"] == steps).all()
    assert (after["long_before"] == steps - 2).all()
    assert after.batch_size == tiny[1].batch_size


def test_no_steps_are_the_identity_and_a_state_goes_on_where_it_was(
    tiny_loop: Loop, tiny: tuple[TensorDict, TensorDict]
) -> None:
    stays, state = tiny
    kept = state.clone()
    running = tiny_loop(stays, state)
    running.advance(0)
    assert not different(running.state, state)
    running.advance(7)
    running.advance(9)
    assert not different(running.state, run(tiny_loop, stays, state, 16))
    assert not different(state, kept)


def test_what_runs_is_read_and_written_in_place(
    tiny_loop: Loop, tiny: tuple[TensorDict, TensorDict]
) -> None:
    stays, state = tiny
    running = tiny_loop(stays, state)
    running.advance(3)
    running.stays[5:7], running.state[5:7] = 2 * stays[5:7], state[5:7]
    running.advance(4)
    others = [lane for lane in range(LANES) if lane not in (5, 6)]
    assert not different(running.state[others], run(tiny_loop, stays, state, 7)[others])
    assert not different(running.state[5:7], run(tiny_loop, 2 * stays, state, 4)[5:7])


@pytest.mark.parametrize("kind", KINDS)
def test_a_program_that_differs_in_one_number_only_is_another(
    tiny: tuple[TensorDict, TensorDict], kind: MakeLoop
) -> None:
    states = []
    for step in (tiny_step(), tiny_step(rate=0.02), tiny_step(offset=0.25)):
        states.append(run(kind(step, *tiny), *tiny, 5))
        assert_close(states[-1], run(EagerLoop(step, *tiny), *tiny, 5))
    assert "single" in different(states[0], states[1])
    assert "single" in different(states[0], states[2])


@pytest.mark.parametrize("kind", KINDS)
def test_a_compiler_that_fails_is_told_in_one_line(
    tiny: tuple[TensorDict, TensorDict], kind: MakeLoop, monkeypatch, tmp_path
) -> None:
    broken = tmp_path / "my-g++"
    broken.write_text("#!/bin/sh\necho this machine has no headers >&2\nexit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CXX", str(broken))
    with (
        torch._inductor.config.patch({"cpp.cxx": (str(broken),)}),
        pytest.raises(ConfigError, match=r"^engine=compiled: .*engine=eager") as refused,
    ):
        kind(tiny_step(rate=0.03), *tiny)
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.long
def test_what_cannot_be_written_out_goes_to_inductor(
    tiny: tuple[TensorDict, TensorDict], monkeypatch: pytest.MonkeyPatch
) -> None:
    def sort(stays: TensorDictBase, state: TensorDictBase) -> TensorDictBase:
        return state.clone().set("single", state["single"].sort(-1).values)

    with pytest.raises(Unsupported, match=r"aten\.sort"):
        NativeLoop(lambda lanes: sort, *tiny)
    loop = engine.make_engine("compiled", torch.device("cpu")).make_loop(lambda lanes: sort, *tiny)
    assert isinstance(loop, InductorLoop)
    assert_close(run(loop, *tiny, 1), sort(*tiny))


MIXED: dict[str, tuple[Callable[[Tensor], Tensor], str]] = {
    "mean of the runs": (lambda x: x - x.mean(0), "depends on other runs"),
    "largest of the runs": (lambda x: x.amax(0).expand_as(x), "depends on other runs"),
    "neighbour": (lambda x: x.flip(0), "depends on other runs"),
    "number of its own": (
        lambda x: x + torch.arange(len(x)).unsqueeze(-1),
        "isn't the same for every run",
    ),
}


@pytest.mark.parametrize("name", MIXED)
def test_a_step_that_mixes_runs_is_refused(tiny: tuple[TensorDict, TensorDict], name: str) -> None:
    function, why = MIXED[name]

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDictBase:
        return state.clone().set("single", function(state["single"]))

    with pytest.raises(RunsMixed, match=f"^single: .*{why}"):
        NativeLoop(lambda lanes: step, *tiny)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (lambda state: state.set("single", state["single"].double()), "single: .*float64"),
        (lambda state: state.set("n", state["n"].expand(-1, 2).clone()), r"n: .*\[2, "),
        (lambda state: state.exclude("n"), "same entries"),
        (lambda state: state.set("new", state["n"].clone()), "same entries"),
    ],
    ids=["dtype", "shape", "fewer", "more"],
)
def test_a_step_to_another_kind_of_state_is_refused(
    tiny: tuple[TensorDict, TensorDict], change: Callable[[TensorDict], TensorDict], what: str
) -> None:
    with pytest.raises(ValueError, match=what):
        NativeLoop(lambda lanes: lambda stays, state: change(state.clone()), *tiny)


def test_a_program_is_given_what_it_is_for(tiny: tuple[TensorDict, TensorDict]) -> None:
    stays, state = tiny
    loop = NativeLoop(tiny_step(), stays, state)
    with pytest.raises(ValueError, match="multiple of 32"):
        loop(stays[:3], state[:3])
    with pytest.raises(ValueError, match="a program for"):
        loop(stays, state.double())
    with pytest.raises(RuntimeError, match="locked"):  # the program would keep the old tensor
        loop(stays, state).state["n"] = state["n"]


def exchange(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    """Large entries that take each other's numbers, or their own from other places."""
    here, there, square = (state[key] for key in ("here", "there", "square"))
    new = here + 1
    return TensorDict(
        {
            "here": there.clone(),
            "there": new,
            "kept": torch.where((state["n"] & 1) == 0, new, state["kept"]),
            "kept too": torch.where((state["n"] & 1) == 0, state["kept"], state["kept too"]),
            "turned": torch.cat([state["turned"][:, 1:], here[:, :1]], -1),
            "square": square.transpose(1, 2) - here.unsqueeze(1),
            "picked": there.gather(1, state["n"] & 15) + square.sum((1, 2)).unsqueeze(-1),
            "n": state["n"] + 1,
        },
        state.batch_size,
    )


def test_large_entries_are_read_before_they_are_written() -> None:
    generator = torch.Generator().manual_seed(1)
    names = ("here", "there", "kept", "kept too", "turned")
    large = {name: torch.randn(LANES, 30, generator=generator).double() for name in names}
    square = torch.randn(LANES, 30, 30, generator=generator).double()
    n = torch.arange(LANES).unsqueeze(-1)
    others = {"square": square, "picked": n.double(), "n": n}
    args = TensorDict({}, [LANES]), TensorDict(large | others, [LANES])
    native, eager = (kind(lambda lanes: exchange, *args) for kind in (NativeLoop, EagerLoop))
    for steps in (1, 2, 3, 10):
        assert_close(run(native, *args, steps), run(eager, *args, steps))


def test_a_program_does_not_grow_with_the_weights() -> None:
    def lines(units: int) -> int:
        widths = f"value.widths=[{units}, {units}]"
        settings = config("value=mlp", widths, "action.candidates=3")
        stays = make_runs(settings, 2)
        learner = make_learner(settings, stays)
        with torch.no_grad():
            return source(learner.step, stays, learner.begin(stays)).count("\n")

    assert lines(72) == lines(96)


# -- lanes that are over --------------------------------------------------------------------------


def countdown(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    n = state["n"] - 1
    return TensorDict({"n": n, "over": n <= stays["until"]}, state.batch_size)


@pytest.mark.parametrize("kind", [NativeLoop, EagerLoop])
def test_steps_end_where_all_are_over_and_nobody_is_cut_short(kind: MakeLoop) -> None:
    lanes = 2 * LANES
    until = torch.arange(lanes).unsqueeze(-1) % 7 - 20
    until[LANES:] -= 500
    zero = torch.zeros_like(until)
    stays = TensorDict({"until": until}, [lanes])
    state = TensorDict({"n": zero, "over": zero.bool()}, [lanes])
    loop = kind(lambda lanes: countdown, stays, state)
    assert (run(loop, stays, state, 3)["n"] == -3).all()
    after = run(loop, stays, state, 1000)
    assert after["over"].all()
    assert (after["n"] <= until).all()
    assert (after["n"] >= -530).all()
    if kind is NativeLoop:  # each vector of lanes ends by itself
        assert (after["n"][:LANES] >= -30).all()


@pytest.mark.long
@torch._dynamo.config.patch(recompile_limit=2)
def test_any_number_of_loops_are_made_in_one_process() -> None:
    # torch.compile gives up on a function after that number of compilations, by default eight.
    zero = torch.zeros(LANES, 1, dtype=torch.int64)
    args = TensorDict({"until": zero}, [LANES]), TensorDict({"n": zero, "over": zero > 0}, [LANES])
    for _ in range(3):
        assert (run(InductorLoop(lambda lanes: countdown, *args), *args, 5)["n"] == -5).all()


# -- subnormals ----------------------------------------------------------------------------------


def halve(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
    return TensorDict({key: x / 2 for key, x in state.items()}, state.batch_size)


@pytest.mark.parametrize("kind", [NativeLoop, EagerLoop, INDUCTOR])
def test_subnormals_are_zero_in_a_loop_and_what_they_were_outside(kind: MakeLoop) -> None:
    one = torch.ones(LANES, 1)
    state = TensorDict({"single": one, "double": one.double()}, [LANES])
    stays = TensorDict({}, [LANES])
    loop = kind(lambda lanes: halve, stays, state)
    smallest, none = run(loop, stays, state, 126), run(loop, stays, state, 127)
    assert (smallest["single"] == 2.0**-126).all()
    assert (none["single"] == 0).all()
    assert (none["double"] == 2.0**-127).all()
    assert (run(loop, stays, state, 1023)["double"] == 0).all()
    assert (one * 2.0**-126 / 2 > 0).all()  # here they are numbers, as everywhere else


# -- the learner -----------------------------------------------------------------------------------

RUNS, STEPS = 40, 50
LONGER = 300  # steps after which a difference in a last bit shows
Compiled = tuple[TensorDict, Learner, Loop]


def compile_learning(settings: Config, run: TensorDict, kind: MakeLoop = NativeLoop) -> Compiled:
    learner = make_learner(settings, run)
    with torch.no_grad():
        loop = kind(lambda lanes: make_learner(settings, run[:lanes]).step, run, learner.begin(run))
    return run, learner, loop


@torch.no_grad()
def learn(compiled: Compiled, steps: int) -> TensorDictBase:
    stays, learner, loop = compiled
    return run(loop, stays, learner.begin(stays), steps)


@torch.no_grad()
def learn_eagerly(compiled: Compiled, steps: int) -> TensorDictBase:
    stays, learner, _ = compiled
    state = learner.begin(stays)
    return run(EagerLoop(lambda lanes: learner.step, stays, state), stays, state, steps)


@pytest.fixture(scope="module")
def batch(compiler: None) -> Compiled:
    stays = make_runs(config(), RUNS, lam=torch.linspace(0, 1, RUNS))
    return compile_learning(config(), in_lanes(stays))


def assert_learned_alike(compiled: Compiled, rtol: float, atol: float) -> None:
    state, expected = learn(compiled, STEPS), learn_eagerly(compiled, STEPS)
    assert state["situations"].min() >= 3  # ends and catches were among the steps
    for key in ("situations", "steps", "over"):
        assert_close(state.select(key), expected.select(key))
    torch.testing.assert_close(state["alpha"], expected["alpha"], rtol=max(rtol, 1e-7), atol=0)
    for key in ("weights", "trace", "snapshot"):
        for name, leaf in state[key].items(include_nested=True, leaves_only=True):
            torch.testing.assert_close(leaf, expected[key][name], rtol=rtol, atol=atol)
    assert state["weights", "weight"].abs().max() > 0.1


def test_it_learns_what_the_eager_engine_learns(batch: Compiled) -> None:
    assert_learned_alike(batch, 1e-4, 1e-5)


@pytest.fixture(scope="module")
def double(compiler: None) -> Compiled:
    settings = config("trace=gradient", "machine.dtype=float64")
    stays = make_runs(settings, RUNS, lam=torch.linspace(0, 1, RUNS))
    return compile_learning(settings, in_lanes(stays))


def test_it_learns_in_double_precision_what_the_eager_engine_learns(double: Compiled) -> None:
    assert_learned_alike(double, 1e-11, 1e-13)


def test_it_learns_on_one_side_what_the_eager_engine_learns() -> None:
    settings = config("env=follow_one_side", "env.switch_side_after=2", "env.other_view_rad=0.2")
    assert_learned_alike(compile_learning(settings, make_runs(settings, LANES)), 1e-4, 1e-5)


@pytest.mark.parametrize(
    "step_size",
    [
        "auto_tidbd",
        "swift",
        *(
            pytest.param(rule, marks=pytest.mark.long)  # the normalised layers below learn by obgd
            for rule in ("obgd", "alpha_bound", "idbd", "autostep", "tidbd")
        ),
    ],
)
def test_it_learns_by_steps_that_adapt_what_the_eager_engine_learns(step_size: str) -> None:
    alpha = ["alpha=0.1"] if step_size in PER_WEIGHT else []
    settings = config(f"step_size={step_size}", "machine.dtype=float64", "lam=0.8", *alpha)
    stays = make_runs(settings, RUNS, kappa=torch.linspace(1.1, 4, RUNS))
    many = compile_learning(settings, in_lanes(stays))
    assert_learned_alike(many, 1e-10, 1e-12)
    alone = in_lanes(stays[13:14])
    state = run(many[2], alone, make_learner(settings, alone).begin(alone), STEPS)
    assert not different(state[:1], learn(many, STEPS)[13:14])


@pytest.mark.parametrize("clock", [pytest.param("steps", marks=pytest.mark.long), "situations"])
def test_it_learns_with_parameters_that_adapt_what_the_eager_engine_learns(clock: str) -> None:
    """A run alone is that of the batch, in which every setting of the scheme differs."""
    doya = ("adaptive=doya", "adaptive_beta=affine", f"adaptive_clock={clock}", "temperature=0.3")
    settings = config(*doya, "alpha=0.3", "machine.dtype=float64")
    among = torch.linspace(0, 1, RUNS)
    stays = make_runs(
        settings,
        RUNS,
        adaptive_rate=among,
        adaptive_period=1 + (4 * among).round(),
        adaptive_short=1 + 5 * among,
        adaptive_long=6 - 5 * among,
        alpha=0.2 + among / 2,
        gamma=0.9 + among / 20,
        temperature=0.1 + among,
    )
    many = compile_learning(settings, in_lanes(stays))
    assert_learned_alike(many, 1e-9, 1e-11)
    state, expected = learn(many, STEPS), learn_eagerly(many, STEPS)
    assert_close(state["adaptive"], expected["adaptive"])
    assert (state["adaptive", "level"].std(0) > 0).all()
    alone = in_lanes(stays[13:14])
    one = run(many[2], alone, make_learner(settings, alone).begin(alone), STEPS)
    assert not different(one[:1], state[13:14])


@pytest.mark.parametrize(
    "overrides",
    [
        ("trace=dutch", "variant=sarsa", "epsilon=1", "epsilon_final=0.1", "epsilon_over=20"),
        pytest.param(
            ("trace=clearing", "variant=expected_sarsa", "value=table"), marks=pytest.mark.long
        ),
    ],
    ids=" ".join,
)
def test_it_learns_on_policy_what_the_eager_engine_learns(overrides: tuple[str, ...]) -> None:
    settings = config("machine.dtype=float64", *overrides)
    assert_learned_alike(compile_learning(settings, make_runs(settings, LANES)), 1e-10, 1e-12)


LAYERS = ("value=mlp", "value.widths=[24, 24]", "alpha=0.05", "lam=0.8")


@pytest.mark.parametrize(
    "overrides",
    [
        # What the long ones have, the others have, too.
        pytest.param(("value=tiles", "alpha=0.05"), marks=pytest.mark.long),
        ("value=tiles", "value.memory=60", "alpha=0.05", "trace=replacing"),
        pytest.param((*LAYERS, "trace=gradient"), marks=pytest.mark.long),
        (*LAYERS, "value.layer_norm=true", "step_size=obgd"),
    ],
    ids=["tiles", "hashed tiles", "two layers", "normalised layers"],
)
def test_large_networks_learn_in_loops_what_the_eager_engine_learns(overrides) -> None:
    settings = config("machine.dtype=float64", *overrides)
    stays = make_runs(settings, RUNS)
    many = compile_learning(settings, in_lanes(stays))
    state, expected = learn(many, STEPS), learn_eagerly(many, STEPS)
    assert state["situations"].min() >= 3
    for key in ("weights", "trace", "snapshot"):
        for name, leaf in state[key].items(include_nested=True, leaves_only=True):
            torch.testing.assert_close(leaf, expected[key][name], rtol=1e-9, atol=1e-11)
    alone = in_lanes(stays[13:14])
    one = run(many[2], alone, make_learner(settings, alone).begin(alone), STEPS)
    assert not different(one[:1], state[13:14])


@pytest.mark.long
def test_inductor_learns_what_the_eager_engine_learns() -> None:
    labels = "[[-0.5, 0.4], [0.5, 0.4]]"
    settings = config(
        "action.candidates=3", f"value.inputs.bearing={labels}", f"value.action={labels}"
    )
    stays = make_runs(settings, LANES, lam=torch.linspace(0, 1, LANES))
    assert_learned_alike(compile_learning(settings, stays, InductorLoop), 1e-4, 1e-5)


@pytest.mark.parametrize(
    ("precision", "keys"),
    [("batch", ()), ("double", ("trace=gradient", "machine.dtype=float64"))],
    ids=["float32", "float64"],
)
def test_a_run_alone_is_the_run_in_any_batch(
    precision: str, keys: tuple[str, ...], request: pytest.FixtureRequest
) -> None:
    compiled: Compiled = request.getfixturevalue(precision)
    many, _, loop = compiled
    alone = in_lanes(many[13:14])
    assert len(alone) < len(many)
    state = run(loop, alone, make_learner(config(*keys), alone).begin(alone), LONGER)
    assert not different(state[:1], learn(compiled, LONGER)[13:14])


def test_a_program_of_another_world_is_another(batch: Compiled) -> None:
    other = compile_learning(config("env.catch_distance_m=0.3"), batch[0])
    state, expected = learn(other, STEPS), learn_eagerly(other, STEPS)
    assert torch.equal(state["situations"], expected["situations"])
    assert not torch.equal(state["situations"], learn(batch, STEPS)["situations"])


def test_neither_lanes_nor_workers_matter_to_runs_that_take_turns(batch: Compiled) -> None:
    _, learner, loop = batch
    runs, every, evaluations = 150, config().evaluation.every, 7
    last = every * (evaluations - 1)
    stays = make_runs(config(), runs, situations=last)

    class Counting:
        any_lanes = True

        def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
            lanes.append(len(state))
            return loop(stays, state)

    def learned(workers: int, order: Tensor) -> TensorDict:
        start = dict(learner.loss.value_network.named_parameters())
        blank = {name: weight[:1].expand(runs, *weight.shape[1:]) for name, weight in start.items()}
        with torch.no_grad():
            columns = {key: stays[key][order].flatten() for key in PER_RUN}
            columns = {key: x if key == "seed" else x.double() for key, x in columns.items()}
            its_runs = Runs({key: x.numpy() for key, x in columns.items()})
            ledger = Ledger(its_runs, blank, {}, every, evaluations, tests=1)
            task = Learning(learner, Counting(), stays[order], ledger, done.append)
            work_through(task, task.jobs, len(batch[0]), workers)
        return ledger.book.pages[:, order.argsort()]

    in_order, shuffled = torch.arange(runs), torch.randperm(runs, generator=torch.Generator())
    lanes: list[int] = []
    done: list[int] = []
    pages = learned(1, in_order)
    assert (pages["steps"].diff(dim=0) > 0).all()  # no page is missing
    assert lanes == [64, 32]  # lanes are dropped when no run waits for them
    assert done == sorted(done)
    assert done[-1] == runs * last
    assert not different(learned(2, in_order), pages)
    assert not different(learned(2, shuffled), pages)


def test_runs_that_diverge_do_so_as_they_do_eagerly(batch: Compiled) -> None:
    """NaN and infinity don't spread from a run to others."""
    stays = batch[0].clone()
    stays["alpha"][::2] = 1e30
    huge = (stays, *batch[1:])
    state, expected = learn(huge, STEPS), learn_eagerly(huge, STEPS)
    finite = expected["weights", "weight"].isfinite().flatten(1).all(1)
    assert not finite[::2].any()
    assert finite[1::2].all()
    assert torch.equal(state["weights", "weight"].isfinite().flatten(1).all(1), finite)
    assert not different(state[1::2], learn(batch, STEPS)[1::2])
