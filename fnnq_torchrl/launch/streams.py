"""Standard streams that stay usable when the pipe or the log behind them is gone."""

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import IO, Any


class LastingStream:
    """A text stream to which writing never fails: text that can't be written is dropped.

    Libraries write to standard streams, too. Some turn a failed write into an exit (rich) or a
    traceback in a thread, so the error must not reach them.

    Args:
        stream: the stream behind it.

    Attributes:
        error: the first error of a write; None if there was none.
    """

    def __init__(self, stream: IO[str]) -> None:
        self._stream = stream
        self.error: OSError | None = None

    def write(self, text: str) -> int:
        """Write a text, or drop it."""
        try:
            self._stream.write(text)
        except OSError as error:
            self.error = self.error or error
        return len(text)

    def flush(self) -> None:
        """Write the texts so far, or drop them."""
        try:
            self._stream.flush()
        except OSError as error:
            self.error = self.error or error

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def one_line(message: object) -> str:
    """Return a message as one line of printable characters; others are shown as escapes.

    A file from elsewhere must not control the terminal by what an error quotes from it.
    """
    line = " ".join(str(message).split())
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in line)


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Let the block write to standard output and standard error whether or not anybody reads.

    A stream that was closed when the program started is the null device in the block. If standard
    output has lost text although the block ends well, the program ends with one line and status 1.
    """
    with ExitStack() as stack:
        # The null device takes the free descriptor, which the next file would have taken.
        out, err = (
            LastingStream(stream or stack.enter_context(open(os.devnull, "w")))
            for stream in (sys.stdout, sys.stderr)
        )
        stack.enter_context(redirect_stdout(out))
        stack.enter_context(redirect_stderr(err))
        yield
        out.flush()
        if out.error is not None:
            err.write(f"standard output: {out.error.strerror}\n")
            sys.exit(1)
