"""Command lines whose mistakes are told in one line."""

from argparse import ArgumentParser
from typing import NoReturn


class OneLineParser(ArgumentParser):
    """Says what is wrong with the arguments without its page on usage; the exit status is 2."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{' '.join(message.split())}\n")
