"""Being interrupted: by the clock, to save what is done, and by signals, to end after that."""

import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Self

SAVING = ("SIGUSR1", "SIGUSR2")
"""Signals that ask for a save, after which the work goes on; Slurm's warning."""

_END = ("SIGTERM", "SIGINT")  # save and end

_NOBODY = (signal.SIG_DFL, signal.SIG_IGN, signal.default_int_handler)
"""Who answers a signal that nobody does."""


class Interrupted(Exception):
    """A signal has ended the work, which is saved.

    Args:
        number: the signal's.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.status = 128 + number
        """For the process to exit with."""

    def __str__(self) -> str:
        name = signal.Signals(self.args[0]).name
        return f"{name}: what is done so far is saved; in the same directory, it goes on from there"


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
    """Says when to save and when to end, within a ``with`` block.

    In it, SIGUSR1 and SIGUSR2 make a save due; SIGTERM and SIGINT too, and end the work after it. A
    second SIGTERM or SIGINT ends it at once. Signals that somebody else answers already, such as
    submitit, are left to them, and so are all outside the main thread.

    What is not to be cut off, as the writing of results, can be done in the block too:
    :meth:`obey` is for after it.

    Args:
        every_s: seconds from one save to the next.
        clock: tells the seconds, from any start.
    """

    current: "Interruptions | None" = None
    """Those of which somebody looks whether they are due."""

    def __init__(self, every_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._every_s, self._clock = every_s, clock
        self._last_s = clock()
        self._asked, self._ends_by = False, 0
        self._answered, self._well = threading.Event(), False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            for name in (*SAVING, *_END):
                number = getattr(signal, name, None)
                if number is not None and signal.getsignal(number) in _NOBODY:
                    self._before[number] = signal.signal(number, self._answer)
        return self

    def __exit__(self, *exception: object) -> None:
        self._restore()

    @contextmanager
    def watched(self) -> Iterator[None]:
        """A block within which somebody saves when it is due, as :meth:`save_now` needs."""
        Interruptions.current = self
        try:
            yield
        finally:
            Interruptions.current = None

    @property
    def ending(self) -> bool:
        """Whether the work is to end."""
        return bool(self._ends_by)

    def due(self) -> bool:
        """Whether it is time to save."""
        return self._asked or self.ending or self._clock() - self._last_s >= self._every_s

    def saved(self) -> None:
        """Everything is saved.

        Raises:
            Interrupted: it was to be saved because the work is to end.
        """
        self._end_save(well=True)
        self.obey()

    def obey(self) -> None:
        """Everything is saved, or needs no saving, because it is finished.

        Raises:
            Interrupted: the work is to end.
        """
        if self._ends_by:
            raise Interrupted(self._ends_by)

    def failed(self, error: OSError) -> None:
        """It couldn't be saved. It is due again after an interval, or when a signal asks.

        Raises:
            Lost: it was to be saved because the work is to end.
        """
        self._end_save(well=False)
        if self._ends_by:
            raise Lost(self._ends_by, error) from error

    def save_now(self, timeout_s: float) -> bool:
        """Ask for a save, from the main thread, and wait; false if it fails or takes too long."""
        self._answered.clear()
        self._asked = True
        return self._answered.wait(timeout_s) and self._well

    def _end_save(self, *, well: bool) -> None:
        self._last_s, self._asked, self._well = self._clock(), False, well
        self._answered.set()

    def _answer(self, number: int, frame: FrameType | None) -> None:
        self._asked = True
        if signal.Signals(number).name in _END:
            self._ends_by = number
            self._restore()

    def _restore(self) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        self._before.clear()
