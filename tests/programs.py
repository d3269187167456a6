"""Small learners and runs for the tests."""

from functools import cache
from pathlib import Path

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.worlds import make_world
from fnnq_torchrl.agent.adaptive import Adaptive
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.learning_step import Learner
from fnnq_torchrl.agent.parts import make_rule, make_step_size
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.schema import PER_RUN, Config
from fnnq_torchrl.engine.lanes import LANES, Values, repeat_last
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.resume.saved import SavedTraining

from .compositions import config_of

SMALL_WORLD = ("env.circle_radius_m=0.5", "env.time_limit_steps=14")
"""Overrides for a world whose situations end after 10 to 14 steps, in a catch or a miss."""


def make_runs(config: Config, count: int, **columns: float | Tensor) -> TensorDict:
    """Return runs of different seeds, ``[count]``; ``columns`` override the configuration."""
    whole = {"seed": torch.arange(count), "situations": config.situations}
    values = {key: config.of_run(key) for key in PER_RUN} | whole
    dtype = getattr(torch, config.machine.dtype)
    tensors = {}
    for key, value in (values | columns).items():
        column = torch.as_tensor(value, dtype=torch.int64 if key in whole else dtype)
        tensors[key] = column.expand(count).unsqueeze(-1).clone()
    return TensorDict(tensors, batch_size=[count])


def in_lanes(runs: Values) -> Values:
    """Return the runs with the last one repeated, so that they fill whole lanes."""
    return repeat_last(runs, -(-len(runs) // LANES) * LANES)


def make_learner(
    config: Config, run: TensorDictBase, network: ValueNetwork | None = None
) -> Learner:
    """Return a learner for these runs, by default with the configuration's network."""
    dtype = getattr(torch, config.machine.dtype)
    candidates = make_candidates(config, dtype)
    return Learner(
        make_world(config.env, [len(run)], seed=0, dtype=dtype),
        network or make_value_network(config.value, candidates, len(run)),
        rule=make_rule(config),
        step_size=make_step_size(config),
        exploration=config.exploration,
        evaluate_every=config.evaluation.every,
        largest_value=config.largest_value,
        scale_rewards=config.scale_rewards,
        adaptive=Adaptive.of(config),
    )


def saved_training(directory: Path, config: Config) -> SavedTraining:
    """Return the saved training of a job in a directory."""
    return SavedTraining(Batch([Job(config, directory)]))


@torch.no_grad()
def advance(learner: Learner, run: TensorDictBase, steps: int) -> TensorDict:
    """Return the state after the given number of steps."""
    state = learner.begin(run)
    for _ in range(steps):
        state = learner.step(run, state)
    return state


@cache
def config(*overrides: str) -> Config:
    """Return the default configuration in the small world."""
    return config_of(*SMALL_WORLD, *overrides)
