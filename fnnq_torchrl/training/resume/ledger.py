"""The progress of a batch, which can be saved and gone on from."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor

from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.training.evaluation import no_results
from fnnq_torchrl.training.resume.keeper import Hand
from fnnq_torchrl.training.resume.snapshots import SnapshotBook


class Ledger:
    """The progress of a batch: snapshots, situations learned and played, and seconds.

    Attributes:
        book: the snapshots.
        learned: situations learned from, int64 ``[runs]``; all, for a run that has diverged.
        diverged: whether a run had diverged when an evaluation was due, bool ``[evaluations,
            runs]``. Such an evaluation is not played.
        hands: runs that had begun to learn when this was saved, and their states then.
        fired: each rule's firing strength, summed over the steps that its run learned from,
            ``[runs, *weights]``; none if that isn't counted.
        results: of the test (:func:`fnnq_torchrl.training.evaluation.no_results`), batch size
            ``[evaluations, runs, tests]``.
        seconds: by ``train``, ``compile`` and ``evaluate``; what compiling takes is in it alone.

    Args:
        runs: what the runs have of their own.
        weights: of the runs before learning, by name, each ``[runs, *weights]``.
        every: situations from one evaluation to the next.
        evaluations: how many there are, the one before learning included.
        tests: situations in each.
        count_firing: whether there is ``fired``.
    """

    def __init__(
        self,
        runs: Runs,
        weights: Mapping[str, Tensor],
        every: int,
        evaluations: int,
        tests: int,
        *,
        count_firing: bool = False,
    ) -> None:
        self._bits = torch.from_numpy(runs.bits)
        self.book = SnapshotBook(weights, every, evaluations)
        self.learned = torch.zeros(len(runs), dtype=torch.int64)
        self.diverged = torch.zeros(evaluations, len(runs), dtype=torch.bool)
        self.hands: Sequence[Hand] = ()
        dtype = next(iter(weights.values())).dtype
        self.fired = torch.zeros(weights["weight"].shape, dtype=dtype) if count_firing else None
        self.results = no_results(evaluations, len(runs), tests, dtype)
        self.seconds: dict[str, float] = {"train": 0.0, "compile": 0.0, "evaluate": 0.0}
        self._running: list[str] = []
        self._since = 0.0

    def stop(self, runs: Tensor, steps: Tensor) -> None:
        """Runs have diverged: the last snapshot of each stands for all that were to come.

        Args:
            runs: their numbers, int64 ``[stopped]``.
            steps: that they have taken, int64 ``[stopped]``.
        """
        self.book.close(runs, steps)
        due = torch.arange(len(self.diverged)).unsqueeze(-1)
        self._leave_out(runs, due > self.book.collected[runs])

    def stop_where_not_finite(self) -> None:
        """Leave out the evaluations of weights that a last step has made infinite or NaN."""
        weights = self.book.pages["weights"].flatten_keys(".").values()
        finite = [weight.isfinite().flatten(2).all(-1) for weight in weights]
        self._leave_out(slice(None), ~torch.stack(finite).all(0).cpu())

    def _leave_out(self, runs: Tensor | slice, evaluations: Tensor) -> None:
        self.diverged[:, runs] |= evaluations
        self.results["played"][:, runs] |= evaluations.unsqueeze(-1)

    @contextmanager
    def timed(self, what: str) -> Iterator[None]:
        """Count the time of a block, less that of such blocks in it."""
        self._split()
        self._running.append(what)
        try:
            yield
        finally:
            self._split()
            self._running.pop()

    def _split(self) -> None:
        now = time.perf_counter()
        if self._running:
            self.seconds[self._running[-1]] += now - self._since
        self._since = now

    def state_dict(self, hands: Sequence[Hand] = ()) -> dict[str, Any]:
        """Return all of it, as plain tensors and numbers.

        Args:
            hands: runs that have begun to learn, and their states. Those that had begun earlier,
                and that nobody has gone on with yet, are as they were.
        """
        self._split()
        hands = [*hands, *self._waiting(hands)]
        return {
            "runs": self._bits,
            "pages": self.book.pages.to_dict(),
            "collected": self.book.collected,
            "learned": self.learned,
            "diverged": self.diverged,
            "fired": self.fired,
            "hands": [(jobs, state.to_dict()) for jobs, state in hands],
            "results": self.results.to_dict(),
            "seconds": dict(self.seconds),
        }

    def _waiting(self, hands: Sequence[Hand]) -> Iterator[Hand]:
        """Yield what was in hand, of runs that are neither done nor in anybody's hand now."""
        elsewhere = self.learned >= (len(self.diverged) - 1) * self.book.every
        for jobs, _ in hands:
            elsewhere[jobs] = True
        for jobs, state in self.hands:
            here = ~elsewhere[jobs]
            if here.any():
                yield jobs[here], state[here.to(state.device)]

    def load_state_dict(self, saved: dict[str, Any], rows: Tensor) -> None:
        """Go on from what was done of the same runs, or of these and others.

        Args:
            saved: what :meth:`state_dict` gave, with equal evaluations and weights.
            rows: where each run is among those that were saved, int64 ``[runs]``.
        """
        pages = self.book.pages
        evaluations, runs = len(pages), len(saved["runs"])
        pages.update_(TensorDict(saved["pages"], [evaluations, runs])[:, rows])
        self.results.update_(TensorDict(saved["results"], [evaluations, runs])[:, rows])
        self.book.collected.copy_(saved["collected"][rows])
        self.learned.copy_(saved["learned"][rows])
        self.diverged.copy_(saved["diverged"][:, rows])
        if self.fired is not None:
            self.fired.copy_(saved["fired"][rows])
        place = torch.full((runs,), -1).index_copy(0, rows, torch.arange(len(rows)))
        self.hands = [
            (place[jobs][here], TensorDict(state, jobs.shape)[here].to(pages.device))
            for jobs, state in saved["hands"]
            for here in [place[jobs] >= 0]
        ]
        self.seconds.update(saved["seconds"])
