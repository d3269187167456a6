"""Learning as a task of the scheduler, whose jobs are the runs."""

from collections.abc import Callable

from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.learning_step import Learner
from fnnq_torchrl.engine.loops import Loop
from fnnq_torchrl.training.resume.ledger import Ledger

_MOST_STEPS = 1_000
"""The most steps between two chances to save: seconds if eager, milliseconds if native."""


class Learning:
    """A scheduler's task for learning: a job is one run, from its first situation to its last.

    Args:
        learner: the learning step, for the runs that learn side by side.
        loop: the loop that repeats the learning step.
        run: the values of each run, batch size ``[runs]``.
        ledger: the progress of the runs; updated in place.
        on_progress: called with the number of situations learned so far, over all runs.
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
        # Few enough that no run takes two snapshots within these steps, and that a save, which has
        # to wait for their end, doesn't wait long.
        self.steps = min(learner.env.world.fewest_steps * learner.evaluate_every, _MOST_STEPS)
        self._learner, self._ledger, self._on_progress = learner, ledger, on_progress
        self._situations = run["situations"].squeeze(-1).cpu()

    @property
    def jobs(self) -> Tensor:
        """The numbers of the unfinished runs, int64 ``[jobs]``."""
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
