"""Runs that learn, as jobs on lanes."""

from collections.abc import Callable

from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.learning_step import Learner
from fnnq_torchrl.engine.loops import Loop
from fnnq_torchrl.training.resume.ledger import Ledger

_MOST_STEPS = 1_000
"""Between two visits of the keeper: some seconds if steps are eager, much less in a native loop."""


class Learning:
    """The :class:`.Task` of all runs of a job: each has its situations to learn.

    Args:
        learner: one learning step, for as many runs as there are lanes.
        loop: of that step.
        run: what each run is, ``[runs]``.
        ledger: what is done of them so far; kept up to date.
        on_progress: is told how many situations, of all runs together, are done.
    """

    def __init__(
        self,
        learner: Learner,
        loop: Loop,
        run: TensorDictBase,
        ledger: Ledger,
        on_progress: Callable[[int], None],
    ) -> None:
        self.run = run
        self.loop = loop
        # In so few steps no run can come to a second snapshot. Nor may they take long, since a
        # training is saved between them.
        self.steps = min(learner.env.world.fewest_steps * learner.evaluate_every, _MOST_STEPS)
        self._learner, self._ledger, self._on_progress = learner, ledger, on_progress
        self._situations = run["situations"].squeeze(-1).cpu()

    @property
    def jobs(self) -> Tensor:
        """The runs that aren't done, int64."""
        return (self._ledger.learned < self._situations).nonzero().squeeze(-1)

    def begin(self, jobs: Tensor) -> tuple[TensorDictBase, TensorDictBase]:
        run = self.run[jobs.to(self.run.device)]
        state = self._learner.begin(run)
        for begun, states in self._ledger.hands:
            lane, place = (jobs.unsqueeze(-1) == begun).nonzero(as_tuple=True)
            if len(lane):
                state[lane] = states[place]
        return run, state

    def collect(self, jobs: Tensor, state: TensorDictBase) -> Tensor:
        self._ledger.book.collect(jobs, state)
        busy, learned = jobs >= 0, self._ledger.learned
        if self._ledger.fired is not None:
            self._ledger.fired[jobs[busy]] = state["fired"].cpu()[busy]
        situations = state["situations"].squeeze(-1).cpu()[busy]
        learned[jobs[busy]] = situations.minimum(self._situations[jobs[busy]])
        diverged = busy & state["diverged"].squeeze(-1).cpu()
        if diverged.any():
            stopped = jobs[diverged]
            self._ledger.stop(stopped, state["steps"].squeeze(-1).cpu()[diverged])
            learned[stopped] = self._situations[stopped]
        self._on_progress(int(learned.sum()))
        return state["over"].squeeze(-1).cpu()
