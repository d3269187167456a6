"""Measure worlds that robots drive through at random, beside VMAS and IR-SIM, and their learning.

python benchmarks/worlds.py [--quick] [--write docs/performance.md]

All programs take turns, since the machine's load varies. A world step is one step of one world: the
robot drives, the balls move, all sensors are read, and a situation that has ended starts again.
"""

import argparse
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from operator import methodcaller
from pathlib import Path

import torch
from machine import describe_machine
from ours import Learner
from page import write_worlds
from tables import ratio, spread, table
from tensordict import TensorDict, TensorDictBase
from watched import run_watched
from yardsticks import FOLDER, reason, version_of

from envs.core.world import WorldConfig
from envs.worlds import make_world
from fnnq_torchrl.engine.lanes import LANES, lanes_for
from fnnq_torchrl.engine.loops import Running, Step
from fnnq_torchrl.engine.native import NativeLoop
from fnnq_torchrl.launch.composition import load_config

WORLDS = [1, 110, 1104, 11008]

FULL = (
    "task=follow_obstacles",
    "env.clearance_m=0.05",
    "env.obstacles=["
    "{shape: disc, number: 7, centre_m: [[-2.5, 2.5], [-2.5, 2.5]], radius_m: [0.1, 0.3]}, "
    "{shape: box, number: 3, centre_m: [[-2.5, 2.5], [-2.5, 2.5]], size_m: [0.5, 0.2], "
    "heading_rad: [-3, 3]}]",
    "env.balls=["
    "{kind: ball, radius_m: 0.1, paths: [{path: circle, centre_m: [0, 0], radius_m: 1.5, "
    "angle_rad: [-3, 3], speed_radps: [-0.2, 0.2]}]}, "
    "{kind: ball, radius_m: 0.1, paths: [{path: line, start_m: [1, [-1, 1]], "
    "direction_rad: [-3, 3], speed_mps: [0.05, 0.2]}]}, "
    "{kind: goal, radius_m: 0.1, paths: [{path: waypoints, points_m: [[0, 2], [1, 2], [1, 1]], "
    "speed_mps: 0.3, closed: true}]}]",
    "env.sensors.sonar.sees_balls=true",
    "env.sensors.vision.kinds=[ball,goal]",
)
SCENES = {
    "follow": ("task=follow",),
    "obstacles": ("task=follow_obstacles",),
    "full": FULL,
}
"""The scenes, by their names in the yardsticks' programs, with our overrides."""

_IN_WORDS = {
    "follow": "`follow`",
    "obstacles": "`follow_obstacles`: 8 sonars, 3 obstacles, 4 walls",
    "full": "full: 8 sonars, 10 obstacles, 3 balls",
}

_LEARNING = {1: 800, 110: 200, 1104: 50, 11008: 10}
"""The situations that each run learns from, by the number of runs; fewer for many runs."""


@dataclass
class Scene:
    """The readings of one scene, in world steps a second, by the number of worlds."""

    name: str
    ours: dict[int, list[float]] = field(default_factory=dict)
    vmas: dict[int, list[float]] = field(default_factory=dict)
    irsim: list[float] = field(default_factory=list)


# -- ours -----------------------------------------------------------------------------------------


def make_step(config: WorldConfig) -> Callable[[int], Step]:
    """Return a function that makes a step in which every robot takes a random action.

    Every observation is added to ``read``, so that the compiler can't leave out a sensor.
    """

    def make(lanes: int) -> Step:
        env = make_world(config, [lanes], seed=0)
        low, high = config.actions

        def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
            world = state["world"]
            action = low + (high - low) * world["chance"]
            after = env.step(world.copy().set("action", action))["next"]
            read = sum(after[key] for key in env.seen) + after["reward"]
            return TensorDict(
                {
                    "world": env.restart(after),
                    "read": state["read"] + read,
                    "over": state["over"],
                },
                state.batch_size,
            )

        return step

    return make


def start(config: WorldConfig, lanes: int, worlds: int) -> tuple[TensorDict, TensorDict]:
    """Return ``stays`` and the first ``state`` of the step (:data:`.loops.Step`).

    As in training, the lanes after the given number of worlds repeat the last one, and are over.
    """
    numbers = torch.arange(lanes).unsqueeze(-1)
    seed = numbers.clamp(max=worlds - 1)
    world = make_world(config, [lanes], seed=0).start(seed, torch.zeros_like(seed))
    state = {"world": world, "read": torch.zeros(lanes, 1), "over": numbers >= worlds}
    return TensorDict({}, [lanes]), TensorDict(state, [lanes])


class Drivers:
    """Worlds of one scene, driven by as many threads as training would use."""

    def __init__(self, loop: NativeLoop, config: WorldConfig, worlds: int) -> None:
        self.worlds = worlds
        workers = torch.get_num_threads()
        lanes = lanes_for(worlds, workers, 2**11)
        parts = -(-worlds // lanes)
        self._parts: list[Running] = [
            loop(*start(config, lanes, worlds - part * lanes)) for part in range(parts)
        ]
        self._pool = ThreadPoolExecutor(workers)

    def rate(self, seconds: float) -> float:
        """Return the world steps a second, measured over at least so many seconds."""
        steps = 16
        while True:
            began = time.perf_counter()
            [*self._pool.map(methodcaller("advance", steps), self._parts)]
            took = time.perf_counter() - began
            if took >= seconds:
                return self.worlds * steps / took
            steps = 2 * steps if took < seconds / 8 else int(1.2 * steps * seconds / took) + 1


# -- yardsticks -----------------------------------------------------------------------------------


def rate_of(environment: str, script: str, *words: object) -> list[float]:
    """Run a yardstick's program; return its world steps a second, or [] if it fails."""
    python = FOLDER.parent / environment / "bin" / "python"
    try:
        finished = run_watched([str(python), str(FOLDER / script), *map(str, words)])
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"{script}: not measured, {reason(error)}", file=sys.stderr, flush=True)
        return []
    return [float(finished.output.rpartition("world steps/s: ")[2])]


def measure(sizes: Sequence[int], repetitions: int, seconds: float) -> list[Scene]:
    """Measure all scenes; in each repetition all programs take a turn."""
    scenes, ours = [Scene(name) for name in SCENES], []
    for scene in scenes:
        config = load_config(*SCENES[scene.name]).env
        print(f"compiling {scene.name}", file=sys.stderr, flush=True)
        loop = NativeLoop(make_step(config), *start(config, LANES, LANES))
        ours.append([Drivers(loop, config, worlds) for worlds in sizes])
    for repetition in range(repetitions):
        for scene, of_scene in zip(scenes, ours, strict=True):
            for drivers in of_scene:
                rate, size = drivers.rate(seconds), drivers.worlds
                scene.ours.setdefault(size, []).append(rate)
                scene.vmas.setdefault(size, []).extend(
                    rate_of(".vmas", "vmas_lidar.py", scene.name, size, seconds)
                )
                told = f"{scene.name}, {size:,} worlds: {rate:,.0f} world steps/s"
                print(f"{repetition + 1}/{repetitions}, {told}", file=sys.stderr, flush=True)
            scene.irsim += rate_of(".irsim", "irsim_lidar.py", scene.name, seconds)
    return scenes


def measure_learning(sizes: Sequence[int], repetitions: int) -> dict[int, list[float]]:
    """Return the learning steps a second of ``follow_obstacles``, by the number of runs."""
    rates: dict[int, list[float]] = {size: [] for size in sizes}
    with ExitStack() as processes:
        learners = {
            size: processes.enter_context(Learner(size, _LEARNING[size], "task=follow_obstacles"))
            for size in sizes
        }
        for _ in range(repetitions):
            for size, learner in learners.items():
                rates[size].append(1e6 * learner.learn().rate)
    return rates


# -- the page -------------------------------------------------------------------------------------


def thousands(rates: Sequence[float]) -> str:
    """Return the rates in thousands a second."""
    return spread([rate / 1e3 for rate in rates])


def world_table(scenes: Sequence[Scene]) -> str:
    """Return a table of the world steps a second, in thousands."""
    rows = [
        [
            _IN_WORDS[scene.name],
            f"{size:,}",
            thousands(scene.vmas[size]),
            thousands(ours),
            ratio(ours, scene.vmas[size]),
        ]
        for scene in scenes
        for size, ours in scene.ours.items()
    ]
    return table(["scene", "worlds", "VMAS", "ours", "ours/VMAS"], rows)


def single_table(scenes: Sequence[Scene]) -> str:
    """Return a table of a single world, in thousands of steps a second."""
    rows = [
        [
            _IN_WORDS[scene.name],
            thousands(scene.irsim),
            thousands(scene.ours[1]),
            ratio(scene.ours[1], scene.irsim),
        ]
        for scene in scenes
    ]
    return table(["scene, one world", "IR-SIM", "ours", "ours/IR-SIM"], rows)


def learning_table(rates: dict[int, list[float]]) -> str:
    """Return a table of the learning steps a second of ``follow_obstacles``, in thousands."""
    rows = [[f"{size:,}", f"{_LEARNING[size]:,}", thousands(of)] for size, of in rates.items()]
    return table(["runs", "situations", "learning steps/s"], rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a check: few worlds, once, no page")
    parser.add_argument("--repetitions", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each measurement, at least")
    parser.add_argument("--write", type=Path, help="page whose section on worlds is to be written")
    given = parser.parse_args()
    sizes, repetitions, seconds = WORLDS, given.repetitions, given.seconds
    if given.quick:
        sizes, repetitions, seconds = WORLDS[:2], 1, 0.2
    with torch.no_grad():
        scenes = measure(sizes, repetitions, seconds)
    learning = measure_learning(sizes, repetitions)
    sections = {
        "machine": describe_machine(),
        "repetitions": str(repetitions),
        "vmas": version_of("vmas"),
        "irsim": version_of("ir-sim"),
        "worlds": world_table(scenes),
        "single": single_table(scenes),
        "learning": learning_table(learning),
    }
    print("\n\n".join(sections.values()))
    if given.write and not given.quick:
        write_worlds(given.write, sections)


if __name__ == "__main__":
    main()
