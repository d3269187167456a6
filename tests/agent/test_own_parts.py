"""A trace, an exploration and a step size of the user's own."""

import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import pytest
import torch
import yaml

from fnnq_torchrl.agent.parts import check_own
from fnnq_torchrl.agent.policy import BoltzmannPolicy
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.own import LEARNER, own_kinds
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.engine.native.translation import source
from fnnq_torchrl.equations.step_size import IDBD
from fnnq_torchrl.equations.traces import GradientTrace
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.memberships import visited_states
from fnnq_torchrl.training.recipe import recipe
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.weights import load_checkpoint
from tests.commands import fnnq_train
from tests.programs import SMALL_WORLD, advance, make_learner, make_runs, saved_training

SHIPPED = {
    "trace": (GradientTrace, "gradient"),
    "exploration": (BoltzmannPolicy, "boltzmann"),
    "step_size": (IDBD, "idbd"),
}
Module = Callable[[str, str], None]


shipped = cache(load_config)


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Module:
    """Return a function that writes a module of the user's."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)

    def write(name: str, text: str) -> None:
        Path(f"{name}.py").write_text(text)
        monkeypatch.delitem(sys.modules, name, raising=False)

    return write


@pytest.fixture
def copies(module: Module) -> list[str]:
    """Return overrides that name copies of shipped classes."""
    for key, (shipped, _) in SHIPPED.items():
        copy = inspect.getsource(shipped).replace(f"class {shipped.__name__}", "class Mine")
        module(f"copied_{key}", f"from {shipped.__module__} import *\n\n\n{copy}")
    return [f"{key}=copied_{key}:Mine" for key in SHIPPED]


def test_a_copy_of_a_shipped_class_learns_the_same_bits(copies: list[str]) -> None:
    numbers = ("alpha=0.1", "alpha_decay=1", "meta_step_size=0.05", "temperature=0.1")
    shared = (*SMALL_WORLD, "variant=watkins", *numbers)
    names = [f"{key}={name}" for key, (_, name) in SHIPPED.items()]
    programs, states = [], []
    for parts in (names, copies):
        settings = load_config(*parts, *shared)
        check_own(settings)
        runs = make_runs(settings, 2, lam=torch.tensor([0.3, 0.9]))
        learner = make_learner(settings, runs)
        programs.append(source(learner.step, runs, learner.begin(runs)))
        states.append(advance(learner, runs, 30))
    assert programs[0] == programs[1]
    first, second = (state.flatten_keys(".") for state in states)
    assert {*first.keys()} == {*second.keys()}
    assert all(torch.equal(first[key], second[key]) for key in first.keys())  # noqa: SIM118
    assert (first["weights.weight"] != 0).any()


def test_what_runs_own_code_is_traced_afresh(copies: list[str]) -> None:
    for override in copies:
        settings = load_config(override)
        assert recipe(settings, "learn") is None
        assert recipe(settings, "test") is not None


HEAD = "from fnnq_torchrl import ExploringPolicy, StepSize, Stepped, Trace\nimport torch\n"
TRACE = """
class Mine(Trace):
    def update(self, traces, gradients, credit):
        return [(e + f, e) for e, f in zip(traces, gradients)]
"""
STEP_SIZE = """
class Mine(StepSize):
    numbers = ("eta",)
    def start(self, alpha, weights):
        return {"h": [w.clone() for w in weights]}
    def update(self, alpha, numbers, state, step):
        return Stepped(step.credited(), [alpha], alpha, state)
"""
EXPLORATION = """
class Mine(ExploringPolicy):
    amount_name = "epsilon"
    def choose(self, action_values, amount, u):
        return self.value_network.candidates[action_values.argmax(0)]
"""
CODE = {"trace": TRACE, "step_size": STEP_SIZE, "exploration": EXPLORATION}

MISTAKES = [
    ("trace", "def update", "def updat", (), "Mine must have update"),
    ("trace", "Mine(Trace)", "Mine(StepSize)", (), "must be a subclass of Trace"),
    ("trace", "(e + f, e)", "(e[0], e)", (), "the direction is float32 [2]; it must be float32"),
    ("trace", "(e + f, e)", "(f, e.double())", (), "the trace is float64 [3, 2]; it must be"),
    ("trace", "(e + f, e)", "e", (), "must return a pair for each tensor of weights"),
    ("trace", "e + f", "e + g", (), "its update fails: NameError: name 'g' is not defined"),
    ("trace", "    def", "    corrects = True\n    def", (), "needs variant='sarsa', not 'peng'"),
    ("step_size", '"eta"', '"etta"', (), "the runs have no such number; did you mean eta?"),
    ("step_size", '{"h": [w.clone() for w in weights]}', "[]*3+[1]", (), "its start fails: Type"),
    ("step_size", "w.clone()", "w[0]", (), "its start: h is [float32 [2]]; it must be [float32 ["),
    ("step_size", "[alpha],", "alpha,", (), "sizes is [float32 [], float32 []]; it must be ["),
    ("step_size", "alpha, state)", "alpha, {})", (), "must return a state with ['h']"),
    ("step_size", "Stepped(", "(alpha, ", (), "its update fails: TypeError"),
    (
        "exploration",
        '"epsilon"',
        '"epsilo"',
        (),
        "amount_name: the runs have no such number",
    ),
    (
        "exploration",
        "argmax(0)]",
        "argmax(0)[0]]",
        (),
        "the action is float32 []; it must be float32",
    ),
    (
        "exploration",
        "argmax(0)]",
        "argmax(0)] + 0.5",
        ("task=mountain_car", "value=tiles"),
        "its choose must return some of the candidates",
    ),
    (
        "exploration",
        "Mine",
        "Mine",
        ("variant=expected_sarsa",),
        "must have probabilities",
    ),
]


@pytest.mark.parametrize("key", LEARNER)
def test_a_right_class_is_taken(module: Module, key: str) -> None:
    module("right", HEAD + CODE[key])
    check_own(replace(shipped(), **{key: "right:Mine"}))


@pytest.mark.parametrize(("key", "right", "wrong", "more", "told"), MISTAKES)
def test_a_wrong_class_is_refused_in_a_line(
    module: Module, key: str, right: str, wrong: str, more: tuple[str, ...], told: str
) -> None:
    assert right in CODE[key]
    module("wrong", HEAD + CODE[key].replace(right, wrong))
    with pytest.raises(ConfigError) as refused:
        check_own(replace(shipped(*more), **{key: "wrong:Mine"}))
    line = str(refused.value)
    assert line.startswith(f"{key}=wrong:Mine: ")
    assert told in line
    assert "\n" not in line


@pytest.mark.parametrize("key", LEARNER)
def test_what_isnt_there_is_refused_with_advice(module: Module, key: str) -> None:
    module("mine", HEAD + CODE[key])
    attribute = "module 'mine' has no attribute 'Mime'; did you mean Mine?"
    for kind, told in (("mine:Mime", attribute), ("nowhere:Mine", "No module named 'nowhere'")):
        with pytest.raises(ConfigError) as refused:
            load_config(f"{key}={kind}")
        assert str(refused.value) == f"{key}={kind}: {told}"
    with pytest.raises(ConfigError, match=rf"^{key}=mine: must be .* or your own module:Class$"):
        load_config(f"{key}=mine")


def test_a_step_size_has_the_settings_of_a_constant_one(module: Module) -> None:
    module("mine", HEAD + STEP_SIZE)
    settings = load_config("step_size=mine:Mine")
    assert settings == replace(load_config("step_size=constant"), step_size="mine:Mine")
    assert load_config("step_size=mine:Mine", "alpha_decay=0.9").alpha_decay == 0.9


@pytest.mark.long
def test_a_sweep_takes_own_and_shipped_ones(module: Module, tmp_path: Path) -> None:
    module("mine", HEAD + STEP_SIZE)
    module("also", HEAD + TRACE)
    swept = ("step_size=constant,mine:Mine", "trace=also:Mine", "alpha=0.01", "-m")
    short = (*SMALL_WORLD, "situations=5", "engine=eager")
    assert fnnq_train(*swept, *short, f"hydra.sweep.dir={tmp_path / 'sweep'}") == 0
    _, *rows = (tmp_path / "sweep" / "evaluations.csv").read_text().splitlines()
    assert {row.rpartition(",")[2] for row in rows} == {"constant", "mine:Mine"}


@pytest.fixture
def job(module: Module, tmp_path: Path) -> Path:
    """Return the directory of a finished job with classes that can't be imported any more."""
    for key, code in CODE.items():
        module(f"its_{key}", HEAD + code)
    parts = [f"{key}=its_{key}:Mine" for key in LEARNER]
    short = (*SMALL_WORLD, "situations=5", "engine=eager", "alpha=0.1", "alpha_decay=0.5")
    assert fnnq_train(*parts, *short, f"hydra.run.dir={tmp_path / 'job'}") == 0
    for key in CODE:
        Path(f"its_{key}.py").write_text("raise SystemExit('imported')")
        sys.modules.pop(f"its_{key}")
    return tmp_path / "job"


def test_its_results_are_read_without_importing_its_classes(job: Path, module: Module) -> None:
    settings = to_config(load_checkpoint(job / "checkpoint.pt").config)
    assert [*own_kinds(settings)] == [*LEARNER]
    assert own_kinds(settings, learner=False) == {}
    assert read_evaluations(job / "evaluations.csv").runs == 1
    visited = load_config("value.membership=clustered", f"value.visited={job}")
    with pytest.raises(ConfigError, match=r"exploration=its_exploration:Mine names code from out"):
        visited_states(visited)

    # They are imported again only if they are typed.
    typed = [f"from={job}"]
    for key in ("step_size", "exploration", "trace"):  # their order in the configuration
        named = f"{key}=its_{key}:Mine"
        with pytest.raises(ConfigError, match=f"; if you trust it, add {re.escape(named)} to the"):
            load_config(*typed)
        typed.append(named)
    for key, code in CODE.items():
        module(f"its_{key}", HEAD + code)
    again = load_config(*typed)
    saved = Config(**vars(to_config(yaml.safe_load((job / ".hydra/config.yaml").read_text()))))
    assert asdict(again) == asdict(saved)
    assert again.alpha_decay == 0.5
    sweep = Path("sweep")
    assert fnnq_train(*typed, "lam=0,0.5", "-m", f"hydra.sweep.dir={sweep}") == 0
    for directory in (sweep / "0", sweep / "1"):
        swept = yaml.safe_load((directory / ".hydra" / "config.yaml").read_text())
        assert (swept["step_size"], swept["alpha_decay"]) == ("its_step_size:Mine", 0.5)


@pytest.mark.parametrize("key", LEARNER)
def test_a_training_goes_on_only_with_the_same_code(
    module: Module, key: str, tmp_path: Path
) -> None:
    identities = []
    for code in (CODE[key], CODE[key], f"{CODE[key]}\n# changed"):
        module("mine", HEAD + code)
        own = replace(shipped(), **{key: "mine:Mine"})
        identities.append(saved_training(tmp_path, own)._identity)
    assert identities[0] == identities[1] != identities[2]
