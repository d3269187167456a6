"""Command lines whose mistakes are told in one line."""

from argparse import ArgumentParser
from pathlib import Path
from typing import NoReturn


class OneLineParser(ArgumentParser):
    """A parser that says what is wrong without its page on usage; the exit status is 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{' '.join(message.split())}\n")


def page_parser(program: str, description: str | None) -> OneLineParser:
    """Return the parser of a command that writes a page of ``docs`` from experiments' results."""
    parser = OneLineParser(program, description=description)
    parser.add_argument("--results", type=Path, default=Path("outputs"), help="default: outputs")
    parser.add_argument("--to", type=Path, default=Path("docs"), help="default: docs")
    return parser
