"""The schema, the values under ``conf/``, and the configurations composed from both."""

import re
import subprocess
import sys
from copy import deepcopy
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import pytest
import torch
import yaml
from hydra import initialize_config_dir, version
from hydra.core.global_hydra import GlobalHydra
from hydra.core.utils import JobRuntime
from omegaconf import OmegaConf

from envs.core.parameters import allowed
from envs.schemas import SCHEMAS as WORLDS
from envs.worlds import WORLDS as CLASSES
from fnnq_torchrl.agent.values import NETWORKS
from fnnq_torchrl.config.checking import UnknownKey, ranges_of, to_config
from fnnq_torchrl.config.choices import choices_of, config_directory
from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.config.schema import PER_RUN, Config, ConfigError, OutOfRange
from fnnq_torchrl.config.values import SCHEMAS as VALUES
from fnnq_torchrl.equations.membership import log_membership
from fnnq_torchrl.launch.composition import load_config

CONF = config_directory()
FILES = {path.relative_to(CONF) for path in CONF.rglob("*") if path.is_file()}
CHOICES = {
    path: f"{path.parent}={path.stem}"
    for path in sorted(
        FILES - {Path("config.yaml"), Path("paper_runs.yaml"), Path("action/all.yaml")}
    )
    # A task chooses its labels, and those with an underscore are what others are made of.
    if path.parent not in (Path("value/labels"), Path("tuned")) and not path.stem.startswith("_")
    # The user must name the class of these.
    if path.stem != "own" and path != Path("env/torchrl.yaml")
    # A task and its values for the learner are composed with the world of this name, and
    # experiments in tests/launch/test_sweeper.py.
    if path.parent not in (Path("task"), Path("learner"), Path("experiment"))
    if path.suffix == ".yaml"
}

NONSENSE = "non/sense " * 30
"""A text that is too long for a file name and has characters that names can't have."""


@pytest.fixture(scope="module")
def default() -> Config:
    return load_config()


def test_the_defaults_are_the_papers_and_spec(default):
    assert asdict(default) == {
        "lam": 0.2,
        "seed": 0,
        "num_seeds": 1,
        "alpha": 0.4,
        "alpha_decay": 0.99,
        "step_size": "decay",
        "kappa": 2,
        "meta_step_size": 0.01,
        "tau": 1e4,
        "eta": 0.1,
        "eta_min": 1e-10,
        "eta_decay": 0.999,
        "gamma": 0.95,
        "exploration": "epsilon_greedy",
        "epsilon": 0.1,
        "epsilon_final": None,
        "epsilon_over": 1,
        "temperature": 0.01,
        "noise_std": 0.3,
        "adaptive": "none",
        "adaptive_parameters": ["alpha", "temperature", "gamma"],
        "adaptive_beta": "exponential",
        "adaptive_clock": "steps",
        "adaptive_rate": 0.2,
        "adaptive_period": 100,
        "adaptive_short": 100,
        "adaptive_long": 100,
        "variant": "peng",
        "trace": "output",
        "window": 10,
        "scale_rewards": False,
        "engine": "auto",
        "diverged_beyond": 100,
        "situations": 200,
        "resume": "auto",
        "checkpoint": {"every_s": 300, "snapshots": False},
        "env": {
            "kind": "follow_ball",
            "time_step_s": 0.1,
            "speed_mps": 0.3,
            "track_width_m": 0.321,
            "circle_radius_m": 1.5,
            "start_angle_rad": 0.9,
            "ball_speed_min_radps": 0.05,
            "ball_speed_max_radps": 0.15,
            "catch_distance_m": 0.2,
            "time_limit_steps": 120,
            "bearing_noise_rad": 0.01,
            "field_of_view_rad": 1.0,
            "catch_reward": 1.0,
            "miss_reward": -0.5,
            "change_at": 0,
            "changed_speed": 1.0,
            "swap_wheels": False,
        },
        "value": {
            "kind": "fnnq",
            "inputs": {"bearing": [[-0.5, 0.4], [-0.1, 0.1], [0, 0.05], [0.1, 0.1], [0.5, 0.4]]},
            "action": [[-1, 0.4], [-0.4, 0.3], [0.4, 0.3], [1, 0.4]],
            "width": "sigma",
            "names": {
                "bearing": ["far_right", "right", "ahead", "left", "far_left"],
                "steer": ["hard_left", "left", "right", "hard_right"],
            },
            "elsewhere": "nearest",
            "membership": "paper",
            "labels_of_input": 5,
            "labels_of_action": None,
            "clustering": "kmeans",
            "visited": None,
            "warm_up": 100,
            "t_norm": "product",
            "learn_memberships": False,
            "least_width": 0.1,
        },
        "action": {"candidates": 21},
        "evaluation": {
            "every": 5,
            "situations": [[0.8, 0.1], [-0.8, -0.1], [0.4, -0.15], [-0.4, 0.15], [0, 0.12]],
        },
        "machine": {"device": "cpu", "dtype": "float32"},
        "rules": {
            "prior": None,
            "frozen": [],
            "demonstrations": None,
            "margin": 0.5,
            "count_firing": False,
        },
        "logger": {"video": False, "wandb": None, "tensorboard": None, "mlflow": None},
    }


@cache
def composed(choice: str) -> Config:
    """A choice; a world by its task, or with the task that has the test for such a world."""
    tasks = [task for task in choices_of("task") if choice.startswith(f"env={task}")]
    if not tasks:
        return load_config(choice)
    task = max(tasks, key=len)
    return load_config(f"task={task}", *[choice] * (choice != f"env={task}"))


@pytest.mark.parametrize("choice", CHOICES.values())
def test_every_shipped_yaml_composes(choice):
    composed(choice)


@pytest.mark.parametrize("name", choices_of("tuned"))
def test_a_tuned_file_is_that_of_a_task_and_a_value_function(name):
    value = next(each for each in VALUES if name.endswith(f"_{each}"))
    task = name.removesuffix(f"_{value}")
    tuned = yaml.safe_load((CONF / "tuned" / f"{name}.yaml").read_text())
    words = [f"task={task}", f"value={value}"]
    if task == "torchrl":
        words += ["env.kind=torchrl:torchrl.envs:PendulumEnv", "action=even"]
    config = load_config(*words)
    for key, number in tuned.items():
        if key == "defaults":
            assert all((CONF / "tuned" / f"{other}.yaml").exists() for other in number)
        elif key == "value":
            assert {name: getattr(config.value, name) for name in number} == number
        else:
            assert getattr(config, key) == number


def test_the_command_line_takes_precedence_over_a_tuned_file():
    tuned = yaml.safe_load((CONF / "tuned" / "cart_pole_tiles.yaml").read_text())
    words = ["task=cart_pole", "value=tiles"]
    assert tuned["alpha"] != 0.77
    assert load_config(*words, "alpha=0.77").alpha == 0.77


def test_every_shipped_file_is_yaml():
    files_of_rules = {path for path in FILES if path.parent == Path("rules")}
    assert {path.suffix for path in FILES - files_of_rules} == {".yaml"}
    assert {path.suffix for path in files_of_rules} == {".yaml", ".txt", ".csv"}


def test_overrides_reach_their_keys():
    config = load_config("lam=1", "env.speed_mps=0.5", "value.inputs.bearing=[[0,1]]")
    assert (config.lam, config.env.speed_mps) == (1, 0.5)
    assert config.value.inputs == {"bearing": [[0, 1]]}


LOGGERS = ("wandb", "tensorboard", "mlflow")


@cache
def plain_config(env, value):
    """Return the values of a world and a value function, with those of every logger."""
    plain = asdict(composed(f"env={env}" if value == "fnnq" else f"value={value}"))
    loggers = {name: asdict(getattr(composed(f"logger={name}").logger, name)) for name in LOGGERS}
    return plain | {"logger": plain["logger"] | loggers}


@pytest.mark.parametrize(
    ("env", "value", "key"),
    [
        *(("follow_ball", "fnnq", key) for key in allowed(Config)),
        *(("follow_ball", kind, key) for kind in VALUES for key in allowed(VALUES[kind], "value.")),
        *((kind, "fnnq", key) for kind in WORLDS for key in allowed(WORLDS[kind], "env.")),
    ],
)
def test_every_key_has_a_type_and_a_range(env, value, key):
    values = deepcopy(plain_config(env, value))
    *groups, name = key.split(".")
    group = values
    for each in groups:
        if group[each] is None:
            pytest.skip("the world leaves that group out")
        group = group[each]
    group[name] = NONSENSE
    with pytest.raises(ConfigError) as refused:
        to_config(values)
    ranges = ranges_of({"env": env, "value": value})
    assert str(refused.value) == f"{key}={NONSENSE}: must be {ranges[key]}"


def test_a_world_has_a_file_of_values_a_schema_and_a_class():
    assert CLASSES.keys() == WORLDS.keys()
    for kind in WORLDS:
        assert composed(f"env={kind}").env.kind == kind
        assert CLASSES[kind].schema is WORLDS[kind]


def test_a_value_function_has_a_file_of_values_a_schema_and_a_network():
    assert NETWORKS.keys() == VALUES.keys()
    for kind in VALUES:
        assert composed(f"value={kind}").value.kind == kind
        assert NETWORKS[kind].schema is VALUES[kind]


@pytest.mark.parametrize(
    ("override", "line"),
    [
        (
            "env.ball_speed_min_radps=0.2",
            "env.ball_speed_min_radps=0.2: must be at most ball_speed_max_radps=0.15",
        ),
        (
            "env.start_side=left",
            "env.start_side=left: env=follow_ball has no start_side; "
            "it belongs to env=follow_one_side",
        ),
        (
            "value.tilings=4",
            "value.tilings=4: value=fnnq has no tilings; it belongs to value=tiles or tiles_sum",
        ),
        (
            "value.widht=sigma",
            "value.widht=sigma: there is no value.widht; did you mean value.width?",
        ),
        (
            "env.kind=maze",
            "env.kind=maze: must be acrobot, cart_pole, chain, follow_ball, follow_obstacles, "
            "follow_one_side, gymnasium, mountain_car, random_walk, ring, two_states, wander or "
            "your own module:Class",
        ),
        ("env.kind=nowhere:Maze", "env.kind=nowhere:Maze: No module named 'nowhere'"),
        (
            "+value.inputs.sonar=[[0,1]]",
            "value.inputs.sonar=[[0, 1]]: must be named after an observation: bearing",
        ),
        ("~value.inputs.bearing", "value.inputs={}: must be labels for at least one of: bearing"),
        (
            "value.action=[[0,0]]",
            "value.action=[[0, 0]]: must be a list of at least one pair [centre, width] "
            "with width > 0, or {triangle: [a, b, c]} and the like, or null",
        ),
        (
            "value.action=[{triangel: [0, 1, 2]}]",
            "value.action={'triangel': [0, 1, 2]}: must be of a kind gaussian, triangle, "
            "trapezoid, bell, sigmoid or gaussian_two_sided; did you mean triangle?",
        ),
        (
            "value.inputs.bearing=[{triangle: [0, 1, 0]}]",
            "value.inputs.bearing={'triangle': [0, 1, 0]}: must be triangle: [a, b, c] with "
            "a <= b <= c and a < c",
        ),
        (
            "value.inputs=null",
            "value.inputs=null: must be labels, or null if value.membership is even or clustered",
        ),
        (
            ["value.learn_memberships=true", "value.action=[{bell: [0, 1, 2]}]"],
            "value.learn_memberships=true: must be false, unless all labels are Gaussian "
            "[centre, width]",
        ),
        (
            ["value=rbf", "value.t_norm=minimum"],
            "value.t_norm=minimum: value=rbf has no t_norm; it belongs to value=fnnq",
        ),
        (
            "evaluation.situations=[]",
            "evaluation.situations=[]: must be a list of at least one start [number, …], "
            "or a whole number >= 0",
        ),
        (
            "evaluation.situations=[[0.1]]",
            "evaluation.situations=[[0.1]]: must be a list of starts [angle, speed], "
            "or a whole number of random starts",
        ),
        (["trace=dutch"], "variant=peng: must be sarsa with trace=dutch"),
        (
            ["trace=dutch", "variant=sarsa", "step_size=obgd"],
            "step_size=obgd: must be decay, constant or swift with trace=dutch",
        ),
        (
            ["trace=dutch", "variant=sarsa", "rules.frozen=[ahead]"],
            "rules.frozen=['ahead']: must be [] with trace=dutch",
        ),
        (
            ["adaptive=doya", "exploration=epsilon_greedy"],
            "exploration=epsilon_greedy: must be boltzmann with adaptive=doya and temperature "
            "among adaptive_parameters",
        ),
        (
            ["adaptive=doya", "step_size=decay"],
            "step_size=decay: must be constant or obgd with adaptive=doya and alpha among "
            "adaptive_parameters",
        ),
        (
            ["adaptive=doya", "step_size=obgd"],
            "alpha=1.0: must be a number in (0, 1), without 0 and 1, with adaptive=doya and alpha "
            "among adaptive_parameters",
        ),
        (
            ["adaptive=doya", "gamma=1"],
            "gamma=1.0: must be a number in (0, 1), without 0 and 1, with adaptive=doya and gamma "
            "among adaptive_parameters",
        ),
        (
            ["adaptive_parameters=[alpha,lam]"],
            "adaptive_parameters=['alpha', 'lam']: must be a list of at least one of alpha, "
            "temperature and gamma",
        ),
        ("adaptive=dooya", "adaptive=dooya: must be doya or none"),
        (
            ["trace=clearing"],
            "value.kind=fnnq: must be table, tiles or tiles_sum with trace=clearing",
        ),
        (
            ["variant=expected_sarsa", "exploration=noise"],
            "exploration=noise: must be epsilon_greedy or boltzmann with variant=expected_sarsa",
        ),
        ("lam=", "lam=: must be a number in [0, 1]"),
        ("lam=null", "lam=null: must be a number in [0, 1]"),
        ("lam=true", "lam=true: must be a number in [0, 1]"),
        ("alpha=-1", "alpha=-1.0: must be a number in [0, inf)"),
        ("seed=-1", "seed=-1: must be a whole number >= 0"),
        ("evaluation.every=0", "evaluation.every=0: must be a whole number >= 1, or null"),
        ("evaluation.every=3", "situations=200: must be a whole multiple of evaluation.every=3"),
        ("situations=0", "situations=0: must be a whole number >= 1"),
        (
            "step_size=foo",
            "step_size=foo: must be alpha_bound or auto_tidbd or autostep or constant or decay or "
            "idbd or obgd or swift or tidbd or your own module:Class",
        ),
        (
            ["step_size=idbd", "value=mlp"],
            "value.kind=mlp: must be fnnq, fnnq_sum, fuzzy_q, rbf, table, tiles or tiles_sum, "
            "whose Q is linear in its weights, with step_size=idbd",
        ),
        (
            ["step_size=swift", "value.learn_memberships=true"],
            "value.learn_memberships=true: must be false with step_size=swift",
        ),
        (["step_size=tidbd", "alpha=0"], "alpha=0.0: must be above 0 with step_size=tidbd"),
        (
            ["step_size=autostep", "alpha_decay=0.9"],
            "alpha_decay=0.9: must be 1 with step_size=autostep",
        ),
        (
            ["step_size=auto_tidbd", "rules.frozen=[ahead]"],
            "rules.frozen=['ahead']: must be [] with step_size=auto_tidbd",
        ),
        (["step_size=swift", "variant=peng"], "variant=peng: must be sarsa with step_size=swift"),
        (["step_size=swift", "trace=output"], "trace=output: must be dutch with step_size=swift"),
        (["step_size=swift", "eta_min=0.2"], "eta_min=0.2: must be at most eta=0.1"),
        ("step_siz=obgd", "step_siz=obgd: there is no step_siz; did you mean step_size?"),
        ("kappa=1", "kappa=1.0: must be a number in (1, inf)"),
        ("action.candidates=1", "action.candidates=1: must be a whole number >= 2, or null"),
        (
            "action=all",
            "action.candidates=null: must be a number, as action=even sets: follow_ball has a "
            "range of actions",
        ),
        ("machine.device=tpu", "machine.device=tpu: must be cpu, cuda or cuda:N"),
        ("~lam", "lam=???: must be a number in [0, 1]"),
        ("lam=${nowhere}", "lam: Interpolation key 'nowhere' not found"),
        ("lam=[", "lam=[: can't be read as key=value"),
        (
            "speed_mps=1",
            "speed_mps=1: there is no speed_mps; "
            "did you mean env.speed_mps or env.robot.speed_mps?",
        ),
        ("logger=nope", "logger=nope: must be csv or mlflow or tensorboard or wandb"),
        ("logger=[csv,nope]", "logger=nope: must be csv or mlflow or tensorboard or wandb"),
        (
            "logger.wandb.per=run",
            "logger.wandb.per=run: wandb isn't chosen; 'logger=[csv,wandb]' chooses it",
        ),
        ("envs=follow_ball", "envs=follow_ball: there is no envs; did you mean env?"),
        ("env={sped: 1}", "env.sped: there is no env.sped; did you mean env.speed_mps?"),
        (
            "env.situations=1",
            "env.situations=1: there is no env.situations; "
            "did you mean situations or evaluation.situations?",
        ),
        (
            "evaluation.x=1",
            "evaluation.x=1: there is no evaluation.x; there is evaluation.every, "
            "evaluation.situations",
        ),
    ],
)
def test_a_mistake_is_one_line(override, line):
    with pytest.raises(ConfigError) as refused:
        load_config(*([override] if isinstance(override, str) else override))
    assert str(refused.value) == line


def test_a_suggestion_is_a_key_of_the_chosen_value_function():
    for value, line in (
        ("fnnq", "there is no value.widhts; did you mean value.width?"),
        ("mlp", "there is no value.widhts; did you mean value.widths?"),
    ):
        with pytest.raises(UnknownKey) as refused:
            load_config(f"value={value}", "value.widhts=[3]")
        assert str(refused.value) == f"value.widhts=[3]: {line}"


def test_an_entry_of_a_list_has_the_lists_range():
    with pytest.raises(ConfigError, match=r"^value\.widths\[0\]=a: must be a list of at least one"):
        load_config("value=mlp", "value.widths=[a]")


@pytest.mark.parametrize(
    ("value", "alpha"),
    [("fnnq", 0.4), ("rbf", 0.05), ("table", 0.05), ("tiles", 0.1), ("mlp", 0.2)],
)
def test_a_value_function_brings_its_step_size(value, alpha):
    """The default is the sweep's best α, which the experiment on extrapolation has too."""
    assert composed(f"value={value}").alpha == alpha
    cases = OmegaConf.load(CONF / "experiment" / "extrapolation.yaml").hydra.sweeper.cases
    assert {case.value: case.alpha for case in cases if "value" in case}[value] == alpha


def test_a_value_functions_step_size_yields_to_the_users():
    assert load_config("value=mlp", "step_size=constant").alpha == 0.2
    assert load_config("value=mlp", "step_size=obgd").alpha == 1
    assert load_config("alpha=0.3", "value=mlp").alpha == 0.3


@pytest.mark.parametrize(
    "given", [("step_size=obgd", "alpha=0.1"), ("alpha=0.1", "step_size=obgd")]
)
def test_a_step_size_brings_its_values_and_yields_to_the_users(given):
    config = load_config(*given)
    assert (config.step_size, config.alpha, config.alpha_decay) == ("obgd", 0.1, 1)
    assert composed("step_size=obgd").alpha == 1


@pytest.fixture
def own_task(tmp_path):
    """Return a configuration directory with a user's own task on our world."""
    for name, text in {
        "task/mine.yaml": "# @package _global_\n"
        "defaults: [/env: follow_ball, /action: even, /evaluation: random]\n",
        "learner/mine.yaml": "# @package _global_\ngamma: 0.5\nalpha: 0.7\nalpha_decay: 0.8\n",
        "value/labels/mine.yaml": "inputs: {bearing: [[0, 1]]}\naction: [[0, 1]]\n",
        "value/mine.yaml": "# @package _global_\n"
        "defaults: [fnnq@value]\nalpha: 0.6\nalpha_decay: 0.9\n",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    return f"hydra.searchpath=[{tmp_path.as_uri()}]"


@pytest.mark.parametrize(
    ("given", "alpha", "alpha_decay"),
    [
        ((), 0.7, 0.99),  # the choice of the step size sets alpha_decay
        (("value=mine",), 0.6, 0.99),
        (("value=mine", "step_size=obgd"), 1, 1),
        (("step_size=obgd", "value=mine", "alpha=0.2"), 0.2, 1),
        (("alpha_decay=0.5", "value=mine"), 0.6, 0.5),
    ],
)
def test_a_task_yields_to_the_value_that_to_the_step_size_and_all_to_the_user(
    own_task, given, alpha, alpha_decay
):
    config = load_config(own_task, "task=mine", *given)
    assert (config.alpha, config.alpha_decay) == (alpha, alpha_decay)
    assert config.gamma == 0.5
    assert config.evaluation.tests == 10


def test_a_task_brings_its_labels(own_task):
    assert load_config(own_task, "task=mine").value.inputs == {"bearing": [[0, 1]]}
    assert load_config(own_task, "task=mine", "value=rbf").value.action == [[0, 1]]
    assert load_config(own_task, "task=mine", "value=mlp").value.inputs == ["bearing"]
    spans = load_config(own_task, "task=mine", "value=tiles", "env.field_of_view_rad=2").value
    assert (spans.inputs, spans.action) == ({"bearing": [-2, 2]}, [-1, 1])


def test_a_constant_does_not_decay():
    assert load_config("step_size=constant", "alpha_decay=1").alpha_decay == 1
    with pytest.raises(ConfigError, match=r"^alpha_decay=0\.9: must be 1 with step_size=constant$"):
        load_config("step_size=constant", "alpha_decay=0.9")


def test_the_last_seed_fits_63_bits(default):
    assert Runs.of([load_config(f"seed={2**63 - 2}", "num_seeds=2")])["seed"][-1] == 2**63 - 1
    with pytest.raises(ConfigError, match=f"^seed={2**63 - 1}: must be at most {2**63 - 2}"):
        replace(default, seed=2**63 - 1, num_seeds=2)


def test_a_config_is_checked_when_it_is_made(default):
    with pytest.raises(ConfigError, match=r"^lam=1\.5: must be"):
        replace(default, lam=1.5)


def test_the_columns_of_the_runs(default):
    columns = Runs.of([replace(default, seed=3, num_seeds=4)]).columns
    assert tuple(columns) == PER_RUN
    assert columns.pop("seed").tolist() == [3, 4, 5, 6]
    assert columns.pop("epsilon_final").tolist() == [default.epsilon] * 4  # it isn't set
    for key, column in columns.items():
        assert column.tolist() == [getattr(default, key)] * 4


def test_a_saved_configuration_comes_back(default):
    assert to_config(OmegaConf.create(asdict(default))) == default


def test_values_from_elsewhere_name_no_code(default):
    for group in ("env", "value"):
        values = asdict(default)
        values[group]["kind"] = "os:system"
        with pytest.raises(
            ConfigError, match=rf"^{group}\.kind=os:system: .* in untrusted values$"
        ):
            to_config(values)
    with pytest.raises(ConfigError, match="must be a plain value"):
        to_config(asdict(default) | {"exploration": "${oc.env:HOME}"})


def test_a_saved_configuration_is_checked(default):
    with pytest.raises(UnknownKey, match=r"^lamm=1: .* did you mean lam"):
        to_config(OmegaConf.create(asdict(default) | {"lamm": 1}))
    with pytest.raises(ConfigError, match=r"^lam=\?\?\?: must be a number"):
        to_config(OmegaConf.create({}))


def test_load_config_leaves_a_surrounding_hydra_alone():
    def state():
        hydra = GlobalHydra.instance().hydra
        return hydra, version.getbase(), JobRuntime.instance().get("name")

    with initialize_config_dir(str(CONF), job_name="surrounding", version_base="1.2"):
        before = state()
        load_config()
        with pytest.raises(ConfigError):
            load_config("lam=2")
        assert state() == before


@pytest.mark.parametrize(
    ("module", "heavy"),
    [
        ("fnnq_torchrl.config.schema", {"torch", "hydra"}),
        ("fnnq_torchrl.train", {"torch", "torchrl", "tensordict", "scipy", "matplotlib"}),
    ],
)
def test_imports_are_light(module, heavy):
    script = f"import sys, {module}; print(*{heavy!r} & set(sys.modules))"
    command = [sys.executable, "-c", script]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout == "\n"


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        (["value.inputs.bearing=[[-1,1e-20],[1,1]]"], "a width above 1.1e-19, so that log μ fits"),
        (
            ["value.width=variance", "value.inputs.bearing=[[-1,1e-40],[1,1]]"],
            "a width above 1.2e-38, so that",
        ),
        (["value.inputs.bearing=[{bell: [0,1e-20,2]}]"], "a width above 1.1e-19, so that log μ"),
        (["value.inputs.bearing=[[0,1e-46]]"], "width > 0"),
        (["alpha=1e39"], "also when rounded to float32"),
        (["exploration=boltzmann", "temperature=1e-46"], "(0, inf), also when rounded to float32"),
        (["kappa=1.00000001"], "(1, inf), also when rounded to float32"),
        (["env.circle_radius_m=1e-46"], "(0, inf), also when rounded to float32"),
    ],
)
def test_ranges_are_those_of_the_dtype_that_computes(overrides, said):
    with pytest.raises(OutOfRange, match=re.escape(said)):
        load_config(*overrides)
    load_config(*overrides, "machine.dtype=float64")


@pytest.mark.parametrize(("dtype", "narrow"), [("float32", 1e-30), ("float64", 1e-200)])
def test_the_narrowest_label_allowed_has_finite_memberships(dtype, narrow):
    config = load_config(f"machine.dtype={dtype}")
    with pytest.raises(OutOfRange) as refused:
        load_config(f"machine.dtype={dtype}", f"value.inputs.bearing=[[-1,{narrow}],[1,1]]")
    least = float(re.search(r"above (\S+),", str(refused.value)).group(1))
    kind = getattr(torch, dtype)
    low, high = config.env.observations["bearing"]
    ends = torch.tensor([low, high], dtype=kind)
    for width, finite in ((1.1 * least, True), (0.4 * least, False)):
        centres, inverse = (torch.tensor(of, dtype=kind) for of in ([-1, 1], [1 / width] * 2))
        logs = log_membership(ends, centres, inverse)
        assert logs.isfinite().all() == finite
