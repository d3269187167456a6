"""The progress of a batch of runs, which can be saved and loaded."""

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
    """The progress of a batch: weight snapshots, situations learned and played, and seconds.

    Attributes:
        book: the weight snapshots.
        learned: the number of situations each run has learned from, int64 ``[runs]``. A diverged
            run counts as having learned from all.
        diverged: True if a run had diverged when an evaluation was due, bool ``[evaluations,
            runs]``. Such an evaluation is not played.
        hands: the runs that were learning when this progress was saved, with their states at that
            time (see `Hand`).
        fired: each rule's firing strength, summed over the steps that its run has learned from,
            ``[runs, *weights]``; None if it isn't counted.
        results: the test results (:func:`fnnq_torchrl.training.evaluation.no_results`), batch size
            ``[evaluations, runs, tests]``.
        seconds: the wall times of ``train``, ``compile`` and ``evaluate``; compiling isn't part of
            the others.

    Args:
        runs: the values in which the runs differ.
        weights: the weights before learning, by name, each ``[runs, *weights]``.
        told: the other numbers that the learner's snapshots have, as :class:`.SnapshotBook` takes
            them.
        every: the number of situations from one evaluation to the next.
        evaluations: the number of evaluations, including the one before learning.
        tests: the number of situations in each evaluation.
        count_firing: whether to keep ``fired``.
    """

    def __init__(
        self,
        runs: Runs,
        weights: Mapping[str, Tensor],
        told: Mapping[str, Tensor],
        every: int,
        evaluations: int,
        tests: int,
        *,
        count_firing: bool = False,
    ) -> None:
        self._bits = torch.from_numpy(runs.bits)
        self.book = SnapshotBook(weights, told, every, evaluations)
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
        """Stop diverged runs; the last snapshot of each run is used for its later evaluations.

        Args:
            runs: the numbers of the diverged runs, int64 ``[stopped]``.
            steps: the number of steps that each has taken, int64 ``[stopped]``.
        """
        self.book.close(runs, steps)
        due = torch.arange(len(self.diverged)).unsqueeze(-1)
        self._leave_out(runs, due > self.book.collected[runs])

    def stop_where_not_finite(self) -> None:
        """Mark evaluations as diverged, and don't play them, if their weights aren't finite."""
        weights = self.book.pages["weights"].flatten_keys(".").values()
        finite = [weight.isfinite().flatten(2).all(-1) for weight in weights]
        self._leave_out(slice(None), ~torch.stack(finite).all(0).cpu())

    def _leave_out(self, runs: Tensor | slice, evaluations: Tensor) -> None:
        self.diverged[:, runs] |= evaluations
        self.results["played"][:, runs] |= evaluations.unsqueeze(-1)

    @contextmanager
    def timed(self, what: str) -> Iterator[None]:
        """Add the seconds of the block, less those of timed blocks inside, to ``seconds[what]``."""
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
        """Return the progress as plain tensors and numbers.

        Args:
            hands: the runs that are learning now, and their states. Runs that were loaded, but that
                no worker has taken up again, are added in their loaded state.
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
        """Yield the loaded runs that are unfinished and not among ``hands``."""
        elsewhere = self.learned >= (len(self.diverged) - 1) * self.book.every
        for jobs, _ in hands:
            elsewhere[jobs] = True
        for jobs, state in self.hands:
            here = ~elsewhere[jobs]
            if here.any():
                yield jobs[here], state[here.to(state.device)]

    def load_state_dict(self, saved: dict[str, Any], rows: Tensor) -> None:
        """Load the progress of these runs from a saved ledger, which may have more runs.

        Args:
            saved: the :meth:`state_dict` of the saved ledger. Its numbers of evaluations and tests
                and its weights' shapes must be those of this ledger.
            rows: the row of each run in the saved ledger, int64 ``[runs]``.
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
