"""What is done so far of a batch's work, which can be saved and gone on from."""

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from envs.core.parameters import MOST
from fnnq_torchrl.config.schema import PER_RUN
from fnnq_torchrl.training.resume.keeper import Hand
from fnnq_torchrl.training.resume.snapshots import SnapshotBook

_SECONDS = ("train", "compile", "evaluate")


class Ledger:
    """Of every run: its snapshots, the situations learned from and played, and the time it took.

    Attributes:
        book: the snapshots.
        learned: situations learned from, int64 ``[runs]``; all, for a run that has diverged.
        diverged: whether a run had diverged when an evaluation was due, bool ``[evaluations,
            runs]``. Such an evaluation is not played and has no catch.
        hands: runs that had begun to learn when this was saved, and their states then.
        played: whether each snapshot has played each situation, bool
            ``[evaluations, runs, situations]``.
        catches: of each snapshot, int64 ``[evaluations, runs]``.
        seconds: by ``train``, ``compile`` and ``evaluate``; what compiling takes is in it alone.

    Args:
        columns: by each key of `PER_RUN` the values of all runs, ``[runs]``.
        weights: of the runs before learning, by name, each ``[runs, *weights]``.
        every: situations from one evaluation to the next.
        evaluations: how many there are, the one before learning included.
        tests: situations in each.
    """

    def __init__(
        self,
        columns: Mapping[str, Sequence[float]],
        weights: Mapping[str, Tensor],
        every: int,
        evaluations: int,
        tests: int,
    ) -> None:
        runs = len(columns["seed"])
        self._columns = columns
        self.book = SnapshotBook(weights, every, evaluations)
        self.learned = torch.zeros(runs, dtype=torch.int64)
        self.diverged = torch.zeros(evaluations, runs, dtype=torch.bool)
        self.hands: Sequence[Hand] = ()
        self.played = torch.zeros(evaluations, runs, tests, dtype=torch.bool)
        self.catches = torch.zeros(evaluations, runs, dtype=torch.int64)
        self.seconds: dict[str, float] = defaultdict(float, dict.fromkeys(_SECONDS, 0.0))
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
        """A last step may have led to weights that no Q was computed from."""
        weights = self.book.pages["weights"].flatten_keys(".").values()
        finite = [weight.isfinite().flatten(2).all(-1) for weight in weights]
        self._leave_out(slice(None), ~torch.stack(finite).all(0).cpu())

    def _leave_out(self, runs: Tensor | slice, evaluations: Tensor) -> None:
        self.diverged[:, runs] |= evaluations
        self.played[:, runs] |= evaluations.unsqueeze(-1)

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
        """All of it, as plain tensors and numbers.

        Args:
            hands: runs that have begun to learn, and their states. Those that had begun earlier,
                and that nobody has gone on with yet, are as they were.
        """
        self._split()
        hands = [*hands, *self._waiting(hands)]
        pages = self.book.pages
        return {
            "runs": self._runs(),
            "weights": pages["weights"].to_dict(),
            "steps": pages["steps"],
            "collected": self.book.collected,
            "learned": self.learned,
            "diverged": self.diverged,
            "hands": [(jobs, state.to_dict()) for jobs, state in hands],
            "played": self.played,
            "catches": self.catches,
            "seconds": dict(self.seconds),
        }

    def _waiting(self, hands: Sequence[Hand]) -> Iterator[Hand]:
        """What there was in hand, of runs that are neither done nor in anybody's hand now."""
        elsewhere = self.learned >= (len(self.played) - 1) * self.book.every
        for jobs, _ in hands:
            elsewhere[jobs] = True
        for jobs, state in self.hands:
            here = ~elsewhere[jobs]
            if here.any():
                yield jobs[here], state[here.to(state.device)]

    def load_state_dict(self, saved: dict[str, Any], begun: TensorDictBase) -> bool:
        """Go on from what was done of the same runs, or of these and others.

        Args:
            saved: what :meth:`state_dict` gave, with equal evaluations and weights.
            begun: the state of any run that has begun, ``[1]``, as those in hand must be.

        Returns:
            Whether all the runs are there; if not, nothing has changed.

        Raises:
            AttributeError, LookupError, RuntimeError, TypeError, ValueError: it is nothing that
                :meth:`state_dict` gave.
        """
        self._check(saved, begun)
        if (rows := _find(self._runs(), saved["runs"])) is None:
            return False
        pages = self.book.pages
        for name, weight in pages["weights"].items():
            _copy(weight, saved["weights"][name][:, rows])
        _copy(pages["steps"], saved["steps"][:, rows])
        _copy(self.book.collected, saved["collected"][rows])
        _copy(self.learned, saved["learned"][rows])
        _copy(self.diverged, saved["diverged"][:, rows])
        _copy(self.played, saved["played"][:, rows])
        _copy(self.catches, saved["catches"][:, rows])
        place = torch.full((len(saved["runs"]),), -1).index_copy(0, rows, torch.arange(len(rows)))
        self.hands = [
            (place[jobs][here], TensorDict(state, jobs.shape)[here].to(pages.device))
            for jobs, state in saved["hands"]
            for here in [place[jobs] >= 0]
        ]
        self.seconds.update(saved["seconds"])
        return True

    def _check(self, saved: dict[str, Any], begun: TensorDictBase) -> None:
        """Refuse numbers that nothing can come to, whoever has written them."""
        last, tests = len(self.played) - 1, self.played.shape[-1]
        _check_range(saved["learned"], 0, last * self.book.every)
        _check_range(saved["collected"], 0, last)
        _check_range(saved["catches"], 0, tests)
        _check_range(saved["steps"], 0)
        for what, seconds in saved["seconds"].items():
            if what not in _SECONDS or not 0 <= seconds < inf:
                raise ValueError(f"{what}={seconds} is no time")
        for jobs, state in saved["hands"]:
            _check_range(jobs, 0, len(saved["runs"]) - 1)
            of_run = TensorDict(state, jobs.shape).flatten_keys(".")
            expected = begun.flatten_keys(".")
            if of_run.keys() != expected.keys():
                raise ValueError("a state has other entries")
            for name, entry in expected.items():
                if of_run[name].shape[1:] != entry.shape[1:] or of_run[name].dtype != entry.dtype:
                    raise ValueError(f"{name} isn't what it is in a state")
            _check_range(of_run["situations"], 0)
            _check_range(of_run["steps"], 0)

    def _runs(self) -> Tensor:
        """What tells the runs apart, int64 ``[runs, columns]``: the bits of their values."""
        columns = [
            torch.tensor(self._columns[key], dtype=torch.float64).view(torch.int64)
            for key in PER_RUN
            if key != "seed"
        ]
        return torch.stack([torch.tensor(self._columns["seed"]), *columns], -1)


def _copy(into: Tensor, saved: Tensor) -> None:
    """Copy what is of the same kind; nothing is repeated or converted to fit."""
    if saved.shape != into.shape or saved.dtype != into.dtype:
        raise ValueError(f"{saved.dtype} {saved.shape} is not {into.dtype} {into.shape}")
    into.copy_(saved)


def _check_range(numbers: Tensor, low: int, high: int = MOST) -> None:
    if numbers.dtype != torch.int64 or not ((low <= numbers) & (numbers <= high)).all():
        raise ValueError(f"not all are whole numbers from {low} to {high}")


def _find(runs: Tensor, among: Tensor) -> Tensor | None:
    """The row of each run, all different, int64 ``[runs]``; None if one isn't there."""
    places: dict[tuple[int, ...], list[int]] = defaultdict(list)
    for place, row in enumerate(among.tolist()):
        places[tuple(row)].append(place)
    found = [there.pop() if (there := places[tuple(row)]) else None for row in runs.tolist()]
    return None if None in found else torch.tensor(found)
