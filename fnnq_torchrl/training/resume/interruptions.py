"""Interruptions of a training: by the clock, to save, and by signals, to save and perhaps end."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

SAVING = ("SIGUSR1", "SIGUSR2")
"""Signals that ask for a save, after which the work goes on. Slurm sends one as a warning."""

_ENDING = ("SIGTERM", "SIGINT")


class Interrupted(Exception):
    """A signal has ended the work, which is saved.

    Args:
        number: of the signal.
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
        number: of the signal.
        error: the reason.
    """

    def __init__(self, number: int, error: OSError) -> None:
        super().__init__(number)
        self.args = (number, error)
        self.status = 1

    def __str__(self) -> str:
        name = signal.Signals(self.args[0]).name
        return f"{name}: what was done since the last save is lost: {self.args[1]}"


class Interruptions:
    """Tells when to save and when to end, within a ``with`` block in the main thread.

    In this block, SIGUSR1 and SIGUSR2 ask for a save. SIGTERM and SIGINT ask for a save and for an
    end after it; a second one ends the process at once. Two kinds of signals are left alone: those
    that somebody else handles, such as submitit, and a SIGTERM or SIGINT that the process was
    started to ignore, as a script's background jobs are.

    The block may go on after the work with something that must not be cut off, such as writing
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
        """A block of work that is saved when a save is due."""
        self._watched = True
        try:
            yield
        finally:
            self._watched = False

    @property
    def ending(self) -> bool:
        """True if the work is to end."""
        return bool(self._ends_by)

    def due(self) -> bool:
        """Return True if it is time to save."""
        return self._asked or self.ending or self._clock() - self._last_s >= self._every_s

    def saved(self) -> None:
        """Take note that everything is saved.

        Raises:
            Interrupted: the work is to end.
        """
        self._end_save(well=True)
        self.obey()

    def obey(self) -> None:
        """End the work if it is to end. Everything must be saved or finished by now.

        Raises:
            Interrupted: the work is to end.
        """
        if self._ends_by:
            raise Interrupted(self._ends_by)

    def failed(self, error: OSError) -> None:
        """Take note that the save failed. It is due again after an interval or at a signal.

        Raises:
            Lost: the work is to end.
        """
        self._end_save(well=False)
        if self._ends_by:
            raise Lost(self._ends_by, error) from error

    def save_now(self, timeout_s: float) -> bool:
        """Ask for a save, from the main thread, and wait for it.

        Returns:
            True if it was saved; False if that failed or took too long, or nothing is at work.
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
