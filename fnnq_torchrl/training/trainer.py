"""The trainer: lets all runs of one or more jobs learn side by side, then tests them."""

from collections.abc import Callable
from typing import Self

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict
from torch import Tensor

from envs.worlds import make_world
from fnnq_torchrl.agent.adaptive import Adaptive
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.learning_step import Learner
from fnnq_torchrl.agent.parts import make_rule, make_step_size
from fnnq_torchrl.agent.policy import policy_class
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.engine.choice import Engine, choose_engine
from fnnq_torchrl.engine.lanes import lanes_for, repeat_last
from fnnq_torchrl.engine.scheduler import Keeper, work_through
from fnnq_torchrl.training.evaluation import GreedyTest, Playing, world_of_tests
from fnnq_torchrl.training.learning import Learning
from fnnq_torchrl.training.recipe import recipe
from fnnq_torchrl.training.results import PARAMETERS, Outcome
from fnnq_torchrl.training.resume.ledger import Ledger
from fnnq_torchrl.training.start import Start, imported, read_start

OnProgress = Callable[[int], None]
"""A function called with the number of situations done so far, over all runs."""


class Trainer:
    """Trains many runs side by side: call :meth:`learn`, then :meth:`evaluate`.

    The engine steps a batch of lanes at once. A lane holds one run; when that run is done, another.

    Attributes:
        ledger: the progress so far.
        run: the values of each run, by the keys of `PER_RUN`, and ``situations``, the number to
            learn from; each ``[runs, 1]``.

    Args:
        config: a valid configuration.
        runs: the values in which the runs differ, of one job or of several.
        engine: the engine that runs the steps.
        start: the start of learning; the value network's own, if None.
    """

    def __init__(
        self, config: Config, runs: Runs, engine: Engine, start: Start | None = None
    ) -> None:
        self.config, self.engine, self._runs, self._start = config, engine, runs, start
        self.device = torch.device(config.machine.device)
        self.dtype: torch.dtype = getattr(torch, config.machine.dtype)
        columns = {
            key: torch.from_numpy(column).to(torch.int64 if key == "seed" else self.dtype)
            for key, column in runs.columns.items()
        }
        columns["situations"] = torch.full_like(columns["seed"], config.situations)
        batch = {key: column.unsqueeze(-1) for key, column in columns.items()}
        self.run = TensorDict(batch, [len(runs)], device=self.device)
        evaluations, tests = (
            config.situations // config.evaluation.every + 1,
            config.evaluation.tests,
        )
        self.situations_to_learn = len(runs) * config.situations
        self.situations_to_play = len(runs) * evaluations * tests
        weights = self._value_network(runs=1).start(self.run["seed"])
        self.ledger = Ledger(
            runs,
            weights,
            self._told_before_learning(),
            config.evaluation.every,
            evaluations,
            tests,
            count_firing=config.counts_firing,
        )

    @classmethod
    def of(cls, config: Config) -> Self:
        """Make the trainer of a single job.

        Raises:
            ConfigError: if the engine must compile, and there is no C++ compiler; or as in
                :func:`.read_start`.
        """
        config, runs = imported(config), Runs.of([config])
        return cls(config, runs, choose_engine(config, len(runs)), read_start(config))

    def _value_network(self, runs: int) -> ValueNetwork:
        candidates = make_candidates(self.config, self.dtype, self.device)
        network = make_value_network(self.config.value, candidates, runs)
        if self._start is not None:
            self._start.put_into(network)
        return network

    def make_learner(self, lanes: int) -> Learner:
        """Make the learning step for ``lanes`` runs."""
        config = self.config
        return Learner(
            make_world(config.env, [lanes], seed=0, dtype=self.dtype, device=self.device),
            self._value_network(lanes),
            rule=make_rule(config),
            step_size=make_step_size(config),
            exploration=config.exploration,
            evaluate_every=config.evaluation.every,
            largest_value=config.largest_value,
            learns=None if self._start is None else self._start.masks,
            count_firing=config.counts_firing,
            count_earned=config.evaluation.tests == 0,
            scale_rewards=config.scale_rewards,
            adaptive=Adaptive.of(config),
        )

    def _told_before_learning(self) -> dict[str, Tensor]:
        """Return the numbers that snapshots have, before learning, by name, each ``[runs, 1]``."""
        of_one = self.make_learner(lanes=1).begin(self.run[:1])["snapshot", "told"]
        runs = len(self.run)
        return {name: self.run.get(name, one.expand(runs, 1)) for name, one in of_one.items()}

    @torch.no_grad()
    def learn(
        self, on_progress: OnProgress = lambda done: None, keeper: Keeper | None = None
    ) -> None:
        """Step all runs until each has learned from all its situations or has diverged.

        Args:
            on_progress: called with the number of situations learned so far, over all runs.
            keeper: called between steps with the unfinished runs, to save them if a save is due.
        """
        engine, ledger = self.engine, self.ledger
        if int(ledger.learned.sum()) == self.situations_to_learn:
            return
        lanes = lanes_for(len(self._runs), engine.workers, engine.most_lanes)
        with engine.threads(lanes * self._candidates), ledger.timed("train"):
            learner = self.make_learner(lanes)
            with ledger.timed("compile"):
                example = repeat_last(self.run, lanes)
                loop = engine.make_loop(
                    lambda lanes: self.make_learner(lanes).step,
                    example,
                    learner.begin(example),
                    self._recipe("learn"),
                )
            learning = Learning(learner, loop, self.run, ledger, on_progress)
            work_through(learning, learning.jobs, lanes, engine.workers, keeper)

    @torch.no_grad()
    def evaluate(
        self, on_progress: OnProgress = lambda done: None, keeper: Keeper | None = None
    ) -> Outcome:
        """Test the weight snapshots of all runs, side by side, and return the outcome.

        Args:
            on_progress: called with the number of situations played so far, over all runs.
            keeper: as in :meth:`learn`.
        """
        engine, ledger = self.engine, self.ledger
        ledger.stop_where_not_finite()
        if not self.config.evaluation.tests:
            return self._outcome()
        # A test has no trace and only reads the weights, so twice as many lanes fit.
        lanes = lanes_for(self.situations_to_play, engine.workers, 2 * engine.most_lanes)
        with engine.threads(lanes * self._candidates), ledger.timed("evaluate"):
            with ledger.timed("compile"):
                playing = Playing(
                    self._test,
                    seed=self.run["seed"],
                    weights=ledger.book.pages["weights"],
                    results=ledger.results,
                    engine=engine,
                    lanes=lanes,
                    recipe=self._recipe("test"),
                    on_progress=on_progress,
                )
            work_through(playing, playing.jobs, lanes, engine.workers, keeper)
        return self._outcome()

    def _recipe(self, step: str) -> str | None:
        return recipe(self.config, step, None if self._start is None else self._start.digest)

    @property
    def _candidates(self) -> int:
        return self._value_network(runs=1).candidates.numel()

    @property
    def _test(self) -> GreedyTest:
        config, fixed = self.config, self.config.evaluation.fixed
        situations = (
            config.evaluation.tests
            if fixed is None
            else torch.tensor(fixed, dtype=self.dtype, device=self.device)
        )
        return GreedyTest(world_of_tests(config), self._value_network(runs=1), situations)

    def _outcome(self) -> Outcome:
        ledger, pages, config = self.ledger, self.ledger.book.pages, self.config
        # A diverged run isn't tested any more. It gets the lowest possible return or, if the
        # world doesn't state a lowest return, its own return before learning.
        diverged = ledger.diverged.T.contiguous().numpy()
        world = config.env.tested
        catches, returns, lengths = self._tested() if config.evaluation.tests else self._earned()
        lowest = returns[:, :1] if world.returns is None else world.returns[0]
        return Outcome(
            seed=self._runs["seed"],
            lam=self._runs["lam"],
            situations=np.arange(len(pages)) * config.evaluation.every,
            steps=pages["steps"].T.contiguous().cpu().numpy(),
            catches=catches,
            diverged=diverged,
            returns=np.where(diverged, lowest, returns),
            lengths=np.where(diverged, world.time_limit_steps, lengths),
            **self._parameters(),
            measure=world.measure,
            batch_runs=len(self._runs),
            batch_learning_steps=self.learning_steps,
            train_seconds=ledger.seconds["train"],
            compile_seconds=ledger.seconds["compile"],
            evaluate_seconds=ledger.seconds["evaluate"],
        )

    def _parameters(self) -> dict[str, NDArray[np.float64]]:
        """Return α, temperature and γ at each evaluation, each ``[runs, evaluations]``.

        The temperature is NaN for runs that explore in another way.
        """
        pages, found = self.ledger.book.pages, {}
        for key in PARAMETERS:
            if key in pages.keys():  # noqa: SIM118  # a TensorDict iterates over its rows
                found[key] = _shortest(pages[key].T.contiguous().cpu().numpy())
            else:
                amount = policy_class(self.config.exploration).amount_name
                used = key != "temperature" or amount == "temperature"
                column = self._runs[key] if used else np.full(len(self._runs), np.nan)
                found[key] = np.repeat(column[:, np.newaxis], len(pages), axis=1)
        return found

    def _tested(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Return successes, returns and lengths of the tests, each ``[runs, evaluations]``."""
        success, reward, length = (
            self.ledger.results[key].transpose(0, 1).numpy()
            for key in ("success", "return", "length")
        )
        return (
            success.sum(axis=-1, dtype=np.int64),
            reward.mean(axis=-1, dtype=np.float64),
            length.mean(axis=-1, dtype=np.float64),
        )

    def _earned(self) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Return successes, returns and lengths of the situations learned from between evaluations.

        Before learning there are none: the return and the length are NaN.
        """
        pages, every = self.ledger.book.pages, self.config.evaluation.every
        success, reward, steps = (
            pages[key].T.contiguous().cpu().numpy() for key in ("success", "return", "steps")
        )
        none = np.full((len(steps), 1), np.nan)
        return (
            success,
            np.concatenate([none, reward[:, 1:].astype(np.float64) / every], axis=1),
            np.concatenate([none, np.diff(steps) / every], axis=1),
        )

    @property
    def learning_steps(self) -> int:
        """The number of learning steps of all runs, each up to the end of its last situation."""
        return int(self.ledger.book.pages["steps"][-1].sum())

    @property
    def bounded_runs(self) -> int:
        """The number of runs in which an adaptive parameter has met its bound."""
        bounded = self.ledger.book.pages.get("bounded", None)
        return 0 if bounded is None else int(bounded[-1].sum())

    @property
    def weights(self) -> TensorDict:
        """The learned weights, by parameter name, each ``[runs, *weights]``."""
        return self.ledger.book.pages[-1]["weights"]


def _shortest(numbers: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return each number as the float64 of its shortest decimal text: 0.4, not 0.4000000059…."""
    return numbers.astype(str).astype(np.float64)
