"""Argument parsers that report a mistake in one line."""

import difflib
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from fnnq_torchrl.launch.interrupted import leave_interrupted
from fnnq_torchrl.launch.streams import lasting_streams, one_line


class OneLineParser(ArgumentParser):
    """A parser that reports an error in one line, without usage text, and exits with status 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{one_line(message)}\n")


def read_words(program: str, description: str | None, keys: Iterable[str]) -> dict[str, str]:
    """Read a command line of words ``key=value``; a mistake is one line, and the exit status 2.

    Args:
        program: the command.
        description: for ``--help``.
        keys: what may be set; ``explain.`` is any key that begins with it.
    """
    form = RawDescriptionHelpFormatter
    parser = OneLineParser(program, description=description, formatter_class=form)
    parser.add_argument("words", nargs="*", metavar="key=value")
    known, values = [*keys], dict[str, str]()
    for word in parser.parse_args().words:
        key, equals, value = word.partition("=")
        if not equals:
            parser.error(f"{word}: can't be read as key=value")
        if not any(key == each or (each.endswith(".") and key.startswith(each)) for each in known):
            near = difflib.get_close_matches(key, known, n=1)
            advice = f"did you mean {near[0]}?" if near else f"there is {', '.join(known)}"
            parser.error(f"{word}: there is no {key}; {advice}")
        if key in values:
            parser.error(f"{word}: {key} is there twice")
        values[key] = value
    return values


def page_parser(program: str, description: str | None) -> OneLineParser:
    """Return the parser of a command that reads result files and writes a page of ``docs``."""
    parser = OneLineParser(program, description=description)
    parser.add_argument("--results", type=Path, default=Path("outputs"), help="default: outputs")
    parser.add_argument("--to", type=Path, default=Path("docs"), help="default: docs")
    return parser


@contextmanager
def one_line_errors() -> Iterator[None]:
    """End a command that reads result files with one line and status 1, if the block fails.

    After Ctrl-C, the status is 130.
    """
    with lasting_streams():
        try:
            yield
        except (OSError, ValueError) as error:
            sys.exit(one_line(error))
        except KeyboardInterrupt:
            leave_interrupted()
