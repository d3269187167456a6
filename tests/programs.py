"""Small programs and their runs, for the tests to step through."""

from functools import cache

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.learning_step import Program
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.schema import PER_RUN, Config
from fnnq_torchrl.engine.lanes import LANES, Values, repeat_last
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import StepSize
from fnnq_torchrl.launch.composition import load_config

SMALL_WORLD = ("env.circle_radius_m=0.5", "env.time_limit_steps=14")
"""Every situation is over after 10 to 14 steps, some by a catch and some by a miss."""


def make_runs(config: Config, count: int, **columns: float | Tensor) -> TensorDict:
    """Runs of different seeds with the configuration's values, or the given ones, ``[count]``."""
    whole = {"seed": torch.arange(count), "situations": config.situations}
    values = {key: getattr(config, key) for key in PER_RUN} | whole
    dtype = getattr(torch, config.machine.dtype)
    tensors = {}
    for key, value in (values | columns).items():
        column = torch.as_tensor(value, dtype=torch.int64 if key in whole else dtype)
        tensors[key] = column.expand(count).unsqueeze(-1).clone()
    return TensorDict(tensors, batch_size=[count])


def in_lanes(runs: Values) -> Values:
    """The same runs, the last repeated, on as few whole lanes as will do."""
    return repeat_last(runs, -(-len(runs) // LANES) * LANES)


def make_program(
    config: Config, run: TensorDictBase, network: ValueNetwork | None = None
) -> Program:
    """A program of the follow-the-ball world for these runs, by default on the fuzzy network."""
    dtype = getattr(torch, config.machine.dtype)
    candidates = torch.linspace(-1, 1, config.action.candidates, dtype=dtype)
    return Program(
        FollowBall(config.env, [len(run)], dtype=dtype),
        network or make_value_network(config.value, candidates, len(run)),
        rule=Rule(config.variant, config.trace, config.window),
        step_size=StepSize(config.step_size),
        exploration=config.exploration,
        evaluate_every=config.evaluation.every,
        largest_value=config.diverged_beyond * config.env.largest_return,
    )


@torch.no_grad()
def advance(program: Program, run: TensorDictBase, steps: int) -> TensorDict:
    """The state after so many steps."""
    state = program.begin(run)
    for _ in range(steps):
        state = program.step(run, state)
    return state


@cache
def config(*overrides: str) -> Config:
    """The default configuration in the small world."""
    return load_config(*SMALL_WORLD, *overrides)
