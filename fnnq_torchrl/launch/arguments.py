"""Argument parsers that report a mistake in one line."""

from argparse import ArgumentParser
from pathlib import Path
from typing import NoReturn


class OneLineParser(ArgumentParser):
    """A parser that reports an error in one line, without usage text, and exits with status 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{' '.join(message.split())}\n")


def page_parser(program: str, description: str | None) -> OneLineParser:
    """Return the parser of a command that reads result files and writes a page of ``docs``."""
    parser = OneLineParser(program, description=description)
    parser.add_argument("--results", type=Path, default=Path("outputs"), help="default: outputs")
    parser.add_argument("--to", type=Path, default=Path("docs"), help="default: docs")
    return parser
