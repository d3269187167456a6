"""The test of the learned weights: greedy play (ε = 0) without learning."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.core.pure import PureEnv
from envs.core.world import WorldConfig
from envs.worlds import make_world
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.engine.choice import Engine
from fnnq_torchrl.engine.loops import Step

FIRST_EPISODE = 2**32
"""The number of the first episode of an evaluation; it selects the episode's random numbers.

Episodes of learning have smaller numbers, so an evaluation never repeats their random numbers.
"""


def world_of_tests(config: Config) -> WorldConfig:
    """Return the world in which a job's evaluations play.

    In a world that changes while the runs learn, an evaluation after at least as many situations
    as the change plays in the changed world.
    """
    every, tests = config.evaluation.every, config.evaluation.tests
    return config.env.tested_from(
        lambda situations: FIRST_EPISODE + math.ceil(situations / every) * tests
    )


@dataclass(frozen=True)
class GreedyTest:
    """The world, the value network and the starting situations of an evaluation.

    Attributes:
        world: the configuration of the world.
        network: the value network; the weights of each snapshot are used in place of its own.
        situations: the fixed starts, ``[tests, values]``, or the number of random starts.
    """

    world: WorldConfig
    network: ValueNetwork
    situations: Tensor | int

    @property
    def tests(self) -> int:
        """The number of situations."""
        return self.situations if isinstance(self.situations, int) else len(self.situations)

    def make_env(self, lanes: int) -> PureEnv:
        """Make the world for a batch of ``lanes`` episodes."""
        like = self.network.candidates
        return make_world(self.world, [lanes], seed=0, dtype=like.dtype, device=like.device)

    def starts(self, number: Tensor) -> Tensor | None:
        """Return the fixed starts with these indices, ``[lanes, values]``, or None if random."""
        return None if isinstance(self.situations, int) else self.situations[number]

    def make_step(self, lanes: int) -> Step:
        """Make the function that plays one step of ``lanes`` episodes."""
        env, policy = self.make_env(lanes), EpsilonGreedyPolicy(self.network, epsilon=0.0)

        def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
            world = act(policy, stays["weights"], stays["epsilon"], state["world"])
            after = env.next_state(world)
            goes_on = ~state["over"]
            return TensorDict(
                {
                    "world": after.select(*state["world"].keys()),
                    "over": state["over"] | after["done"],
                    "success": state["success"] | (after["success"] & goes_on),
                    "return": state["return"] + torch.where(goes_on, after["reward"], 0),
                    "length": state["length"] + goes_on,
                },
                state.batch_size,
                device=state.device,
            )

        return step


def no_results(evaluations: int, runs: int, tests: int, dtype: torch.dtype) -> TensorDict:
    """Return the empty results of a test that has not been played yet.

    Returns:
        Batch size ``[evaluations, runs, tests]``: ``played`` and ``success`` (bool), ``return``
        (``dtype``) and ``length`` (int32), on the CPU.
    """
    shape = (evaluations, runs, tests)
    return TensorDict(
        {
            "played": torch.zeros(shape, dtype=torch.bool),
            "success": torch.zeros(shape, dtype=torch.bool),
            "return": torch.zeros(shape, dtype=dtype),
            "length": torch.zeros(shape, dtype=torch.int32),
        },
        shape,
    )


class Playing:
    """A scheduler's task that plays a test: each situation of each weight snapshot is a job.

    Each run has its own random numbers, and different ones in each evaluation.

    Args:
        test: the test to play.
        seed: the seed of each run, int64 ``[runs, 1]``.
        weights: the weight snapshots, by parameter name, batch size ``[evaluations, runs]``.
        results: the results so far, as from :func:`no_results`; updated in place.
        engine: the engine that makes the loop of steps.
        lanes: the number of situations that are played side by side.
        recipe: the recipe of a step (:class:`fnnq_torchrl.engine.loops.MakeLoop`).
        on_progress: called with the number of situations played so far, over all snapshots.
    """

    def __init__(
        self,
        test: GreedyTest,
        *,
        seed: Tensor,
        weights: TensorDictBase,
        results: TensorDictBase,
        engine: Engine,
        lanes: int,
        recipe: str | None = None,
        on_progress: Callable[[int], None] = lambda done: None,
    ) -> None:
        self._test, self._seed = test, seed
        self._weights = weights.view(-1)
        self._results = results.view(-1)
        self._done, self._on_progress = int(results["played"].sum()), on_progress
        self._env = test.make_env(lanes)
        self.steps = test.world.time_limit_steps
        example = self.begin(torch.zeros(lanes, dtype=torch.int64))
        self.loop = engine.make_loop(test.make_step, *example, recipe)

    @property
    def jobs(self) -> Tensor:
        """The job numbers of the situations not played yet, int64 ``[jobs]``."""
        return (~self._results["played"]).nonzero().squeeze(-1)

    def begin(self, jobs: Tensor) -> tuple[TensorDict, TensorDict]:
        jobs = jobs.to(self._seed.device)
        tests, runs = self._test.tests, len(self._seed)
        snapshot, situation = jobs // tests, jobs % tests
        evaluation, run = snapshot // runs, snapshot % runs
        episode = FIRST_EPISODE + (evaluation * tests + situation).unsqueeze(-1)
        world = self._env.start(self._seed[run], episode, self._test.starts(situation))
        batch = {"batch_size": jobs.shape, "device": jobs.device}
        never = torch.zeros_like(world["chance"])
        no = torch.zeros_like(never, dtype=torch.bool)
        stays = TensorDict({"weights": self._weights[snapshot], "epsilon": never}, **batch)
        state = {
            "world": world,
            "over": no,
            "success": no.clone(),
            "return": never.clone(),
            "length": torch.zeros_like(never, dtype=torch.int32),
        }
        return stays, TensorDict(state, **batch)

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        over = state["over"].squeeze(-1).cpu()
        lanes = ((jobs >= 0) & over).nonzero().squeeze(-1)
        ended = jobs[lanes]
        for key in ("success", "return", "length"):
            self._results[key][ended] = state[key].squeeze(-1).cpu()[lanes]
        self._results["played"][ended] = True
        self._done += len(lanes)
        self._on_progress(self._done)
        return over
