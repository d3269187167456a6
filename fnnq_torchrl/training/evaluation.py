"""The test: the runs play situations of their world greedily (ε = 0), without learning."""

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
from fnnq_torchrl.engine.choice import Engine
from fnnq_torchrl.engine.loops import Step

FIRST_EPISODE = 2**32
"""The number of the first evaluated episode.

Learning never gets this far, so no evaluation has the random numbers of an episode of learning.
"""


@dataclass(frozen=True)
class GreedyTest:
    """The world that an evaluation plays in, and the policy that plays.

    Attributes:
        world: the one to play in.
        network: the value network, whose weights the snapshots replace.
        situations: fixed starts, ``[tests, values]``, or the number of random starts.
    """

    world: WorldConfig
    network: ValueNetwork
    situations: Tensor | int

    @property
    def tests(self) -> int:
        """The number of situations."""
        return self.situations if isinstance(self.situations, int) else len(self.situations)

    def make_env(self, lanes: int) -> PureEnv:
        """Make the world for this number of lanes."""
        like = self.network.candidates
        return make_world(self.world, [lanes], seed=0, dtype=like.dtype, device=like.device)

    def starts(self, number: Tensor) -> Tensor | None:
        """Return the fixed starts with these numbers, ``[lanes, values]``; None if random."""
        return None if isinstance(self.situations, int) else self.situations[number]

    def make_step(self, lanes: int) -> Step:
        """Make the step of playing for this number of lanes."""
        env, policy = self.make_env(lanes), EpsilonGreedyPolicy(self.network, epsilon=0.0)

        def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
            world = act(policy, stays["weights"], stays["epsilon"], state["world"])
            after = env.step(world)["next"]
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
    """Return the results of a test before it is played.

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
    """The :class:`.Task` of a test: each situation of each snapshot of weights is a job.

    Random numbers are the run's own, new ones for every evaluation.

    Args:
        test: the test to play.
        seed: the runs' seeds, int64 ``[runs, 1]``.
        weights: the snapshots, by the network's names, batch size ``[evaluations, runs]``.
        results: as :func:`no_results` makes them; kept up to date.
        engine: makes the loop.
        lanes: the number of situations that are played side by side.
        on_progress: called with the number of situations played so far, of all snapshots together.
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
        on_progress: Callable[[int], None] = lambda done: None,
    ) -> None:
        self._test, self._seed = test, seed
        self._weights = weights.view(-1)
        self._results = results.view(-1)
        self._done, self._on_progress = int(results["played"].sum()), on_progress
        self._env = test.make_env(lanes)
        self.steps = test.world.time_limit_steps
        example = self.begin(torch.zeros(lanes, dtype=torch.int64))
        self.loop = engine.make_loop(test.make_step, *example)

    @property
    def jobs(self) -> Tensor:
        """The numbers of the situations that aren't played yet, int64."""
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
