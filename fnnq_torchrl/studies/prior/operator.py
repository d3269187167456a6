"""The noisy operator of the study: conf/rules/operator.csv comes from here."""

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
    """Have the operator follow the ball in some situations of the world.

    The operator steers by −GAIN times the bearing that the robot sees, with a normal error of
    standard deviation NOISE_STD, cut off at ±1; with probability CARELESS by anything instead.

    Args:
        world: of kind ``follow_ball``.

    Returns:
        The bearings and the actions, ``[steps, 2]``, one situation after the other, to three
        decimals.
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
