"""Standard streams that stay usable when the pipe or the log file behind them is gone."""

import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from typing import IO, Any


class LastingStream:
    """A text stream to which writing never fails: text that can't be written is dropped.

    Libraries write to standard streams, too. Some libraries turn a failed write into an exit (rich)
    or into a traceback in a thread, so a failed write must not raise.

    Args:
        stream: the stream that receives the text.

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
        """Flush the stream behind; text that can't be written is dropped."""
        try:
            self._stream.flush()
        except OSError as error:
            self.error = self.error or error

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def one_line(message: object) -> str:
    """Return a message as one line, with escapes in place of characters that aren't printable.

    An error may quote a file from somebody else. The quoted text must not control the terminal.
    """
    line = " ".join(str(message).split())
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in line)


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Make writing to standard output and standard error never fail in the block.

    If a stream was closed when the program started, the null device takes its place in the block.
    If the block succeeds but standard output has lost text, the program ends with one line on
    standard error and status 1.
    """
    with ExitStack() as stack:
        # Opening the null device also takes the free descriptor of a closed stream; otherwise the
        # next file would get that descriptor.
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
