"""Trains all runs of a job side by side and scores what they learned."""

import time
from collections.abc import Callable

import torch
from tensordict import TensorDict
from torch import Tensor

from envs.follow_ball import FollowBall
from fnnq_torchrl.config import Config, run_columns
from fnnq_torchrl.engine import choose, make_engine
from fnnq_torchrl.evaluation import Playing
from fnnq_torchrl.lanes import lanes_for, repeat_last
from fnnq_torchrl.learning import Learning
from fnnq_torchrl.program import Program
from fnnq_torchrl.qlambda import Rule
from fnnq_torchrl.results import Outcome
from fnnq_torchrl.snapshots import SnapshotBook
from fnnq_torchrl.values import ValueNetwork, make_value_network
from fnnq_torchrl.work import work_through

OnProgress = Callable[[int], None]
"""Is told how many situations, of all runs together, are done."""


class Trainer:
    """A job's runs, as lanes of one batch or of several: :meth:`learn`, then :meth:`evaluate`.

    Attributes:
        engine_chosen: which engine, and why, in a line.
        train_seconds, compile_seconds: spent so far; what compiling takes is not training.

    Args:
        config: a valid configuration.

    Raises:
        ConfigError: the engine is to compile, and there is no compiler.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.device = torch.device(config.machine.device)
        self.dtype: torch.dtype = getattr(torch, config.machine.dtype)
        engine, self.engine_chosen = choose(config)
        self.engine = make_engine(engine, self.device)
        columns = {key: self._column(key, values) for key, values in run_columns(config).items()}
        self.run = TensorDict(columns, device=self.device).auto_batch_size_(1)
        evaluations = config.situations // config.evaluation.every + 1
        self.situations_to_learn = config.num_seeds * config.situations
        self.situations_to_play = config.num_seeds * evaluations * len(config.evaluation.situations)
        self._book = SnapshotBook(
            dict(self._value_network(runs=1).named_parameters()),
            config.num_seeds,
            config.evaluation.every,
            evaluations,
        )
        self.train_seconds = self.compile_seconds = 0.0

    def _column(self, key: str, values: list[float]) -> Tensor:
        dtype = torch.int64 if key == "seed" else self.dtype
        return torch.tensor(values, dtype=dtype).unsqueeze(-1)

    def _value_network(self, runs: int) -> ValueNetwork:
        candidates = torch.linspace(
            -1, 1, self.config.action.candidates, dtype=self.dtype, device=self.device
        )
        return make_value_network(self.config.value, candidates, runs)

    def make_program(self, lanes: int) -> Program:
        """The learning step of so many runs."""
        config = self.config
        return Program(
            FollowBall(config.env, [lanes], dtype=self.dtype, device=self.device),
            self._value_network(lanes),
            rule=Rule(config.variant, config.trace, config.window),
            exploration=config.exploration,
            evaluate_every=config.evaluation.every,
        )

    @torch.no_grad()
    def learn(self, on_progress: OnProgress = lambda done: None) -> None:
        """Step all runs until each has had all its situations."""
        config, engine = self.config, self.engine
        lanes = lanes_for(config.num_seeds, engine.workers, engine.most_lanes)
        program = self.make_program(lanes)
        with engine.threads(lanes * config.action.candidates):
            start = time.perf_counter()
            example = repeat_last(self.run, lanes)
            loop = engine.make_loop(program.step, example, program.begin(example))
            ready = time.perf_counter()
            learning = Learning(program, loop, self.run, config.situations, self._book, on_progress)
            work_through(learning, config.num_seeds, lanes, engine.workers)
        self.compile_seconds += ready - start
        self.train_seconds += time.perf_counter() - ready

    @torch.no_grad()
    def evaluate(self, on_progress: OnProgress = lambda done: None) -> Outcome:
        """Score all snapshots of all runs, together."""
        config, engine = self.config, self.engine
        # There is no trace to keep, and nothing is written to the weights: twice as many fit.
        lanes = lanes_for(self.situations_to_play, engine.workers, 2 * engine.most_lanes)
        with engine.threads(lanes * config.action.candidates):
            start = time.perf_counter()
            playing = Playing(
                self._value_network(runs=1),
                config.env,
                torch.tensor(config.evaluation.situations, dtype=self.dtype, device=self.device),
                self._book.pages["weights"],
                self.run["seed"],
                engine,
                lanes,
                on_progress,
            )
            ready = time.perf_counter()
            work_through(playing, playing.jobs, lanes, engine.workers)
        self.compile_seconds += ready - start
        columns = run_columns(config)
        evaluations = len(self._book.pages)
        return Outcome(
            seed=torch.tensor(columns["seed"]).numpy(),
            lam=torch.tensor(columns["lam"], dtype=torch.float64).numpy(),
            situations=(torch.arange(evaluations) * config.evaluation.every).numpy(),
            steps=self._book.pages["steps"].T.contiguous().cpu().numpy(),
            catches=playing.catches.T.contiguous().numpy(),
            train_seconds=self.train_seconds,
            compile_seconds=self.compile_seconds,
            evaluate_seconds=time.perf_counter() - ready,
        )

    @property
    def learning_steps(self) -> int:
        """Of all runs together, each up to the end of its last situation."""
        return int(self._book.pages["steps"][-1].sum())

    @property
    def weights(self) -> TensorDict:
        """What was learned, by the names of the network's parameters, ``[runs, *weights]``."""
        return self._book.pages[-1]["weights"]
