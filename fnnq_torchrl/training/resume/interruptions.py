"""Interruptions of a training: by the clock, to save, and by signals, to save and perhaps end."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

SAVING = ("SIGUSR1", "SIGUSR2")
"""Signals that ask for a save, after which the work goes on; Slurm's warning."""

_ENDING = ("SIGTERM", "SIGINT")


class Interrupted(Exception):
    """A signal has ended the work, which is saved.

    Args:
        number: the signal's.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.status = 128 + number
        """The exit status of the process."""

    def __str__(self) -> str:
        name = signal.Signals(self.args[0]).name
        return f"{name}: what is done so far is saved"


class Lost(Interrupted):
    """A signal has ended the work, and it couldn't be saved.

    Args:
        number: the signal's.
        error: why not.
    """

    def __init__(self, number: int, error: OSError) -> None:
        super().__init__(number)
        self.args = (number, error)
        self.status = 1

    def __str__(self) -> str:
        name = signal.Signals(self.args[0]).name
        return f"{name}: what was done since the last save is lost: {self.args[1]}"


class Interruptions:
    """Says when to save and when to end, within a ``with`` block in the main thread.

    There, SIGUSR1 and SIGUSR2 make a save due; SIGTERM and SIGINT do so too, and end the work after
    it. A second SIGTERM or SIGINT ends it at once. A signal that something else answers, such as
    submitit, is left to it; so is a SIGTERM or SIGINT that the process was started to ignore, as a
    script's background jobs are.

    The block may go on after the work, for what is not to be cut off, such as the writing of
    results; :meth:`obey` then ends it.

    Args:
        every_s: seconds from one save to the next.
        clock: returns the seconds since any moment.
    """

    def __init__(self, every_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._every_s, self._clock = every_s, clock
        self._last_s = clock()
        self._asked, self._ends_by = False, 0
        self._watched, self._answered, self._well = False, threading.Event(), False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._answer_to(SAVING, instead_of=(signal.SIG_DFL, signal.SIG_IGN))
            self._answer_to(_ENDING, instead_of=(signal.SIG_DFL, signal.default_int_handler))
        return self

    def __exit__(self, *exception: object) -> None:
        self._restore()

    @contextmanager
    def watched(self) -> Iterator[None]:
        """A block within which the work is saved when it is due."""
        self._watched = True
        try:
            yield
        finally:
            self._watched = False

    @property
    def ending(self) -> bool:
        """Whether the work is to end."""
        return bool(self._ends_by)

    def due(self) -> bool:
        """Return whether it is time to save."""
        return self._asked or self.ending or self._clock() - self._last_s >= self._every_s

    def saved(self) -> None:
        """Take note that everything is saved.

        Raises:
            Interrupted: it was to be saved because the work is to end.
        """
        self._end_save(well=True)
        self.obey()

    def obey(self) -> None:
        """End the work if it is to end, now that everything is saved or finished.

        Raises:
            Interrupted: the work is to end.
        """
        if self._ends_by:
            raise Interrupted(self._ends_by)

    def failed(self, error: OSError) -> None:
        """Take note that the save failed. It is due again after an interval or at a signal.

        Raises:
            Lost: it was to be saved because the work is to end.
        """
        self._end_save(well=False)
        if self._ends_by:
            raise Lost(self._ends_by, error) from error

    def save_now(self, timeout_s: float) -> bool:
        """Ask for a save, from the main thread, and wait for it.

        Returns:
            Whether it was saved: not if that failed, took too long, or nothing is at work.
        """
        if not self._watched:
            return False
        self._answered.clear()
        self._asked = True
        return self._answered.wait(timeout_s) and self._well

    def _end_save(self, *, well: bool) -> None:
        self._last_s, self._asked, self._well = self._clock(), False, well
        self._answered.set()

    def _answer_to(self, names: tuple[str, ...], instead_of: tuple[Any, ...]) -> None:
        for name in names:
            number = getattr(signal, name, None)  # Windows hasn't all
            if number is not None and signal.getsignal(number) in instead_of:
                self._before[number] = signal.signal(number, self._answer)

    def _answer(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        if signal.Signals(number).name in _ENDING:
            self._ends_by = number
            self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()
