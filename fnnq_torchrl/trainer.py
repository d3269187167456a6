"""Trains all runs of a job side by side and scores what they learned."""

import time
from collections.abc import Callable

import torch
from tensordict import TensorDict
from torch import Tensor

from envs.follow_ball import FollowBall
from fnnq_torchrl.config import Config, run_columns
from fnnq_torchrl.evaluation import Evaluation
from fnnq_torchrl.lanes import pad
from fnnq_torchrl.layout import runs_first
from fnnq_torchrl.program import Program
from fnnq_torchrl.results import Outcome
from fnnq_torchrl.snapshots import SnapshotBook
from fnnq_torchrl.threads import threads_for
from fnnq_torchrl.values import make_value_network

OnProgress = Callable[[int], None]
"""Is told how many situations, of all runs together, are done."""


class Trainer:
    """A job's runs, as lanes of one batch: :meth:`learn`, then :meth:`evaluate`.

    Args:
        config: a valid configuration.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self.device = torch.device(config.machine.device)
        self.dtype: torch.dtype = getattr(torch, config.machine.dtype)
        columns = {name: self._lanes(name, values) for name, values in run_columns(config).items()}
        self.run = TensorDict(columns, device=self.device).auto_batch_size_(1)
        lanes = len(self.run)
        candidates = torch.linspace(
            -1, 1, config.action.candidates, dtype=self.dtype, device=self.device
        )
        self.program = Program(
            FollowBall(config.env, [lanes], dtype=self.dtype, device=self.device),
            make_value_network(config.value, candidates, lanes),
            trace=config.trace,
            evaluate_every=config.evaluation.every,
        )
        evaluations = config.situations // config.evaluation.every + 1
        self.situations_to_learn = config.num_seeds * config.situations
        self.situations_to_play = config.num_seeds * evaluations * len(config.evaluation.situations)
        self._state = self.program.begin(self.run)
        self._book = SnapshotBook(self._state, config.evaluation.every, evaluations)
        self._learn_seconds = 0.0

    def _lanes(self, name: str, values: list[float]) -> Tensor:
        dtype = torch.int64 if name == "seed" else self.dtype
        return pad(torch.tensor(values, dtype=dtype)).unsqueeze(-1)

    @torch.no_grad()
    def learn(self, on_progress: OnProgress = lambda done: None) -> None:
        """Step all runs until each has had all its situations."""
        with threads_for(len(self.run) * self.config.action.candidates):
            self._learn(on_progress)

    def _learn(self, on_progress: OnProgress) -> None:
        start = time.perf_counter()
        runs, situations = self.config.num_seeds, self.config.situations
        # In so few steps no run can come to a second snapshot.
        steps = self.program.env.fewest_steps * self.config.evaluation.every
        done = 0
        while done < self.situations_to_learn:
            for _ in range(steps):
                self._state = self.program.step(self.run, self._state)
            self._book.collect(self._state)
            done = int(self._state["situations"][:runs].clamp(max=situations).sum())
            on_progress(done)
        self._learn_seconds += time.perf_counter() - start

    @torch.no_grad()
    def evaluate(self, on_progress: OnProgress = lambda done: None) -> Outcome:
        """Score all snapshots of all runs, together."""
        start = time.perf_counter()
        runs, pages = self.config.num_seeds, self._book.pages
        evaluations = len(pages)
        situations = torch.tensor(
            self.config.evaluation.situations, dtype=self.dtype, device=self.device
        )
        snapshots = TensorDict(
            {
                "weights": pages["weights"].apply(
                    lambda w: w[..., :runs].movedim(-1, 1).flatten(0, 1), batch_size=[]
                ),
                "seed": self.run["seed"][:runs].repeat(evaluations, 1),
                "evaluation": torch.arange(evaluations, device=self.device)
                .repeat_interleave(runs)
                .unsqueeze(-1),
            }
        ).auto_batch_size_(1)
        evaluation = Evaluation(self.program.policy, self.config.env, situations)
        catches = evaluation.score(snapshots, on_progress).view(evaluations, runs)
        columns = run_columns(self.config)
        return Outcome(
            seed=torch.tensor(columns["seed"]).numpy(),
            lam=torch.tensor(columns["lam"], dtype=torch.float64).numpy(),
            situations=(torch.arange(evaluations) * self.config.evaluation.every).numpy(),
            steps=pages["steps"][:, :runs].T.contiguous().cpu().numpy(),
            catches=catches.T.contiguous().cpu().numpy(),
            train_seconds=self._learn_seconds,
            compile_seconds=0.0,
            evaluate_seconds=time.perf_counter() - start,
        )

    @property
    def weights(self) -> TensorDict:
        """What was learned, by the names of the network's parameters, ``[runs, *weights]``."""
        last = self._book.pages[-1]["weights"]
        return last.apply(lambda w: runs_first(w)[: self.config.num_seeds])
