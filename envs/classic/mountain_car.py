"""Mountain Car: a weak car must swing back and forth to get out of a valley."""

import torch
from torch import Tensor

from envs.classic.schemas import MountainCarConfig
from envs.core import streams
from envs.core.pure import Entries, PureEnv
from envs.core.streams import Stream


class MountainCar(PureEnv):
    """Mountain Car: R. S. Sutton, A. G. Barto, "Reinforcement learning", 2018, example 10.1.

        v ← v + force·(action − 1) − gravity·cos 3x,  x ← x + v

    x and v are clipped to their ranges. At the lowest x, the car stops. Actions are 0 (reverse), 1
    (neutral) and 2 (forward); a number in between is a weaker force. The reward is −1 a step. The
    task ends at the goal.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/mountain_car.yaml``.
    """

    schema = MountainCarConfig
    world: MountainCarConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        low, high = self.world.start_position
        position = low + (high - low) * streams.uniform(words[0], self.dtype)
        chance = streams.uniform(words[1], self.dtype)
        return {"position": position, "velocity": torch.zeros_like(position), "chance": chance}

    def transition(self, state: Entries, action: Tensor) -> Entries:
        world = self.world
        velocity = (
            state["velocity"]
            + (action - 1) * world.force
            - torch.cos(3 * state["position"]) * world.gravity
        )
        velocity = velocity.clamp(-world.highest_speed, world.highest_speed)
        position = state["position"] + velocity
        position = position.clamp(world.lowest_position, world.highest_position)
        at_wall = (position <= world.lowest_position) & (velocity < 0)
        arrived = position >= world.goal_position
        return {
            "position": position,
            "velocity": velocity.masked_fill(at_wall, 0),
            "reward": torch.full_like(position, -1),
            "terminated": arrived,
            "success": arrived,
        }
