"""Argument parsers that report a mistake in one line."""

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from envs.core.parameters import ConfigError
from fnnq_torchrl.launch.interrupted import leave_interrupted
from fnnq_torchrl.launch.streams import lasting_streams, one_line
from fnnq_torchrl.launch.words import parse


class OneLineParser(ArgumentParser):
    """A parser that reports an error in one line, without usage text, and exits with status 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{one_line(message)}\n")


def read_words(program: str, description: str | None, keys: Iterable[str]) -> dict[str, str]:
    """Read a command line of words ``key=value``; a mistake is one line, and the exit status 2.

    Args:
        program: the command.
        description: for ``--help``.
        keys: the keys that there are, as in :func:`.parse`.
    """
    parser = _words_parser(program, description, "key=value")
    try:
        return parse(parser.parse_args().words, keys)
    except ConfigError as error:
        parser.error(str(error))


def read_places(
    program: str, description: str | None, keys: Iterable[str]
) -> tuple[list[Path], dict[str, str]]:
    """Read a command line of directories and words ``key=value``, as :func:`read_words` does.

    A word without ``=`` is a directory, and so is a word that names one.

    Returns:
        The directories, by default ``outputs``, and the value of each key.
    """
    parser = _words_parser(program, description, "DIR or key=value")
    words = parser.parse_args().words
    places = [word for word in words if "=" not in word or Path(word).is_dir()]
    try:
        values = parse([word for word in words if word not in places], keys)
    except ConfigError as error:
        parser.error(str(error))
    return [*map(Path, places or ["outputs"])], values


def _words_parser(program: str, description: str | None, metavar: str) -> OneLineParser:
    form = RawDescriptionHelpFormatter
    parser = OneLineParser(program, description=description, formatter_class=form)
    parser.add_argument("words", nargs="*", metavar=metavar)
    return parser


def page_parser(program: str, description: str | None) -> OneLineParser:
    """Return the parser of a command that reads result files and writes a page of ``docs``."""
    parser = OneLineParser(program, description=description)
    parser.add_argument("--results", type=Path, default=Path("outputs"), help="default: outputs")
    parser.add_argument("--to", type=Path, default=Path("docs"), help="default: docs")
    return parser


_WRONG_NAMES = (FileNotFoundError, IsADirectoryError, NotADirectoryError)


@contextmanager
def one_line_errors() -> Iterator[None]:
    """End a command with one line on stderr and an exit status, if the block fails.

    The status is 2 if the user can mend the command: a wrong value, a file that doesn't exist or is
    damaged. It is 1 if the machine failed, for instance if a disk is full, and 130 after Ctrl-C.
    """
    with lasting_streams():
        try:
            yield
        except (OSError, ValueError) as error:
            mistake = isinstance(error, (ValueError, *_WRONG_NAMES))
            sys.stderr.write(f"{one_line(error)}\n")
            sys.exit(2 if mistake else 1)
        except KeyboardInterrupt:
            leave_interrupted()
