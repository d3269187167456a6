"""Interruptions of a training: saves at intervals, and saves or ends requested by signals."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

SAVING = ("SIGUSR1", "SIGUSR2")
"""Signals that ask for a save; the work goes on. Slurm can send one before a time limit."""

_ENDING = ("SIGTERM", "SIGINT", "SIGHUP")


class Interrupted(Exception):
    """A signal has ended the work, and the work is saved.

    Args:
        number: the number of the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.status = 128 + number
        """The exit status of the process."""

    def __str__(self) -> str:
        name = signal.Signals(self.args[0]).name
        return f"{name}: the work so far is saved"


class Lost(Interrupted):
    """A signal has ended the work, and the work couldn't be saved.

    Args:
        number: the number of the signal.
        error: the reason why the save failed.
    """

    def __init__(self, number: int, error: OSError) -> None:
        super().__init__(number)
        self.args = (number, error)
        self.status = 1

    def __str__(self) -> str:
        name = signal.Signals(self.args[0]).name
        return f"{name}: the work since the last save is lost: {self.args[1]}"


class Interruptions:
    """Says when to save and when to end, inside a ``with`` block in the main thread.

    In this block, SIGUSR1 and SIGUSR2 ask for a save. SIGTERM, SIGINT and SIGHUP, which comes when
    the terminal is closed, ask for a save and the end of the work; a second one ends the process at
    once. A signal keeps its handler if other code, such as submitit, has set one. These three stay
    ignored if the process was started to ignore them, like the background jobs of a script.

    After the work, the block may do something that must not be cut off, such as writing results;
    after that, :meth:`obey` raises the exception for a signal that has come.

    Args:
        every_s: the seconds from one save to the next.
        clock: returns the seconds since a fixed moment.
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
        """Mark the block as work that can be saved, so that :meth:`save_now` waits for the save."""
        self._watched = True
        try:
            yield
        finally:
            self._watched = False

    @property
    def ending(self) -> bool:
        """True if a signal has asked for the end of the work."""
        return bool(self._ends_by)

    def due(self) -> bool:
        """Return True if a save is due: asked for by a signal, or after ``every_s`` seconds."""
        return self._asked or self.ending or self._clock() - self._last_s >= self._every_s

    def saved(self) -> None:
        """Record that everything is saved.

        Raises:
            Interrupted: if a signal has asked for the end of the work.
        """
        self._end_save(well=True)
        self.obey()

    def obey(self) -> None:
        """End the work if a signal has asked for it; everything must be saved or finished by now.

        Raises:
            Interrupted: if a signal has asked for the end of the work.
        """
        if self._ends_by:
            raise Interrupted(self._ends_by)

    def failed(self, error: OSError) -> None:
        """Record that the save failed; the next is due after ``every_s`` seconds or at a signal.

        Raises:
            Lost: if a signal has asked for the end of the work.
        """
        self._end_save(well=False)
        if self._ends_by:
            raise Lost(self._ends_by, error) from error

    def save_now(self, timeout_s: float) -> bool:
        """Ask the working threads for a save, and wait for it.

        Returns:
            True if the work was saved; False if the save failed or took longer than ``timeout_s``,
            or if no work is going on.
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
            number = getattr(signal, name, None)  # Windows lacks some
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
