"""The simulated noisy operator of the study, who made ``conf/rules/operator.csv``."""

import torch
from torch import Tensor

from envs.core.world import WorldConfig
from envs.worlds import make_world

EPISODES = 10
GAIN = 2.0
NOISE_STD = 0.3
CARELESS = 0.2
SEED = 0


def demonstrate(world: WorldConfig) -> Tensor:
    """Return the demonstrations of an operator who follows the ball in EPISODES situations.

    The operator steers by −GAIN times the bearing that the robot sees, plus a normal error of
    standard deviation NOISE_STD, clamped to ±1. With probability CARELESS, a step's action is
    uniform in [−1, 1] instead.

    Args:
        world: of kind ``follow_ball``.

    Returns:
        The bearing (rad) and the action of each step, ``[steps, 2]``, one situation after the
        other, rounded to three decimals.
    """
    env = make_world(world, [EPISODES], seed=0, dtype=torch.float64)
    generator = torch.Generator().manual_seed(SEED)
    seeds = torch.full((EPISODES, 1), SEED)
    state = env.start(seeds, torch.arange(EPISODES).unsqueeze(-1))
    goes_on = torch.ones(EPISODES, 1, dtype=torch.bool)
    rows: list[list[Tensor]] = [[] for _ in range(EPISODES)]
    for _ in range(world.time_limit_steps):
        bearing = state["bearing"]
        error = torch.randn(EPISODES, 1, generator=generator, dtype=torch.float64)
        anything = 2 * torch.rand(EPISODES, 1, generator=generator, dtype=torch.float64) - 1
        careless = torch.rand(EPISODES, 1, generator=generator, dtype=torch.float64) < CARELESS
        steered = (-GAIN * bearing + NOISE_STD * error).clamp(-1, 1)
        action = torch.where(careless, anything, steered)
        for episode in goes_on.squeeze(-1).nonzero().flatten().tolist():
            rows[episode].append(torch.cat([bearing[episode], action[episode]]))
        after = env.step(state.set("action", action))["next"]
        goes_on = goes_on & ~after["done"]
        state = after.select(*state.keys(), strict=False)
    return torch.stack([row for episode in rows for row in episode]).round(decimals=3)
