"""Steps with the same recipe have the same program; other steps have another recipe."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.engine.choice import Engine
from fnnq_torchrl.engine.native import translation
from fnnq_torchrl.engine.native.translation import source
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.recipe import recipe
from fnnq_torchrl.training.trainer import Trainer

BASE = ("value=table", "situations=10", "evaluation.situations=2", "alpha_decay=0.9")

# A change of every key that is no part of a step.
OTHERS = {
    "lam": 0.7,
    "seed": 5,
    "num_seeds": 3,
    "alpha": 0.03,
    "alpha_decay": 0.8,
    "kappa": 3.0,
    "meta_step_size": 0.5,
    "tau": 7.0,
    "eta": 0.6,
    "eta_min": 0.01,
    "eta_decay": 0.5,
    "gamma": 0.5,
    "epsilon": 0.3,
    "temperature": 0.2,
    "noise_std": 0.1,
    "adaptive_rate": 0.1,
    "adaptive_period": 3.0,
    "adaptive_short": 20.0,
    "adaptive_long": 30.0,
    "engine": "compiled",
    "situations": 20,
    "resume": "never",
}


def changed(config: Config) -> Config:
    return replace(
        config,
        **OTHERS,
        evaluation=replace(config.evaluation, situations=4),
        checkpoint=replace(config.checkpoint, every_s=7.0, snapshots=True),
    )


class Found(Exception):
    """The recipe and the program of a step; it ends the work before the first step."""


def find(make_step, stays, state, text=None):
    two = torch.arange(2) % len(state)
    raise Found(text, source(make_step(2), stays[two], state[two]))


def recipes_and_programs(config: Config) -> list[tuple[str, str]]:
    """Return the recipe and the program of a job's learning step and of its test's step."""
    trainer = Trainer.of(config)
    trainer.engine = Engine("eager", "", find, workers=1, most_lanes=32)
    found = []
    for work in (trainer.learn, trainer.evaluate):
        with pytest.raises(Found) as end:
            work()
        found.append(end.value.args)
    return found


def test_what_is_no_part_of_a_step_changes_neither_recipe_nor_program() -> None:
    config = load_config(*BASE)
    before, after = recipes_and_programs(config), recipes_and_programs(changed(config))
    assert before == after
    assert before[0] != before[1]


@pytest.mark.parametrize(
    "override",
    [
        "variant=watkins",
        "trace=gradient",
        "window=3",
        "exploration=boltzmann",
        "diverged_beyond=7",
        "step_size=obgd",
        "adaptive=doya",
        "evaluation.every=10",
        "action.candidates=5",
        "machine.dtype=float64",
        "env.time_limit_steps=9",
        "env.speed_mps=0.1",
        "value=fnnq",
        "value=mlp",
        "rules.count_firing=true",
    ],
)
def test_what_is_part_of_a_step_changes_its_recipe(override: str) -> None:
    config, other = load_config("situations=10"), load_config("situations=10", override)
    if config == other:
        config = load_config("situations=10", "value=rbf")
    for step in ("learn", "test"):
        assert recipe(config, step) != recipe(other, step)


def test_what_a_configuration_has_computed_is_no_part_of_a_recipe() -> None:
    config = load_config("task=follow_obstacles")
    before = recipe(config, "learn")
    assert config.env.obstacle_entries
    assert config.env.ball_entries
    assert recipe(config, "learn") == before


def test_prior_knowledge_is_part_of_a_step() -> None:
    config = load_config()
    assert len({recipe(config, "learn", prior) for prior in (None, "a", "b")}) == 3


@pytest.mark.parametrize("group", ["env", "value"])
def test_a_step_with_a_users_own_class_has_no_recipe(group: str) -> None:
    config = load_config()
    assert recipe(config, "learn") is not None
    getattr(config, group).kind = "my.module:Mine"
    assert recipe(config, "learn") is None


@pytest.mark.usefixtures("compiler")
def test_a_second_job_traces_nothing_and_learns_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        run_job(load_config(*BASE, "engine=compiled", "num_seeds=2"), tmp_path / name)
        monkeypatch.setattr(translation, "source", lambda *_: pytest.fail("traced again"))
    first, second = (tmp_path / name / "evaluations.csv" for name in ("first", "second"))
    assert first.read_bytes() == second.read_bytes()
