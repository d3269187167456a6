"""Scenes in the native loop: the same history as in the eager loop, and every task compiles."""

import pytest
import torch

from fnnq_torchrl.config.choices import choices_of
from fnnq_torchrl.engine import choice
from fnnq_torchrl.engine.loops import EagerLoop
from fnnq_torchrl.engine.native import NativeLoop
from fnnq_torchrl.training.trainer import Trainer
from tests.compositions import config_of
from tests.programs import make_learner, make_runs

pytestmark = pytest.mark.usefixtures("compiler")

# A scene with every kind of object, small enough to be compiled in seconds.
SMALL = (
    "env.field_size_m=[2,2]",
    "env.clearance_m=0.05",
    "env.obstacles=[{shape: disc, number: 1, centre_m: [[0.5, 0.8], [-0.8, 0.8]], radius_m: 0.1}, "
    "{shape: box, number: 1, centre_m: [-0.7, 0], size_m: [0.1, 0.4], heading_rad: 0.2}]",
    "env.balls=[{kind: ball, radius_m: 0.1, paths: [{path: line, start_m: [0.6, [-0.5, 0.5]], "
    "direction_rad: [-1, 1], speed_mps: 0.3}]}]",
    "env.sensors.sonar.ring=[[0.1, 0, 0]]",
    "env.sensors.sonar.groups={sonar_left_m: [0], sonar_front_m: [0], sonar_right_m: [0]}",
    "env.sensors.sonar.sees_balls=true",
    "env.sensors.sonar.max_incidence_deg=40",
    "value/labels@value=follow",
    "action.candidates=3",
)


@pytest.mark.long
def test_a_scene_compiles_and_has_the_same_history() -> None:
    config = config_of("task=follow_obstacles", *SMALL, "machine.dtype=float64")
    run = make_runs(config, 32)
    start = make_learner(config, run).begin(run)

    def step(lanes: int):
        return make_learner(config, run[:lanes]).step

    states = []
    for kind in (EagerLoop, NativeLoop):
        running = kind(step, run, start.clone())(run.clone(), start.clone())
        with torch.no_grad():
            running.advance(25)
        states.append(running.state["world"])
    assert (states[0]["episode"] > 0).any()
    for key, value in states[0].items():
        torch.testing.assert_close(states[1][key], value, msg=key)


@pytest.mark.long
@pytest.mark.parametrize("task", choices_of("task"))
def test_every_task_learns_and_is_tested_natively(
    task: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """TorchInductor, which compiles steps that the native compiler can't, isn't needed."""
    monkeypatch.setattr(choice, "_inductor_loop", None)
    config = config_of(f"task={task}", "engine=compiled", "situations=5", "num_seeds=2")
    trainer = Trainer.of(config)
    trainer.learn()
    outcome = trainer.evaluate()
    assert outcome.steps[:, -1].min() >= 5
    assert outcome.lengths.min() >= 1
