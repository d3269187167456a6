"""VMAS with a lidar, in an environment of its own: one robot, obstacles, balls, random actions.

python vmas_lidar.py SCENE WORLDS SECONDS        prints the world steps a second

The robot drives as a differential drive, and a lidar has as many rays as ours has sonars. No
episode ever ends here, so VMAS spends no time on starting new ones.
"""

import sys
import time

import torch
from vmas import make_env
from vmas.simulator.core import Agent, Box, Landmark, Line, Sphere, World
from vmas.simulator.dynamics.diff_drive import DiffDrive
from vmas.simulator.scenario import BaseScenario
from vmas.simulator.sensors import Lidar

# Rays, walls, discs, boxes and balls.
SCENES = {
    "follow": (0, 0, 0, 0, 1),
    "obstacles": (8, 4, 3, 0, 1),
    "full": (8, 4, 7, 3, 3),
}


class Scenario(BaseScenario):
    def make_world(self, batch_dim, device, *, scene, **settings):
        rays, walls, discs, boxes, balls = SCENES[scene]
        world = World(batch_dim, device, dt=0.1)
        sensors = [Lidar(world, n_rays=rays, max_range=5.0)] if rays else None
        robot = Agent(
            "robot",
            shape=Sphere(0.25),
            sensors=sensors,
            dynamics=DiffDrive(world, integration="euler"),
        )
        world.add_agent(robot)
        shapes = [Line(6.0)] * walls + [Sphere(0.3)] * discs + [Box(0.5, 0.2)] * boxes
        self.fixed = [
            Landmark(f"fixed {number}", shape=shape, collide=True)
            for number, shape in enumerate(shapes)
        ]
        self.walls = walls
        self.balls = [
            Landmark(f"ball {number}", shape=Sphere(0.1), collide=bool(rays), movable=True)
            for number in range(balls)
        ]
        for landmark in (*self.fixed, *self.balls):
            world.add_landmark(landmark)
        return world

    def reset_world_at(self, env_index=None):
        batch = self.world.batch_dim
        sides = [(0.0, 3.0, 0.0), (0.0, -3.0, 0.0), (3.0, 0.0, torch.pi / 2)]
        sides.append((-3.0, 0.0, torch.pi / 2))
        for number, landmark in enumerate((*self.fixed, *self.balls)):
            if number < self.walls:
                x, y, turn = sides[number]
                place = torch.tensor([[x, y]]).expand(batch, 2)
                landmark.set_rot(torch.full((batch, 1), turn), batch_index=env_index)
            else:
                place = torch.rand(batch, 2) * 4 - 2
            landmark.set_pos(place, batch_index=env_index)
        for ball in self.balls:
            ball.set_vel(torch.rand(batch, 2) * 0.4 - 0.2, batch_index=env_index)

    def observation(self, agent):
        seen = [agent.state.pos, agent.state.rot]
        return torch.cat(seen + [sensor.measure() for sensor in agent.sensors], dim=-1)

    def reward(self, agent):
        return torch.zeros(self.world.batch_dim)


def main(scene, worlds, seconds):
    env = make_env(Scenario(), num_envs=worlds, device="cpu", seed=0, scene=scene)
    for _ in range(3):
        env.step(env.get_random_actions())
    steps, began = 0, time.perf_counter()
    while (took := time.perf_counter() - began) < seconds or steps < 5:
        env.step(env.get_random_actions())
        steps += 1
    print(f"world steps/s: {worlds * steps / took:.6g}")


with torch.no_grad():
    main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3]))
