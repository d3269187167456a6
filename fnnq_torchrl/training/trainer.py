"""Trains all runs of a job, or of many jobs, side by side and scores what they learned."""

from collections.abc import Callable, Mapping, Sequence

import torch
from tensordict import TensorDict
from torch import Tensor

from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.learning_step import Program
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.schema import Config, run_columns
from fnnq_torchrl.engine.choice import choose, make_engine
from fnnq_torchrl.engine.lanes import lanes_for, repeat_last
from fnnq_torchrl.engine.scheduler import Keeper, work_through
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import StepSize
from fnnq_torchrl.training.denormals import with_denormals
from fnnq_torchrl.training.evaluation import Playing
from fnnq_torchrl.training.learning import Learning
from fnnq_torchrl.training.results import Outcome
from fnnq_torchrl.training.resume.ledger import Ledger

OnProgress = Callable[[int], None]
"""Is told how many situations, of all runs together, are done."""


class Trainer:
    """Many runs, as lanes of one batch or of several: :meth:`learn`, then :meth:`evaluate`.

    Attributes:
        engine_chosen: which engine, and why, in a line.
        ledger: what is done so far.

    Args:
        config: a valid configuration, of ``num_seeds`` runs.
        columns: by each key of `PER_RUN` the values of all runs, ``[num_seeds]``, where they are
            not those that the configuration alone gives: the runs of several jobs.

    Raises:
        ConfigError: the engine is to compile, and there is no compiler.
    """

    def __init__(
        self, config: Config, columns: Mapping[str, Sequence[float]] | None = None
    ) -> None:
        self.config = config
        self._columns = run_columns(config) if columns is None else columns
        self.device = torch.device(config.machine.device)
        self.dtype: torch.dtype = getattr(torch, config.machine.dtype)
        engine, self.engine_chosen = choose(config)
        self.engine = make_engine(engine, self.device)
        run = {key: self._column(key, values) for key, values in self._columns.items()}
        run["situations"] = torch.full_like(run["seed"], config.situations)
        self.run = TensorDict(run, device=self.device).auto_batch_size_(1)
        evaluations = config.situations // config.evaluation.every + 1
        tests = len(config.evaluation.situations)
        self.situations_to_learn = config.num_seeds * config.situations
        self.situations_to_play = config.num_seeds * evaluations * tests
        weights = self._value_network(runs=1).start(self.run["seed"])
        self.ledger = Ledger(self._columns, weights, config.evaluation.every, evaluations, tests)

    def _column(self, key: str, values: Sequence[float]) -> Tensor:
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
            step_size=StepSize(config.step_size),
            exploration=config.exploration,
            evaluate_every=config.evaluation.every,
            largest_value=config.diverged_beyond * config.env.largest_return,
        )

    @property
    @torch.no_grad()
    def begun(self) -> TensorDict:
        """The state in which the first run begins to learn, ``[1]``."""
        return self.make_program(1).begin(self.run[:1])

    @torch.no_grad()
    def learn(
        self, on_progress: OnProgress = lambda done: None, keeper: Keeper | None = None
    ) -> None:
        """Step all runs until each has had all its situations.

        Args:
            on_progress: see there.
            keeper: of what the runs that aren't done have come to.
        """
        config, engine, ledger = self.config, self.engine, self.ledger
        if int(ledger.learned.sum()) == self.situations_to_learn:
            return
        lanes = lanes_for(config.num_seeds, engine.workers, engine.most_lanes)
        with engine.threads(lanes * config.action.candidates), ledger.timed("train"):
            program = self.make_program(lanes)
            with ledger.timed("compile"):
                example = repeat_last(self.run, lanes)
                loop = engine.make_loop(
                    lambda lanes: self.make_program(lanes).step, example, program.begin(example)
                )
            learning = Learning(program, loop, self.run, ledger, on_progress)
            work_through(learning, learning.jobs, lanes, engine.workers, keeper)

    @torch.no_grad()
    def evaluate(
        self, on_progress: OnProgress = lambda done: None, keeper: Keeper | None = None
    ) -> Outcome:
        """Score all snapshots of all runs, together."""
        config, engine, ledger = self.config, self.engine, self.ledger
        ledger.stop_where_not_finite()
        # There is no trace to keep, and nothing is written to the weights: twice as many fit.
        lanes = lanes_for(self.situations_to_play, engine.workers, 2 * engine.most_lanes)
        tests = torch.tensor(config.evaluation.situations, dtype=self.dtype, device=self.device)
        with engine.threads(lanes * config.action.candidates), ledger.timed("evaluate"):
            with ledger.timed("compile"):
                playing = Playing(
                    self._value_network(runs=1),
                    config.env.on_both_sides(),
                    tests,
                    self.run["seed"],
                    ledger.book.pages["weights"],
                    ledger.played,
                    ledger.catches,
                    engine,
                    lanes,
                    on_progress,
                )
            work_through(playing, playing.jobs, lanes, engine.workers, keeper)
        pages = ledger.book.pages
        return Outcome(
            seed=torch.tensor(self._columns["seed"]).numpy(),
            lam=torch.tensor(self._columns["lam"], dtype=torch.float64).numpy(),
            situations=(torch.arange(len(pages)) * config.evaluation.every).numpy(),
            steps=pages["steps"].T.contiguous().cpu().numpy(),
            catches=ledger.catches.T.contiguous().numpy(),
            diverged=ledger.diverged.T.contiguous().numpy(),
            # Page by page, since all at once would take several times the memory of all weights.
            denormal=torch.stack([*map(with_denormals, pages["weights"])], dim=1).numpy(),
            batch_runs=config.num_seeds,
            batch_learning_steps=self.learning_steps,
            train_seconds=ledger.seconds["train"],
            compile_seconds=ledger.seconds["compile"],
            evaluate_seconds=ledger.seconds["evaluate"],
        )

    @property
    def learning_steps(self) -> int:
        """Of all runs together, each up to the end of its last situation."""
        return int(self.ledger.book.pages["steps"][-1].sum())

    @property
    def weights(self) -> TensorDict:
        """What was learned, by the names of the network's parameters, ``[runs, *weights]``."""
        return self.ledger.book.pages[-1]["weights"]
