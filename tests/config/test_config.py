"""The schema, the values under ``conf/``, and what they make together."""

import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from hydra import initialize_config_dir, version
from hydra.core.global_hydra import GlobalHydra
from hydra.core.utils import JobRuntime
from omegaconf import OmegaConf

from envs.core.parameters import allowed
from fnnq_torchrl.agent.values import NETWORKS
from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import (
    PER_RUN,
    Config,
    ConfigError,
    UnknownKey,
    ranges_of,
    run_columns,
    to_config,
)
from fnnq_torchrl.config.values import SCHEMAS
from fnnq_torchrl.launch.composition import load_config

CONF = config_directory()
FILES = {path.relative_to(CONF) for path in CONF.rglob("*") if path.is_file()}
# Experiments are added to a configuration, the other groups have one choice each in it.
CHOICES = {
    path: f"{'+' * (path.parent.name == 'experiment')}{path.parent}={path.stem}"
    for path in sorted(FILES - {Path("config.yaml")})
}

EVERY_LOGGER = "logger=[csv,wandb,tensorboard,mlflow]"
NONSENSE = "non/sense " * 30
"""Too long and too odd even for a name."""


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
        "gamma": 0.95,
        "exploration": "epsilon_greedy",
        "epsilon": 0.1,
        "temperature": 0.01,
        "noise_std": 0.3,
        "variant": "peng",
        "trace": "output",
        "window": 10,
        "engine": "auto",
        "diverged_beyond": 100,
        "situations": 200,
        "resume": "auto",
        "checkpoint": {"every_s": 300, "snapshots": False},
        "env": {
            "time_step_s": 0.1,
            "speed_mps": 0.3,
            "track_width_m": 0.321,
            "circle_radius_m": 1.5,
            "start_angle_rad": 0.9,
            "start_side": "both",
            "switch_side_after": 0,
            "ball_speed_min_radps": 0.05,
            "ball_speed_max_radps": 0.15,
            "catch_distance_m": 0.2,
            "time_limit_steps": 120,
            "bearing_noise_rad": 0.01,
            "field_of_view_rad": 1.0,
            "other_view_rad": 1.0,
            "catch_reward": 1.0,
            "miss_reward": -0.5,
        },
        "value": {
            "kind": "fnnq",
            "inputs": {"bearing": [[-0.5, 0.4], [-0.1, 0.1], [0, 0.05], [0.1, 0.1], [0.5, 0.4]]},
            "action": [[-1, 0.4], [-0.4, 0.3], [0.4, 0.3], [1, 0.4]],
            "width": "sigma",
        },
        "action": {"candidates": 21},
        "evaluation": {
            "every": 5,
            "situations": [[0.8, 0.1], [-0.8, -0.1], [0.4, -0.15], [-0.4, 0.15], [0, 0.12]],
        },
        "machine": {"device": "cpu", "dtype": "float32"},
        "logger": {"wandb": None, "tensorboard": None, "mlflow": None},
    }


@pytest.mark.parametrize("choice", CHOICES.values())
def test_every_shipped_yaml_composes(choice):
    load_config(choice)


def test_every_shipped_file_is_yaml():
    assert {path.suffix for path in FILES} == {".yaml"}


def test_overrides_reach_their_keys():
    config = load_config("lam=1", "env.speed_mps=0.5", "value.inputs.bearing=[[0,1]]")
    assert (config.lam, config.env.speed_mps) == (1, 0.5)
    assert config.value.inputs == {"bearing": [[0, 1]]}


@pytest.mark.parametrize(
    ("kind", "key"),
    [
        *(("fnnq", key) for key in allowed(Config)),
        *((kind, key) for kind in SCHEMAS for key in allowed(SCHEMAS[kind], "value.")),
    ],
)
def test_every_key_has_a_type_and_a_range(kind, key):
    values = OmegaConf.create(asdict(load_config(f"value={kind}", EVERY_LOGGER)))
    OmegaConf.update(values, key, NONSENSE)
    with pytest.raises(ConfigError) as refused:
        to_config(values)
    assert str(refused.value) == f"{key}={NONSENSE}: must be {ranges_of(kind)[key]}"


def test_a_value_function_has_a_file_of_values_a_schema_and_a_network():
    assert NETWORKS.keys() == SCHEMAS.keys()
    for kind in SCHEMAS:
        assert load_config(f"value={kind}").value.kind == kind
        assert NETWORKS[kind].schema is SCHEMAS[kind]


@pytest.mark.parametrize(
    ("override", "line"),
    [
        (
            "env.ball_speed_min_radps=0.2",
            "env.ball_speed_min_radps=0.2: must be at most ball_speed_max_radps=0.15",
        ),
        (
            "env.switch_side_after=5",
            "env.switch_side_after=5: must be 0 with start_side=both",
        ),
        (
            "+value.inputs.sonar=[[0,1]]",
            "value.inputs.sonar=[[0, 1]]: must be under the name of one of: bearing",
        ),
        ("~value.inputs.bearing", "value.inputs={}: must be labels for at least one of: bearing"),
        (
            "value.action=[[0,0]]",
            "value.action=[[0, 0]]: must be a list of at least one pair [centre, width] "
            "with width > 0",
        ),
        (
            "evaluation.situations=[]",
            "evaluation.situations=[]: must be a list of at least one pair [angle, speed]",
        ),
        ("evaluation.every=0", "evaluation.every=0: must be a whole number >= 1"),
        ("evaluation.every=3", "situations=200: must be a whole multiple of evaluation.every=3"),
        ("situations=0", "situations=0: must be a whole number >= 1"),
        (
            "step_size=foo",
            "step_size=foo: must be alpha_bound or constant or decay or obgd",
        ),
        ("step_siz=obgd", "step_siz=obgd: there is no step_siz; did you mean step_size?"),
        ("kappa=1", "kappa=1.0: must be a number in (1, inf)"),
        ("action.candidates=1", "action.candidates=1: must be a whole number >= 2"),
        ("machine.device=tpu", "machine.device=tpu: must be cpu, cuda or cuda:N"),
        ("~lam", "lam=???: must be a number in [0, 1]"),
        ("lam=${nowhere}", "lam: Interpolation key 'nowhere' not found"),
        ("lam=[", "lam=[: can't be read as key=value"),
        ("speed_mps=1", "speed_mps=1: there is no speed_mps; did you mean env.speed_mps?"),
        ("logger=nope", "logger=nope: must be csv or mlflow or tensorboard or wandb"),
        ("logger=[csv,nope]", "logger=nope: must be csv or mlflow or tensorboard or wandb"),
        (
            "logger.wandb.per=run",
            "logger.wandb.per=run: wandb isn't chosen; 'logger=[csv,wandb]' does that",
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
        load_config(override)
    assert str(refused.value) == line


@pytest.mark.parametrize(
    "given", [("step_size=obgd", "alpha=0.1"), ("alpha=0.1", "step_size=obgd")]
)
def test_a_step_size_brings_its_values_and_yields_to_the_users(given):
    config = load_config(*given)
    assert (config.step_size, config.alpha, config.alpha_decay) == ("obgd", 0.1, 1)
    assert load_config("step_size=obgd").alpha == 1


def test_a_constant_does_not_decay():
    assert load_config("step_size=constant", "alpha_decay=1").alpha_decay == 1
    with pytest.raises(
        ConfigError, match=r"^alpha_decay=0\.9: must be 1 where step_size=constant$"
    ):
        load_config("step_size=constant", "alpha_decay=0.9")


def test_the_last_seed_fits_63_bits(default):
    assert run_columns(load_config(f"seed={2**63 - 2}", "num_seeds=2"))["seed"][-1] == 2**63 - 1
    with pytest.raises(ConfigError, match=f"^seed={2**63 - 1}: must be at most {2**63 - 2}"):
        replace(default, seed=2**63 - 1, num_seeds=2)


def test_a_config_is_checked_when_it_is_made(default):
    with pytest.raises(ConfigError, match=r"^lam=1\.5: must be"):
        replace(default, lam=1.5)


def test_the_columns_of_the_runs(default):
    columns = run_columns(replace(default, seed=3, num_seeds=4))
    assert tuple(columns) == PER_RUN
    assert columns.pop("seed") == [3, 4, 5, 6]
    assert columns == {key: [getattr(default, key)] * 4 for key in columns}


def test_a_saved_configuration_comes_back(default):
    assert to_config(OmegaConf.create(asdict(default))) == default


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
