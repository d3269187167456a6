"""IR-SIM with a lidar, in an environment of its own: one world, random actions, no display.

python irsim_lidar.py SCENE SECONDS        prints the world steps a second

The robot is a differential drive, and its lidar has as many rays as ours has sonars.
"""

import sys
import tempfile
import time
from pathlib import Path

import irsim
import numpy as np
import yaml

# Rays, walls, discs, boxes and balls.
SCENES = {
    "follow": (0, 0, 0, 0, 1),
    "obstacles": (8, 4, 3, 0, 1),
    "full": (8, 4, 7, 3, 3),
}


def world_of(scene):
    rays, walls, discs, boxes, balls = SCENES[scene]
    lidar = {"name": "lidar2d", "range_min": 0, "range_max": 5, "angle_range": 6.28, "number": rays}
    robot = {
        "kinematics": {"name": "diff"},
        "shape": {"name": "circle", "radius": 0.25},
        "state": [3, 3, 0],
        "sensors": [lidar] if rays else [],
    }
    corners = [[0, 0], [6, 0], [6, 6], [0, 6], [0, 0]]
    obstacles = [
        {"shape": {"name": "linestring", "vertices": corners[side : side + 2]}, "state": [0, 0, 0]}
        for side in range(walls)
    ]
    rng = np.random.default_rng(0)
    # At the edges, since the robot starts in the middle.
    places = rng.uniform((0.6, 0.6), (5.4, 1.6), (discs + boxes + balls, 2)).tolist()
    shapes = [{"name": "circle", "radius": 0.3}] * discs
    shapes += [{"name": "rectangle", "length": 0.5, "width": 0.2}] * boxes
    obstacles += [
        {"shape": shape, "state": [*place, 0]} for shape, place in zip(shapes, places, strict=False)
    ]
    obstacles += [
        {
            "kinematics": {"name": "omni"},
            "shape": {"name": "circle", "radius": 0.1},
            "state": [*place, 0],
            "velocity": [0.1, 0.1],
            "vel_max": [0.2, 0.2],
        }
        for place in places[len(shapes) :]
    ]
    world = {"width": 6, "height": 6, "step_time": 0.1, "collision_mode": "stop"}
    return {"world": world, "robot": [robot], "obstacle": obstacles}


def main(scene, seconds):
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "world.yaml"
        path.write_text(yaml.safe_dump(world_of(scene)))
        env = irsim.make(str(path), headless=True, log_level="ERROR")
        rng = np.random.default_rng(0)
        steps, began = 0, time.perf_counter()
        while (took := time.perf_counter() - began) < seconds:
            env.step(rng.uniform((0.1, -1), (0.3, 1))[:, None])
            if SCENES[scene][0]:
                env.get_lidar_scan()
            steps += 1
        env.end(0)
    print(f"world steps/s: {steps / took:.6g}")


main(sys.argv[1], float(sys.argv[2]))
