"""What is wrong with a file of rules, and where."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

from envs.core.parameters import ConfigError


class RulesError(ConfigError):
    """A rule base, or a file of one, that isn't what it should be; its text is one line."""


@dataclass(frozen=True)
class Place:
    """A place in a file, for messages: ``FILE:line:column``, the line and the column from 1."""

    file: str
    line: int
    column: int = 1

    def error(self, message: str) -> RulesError:
        """The error of this place."""
        return RulesError(f"{self}: {message}")

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


def shown(text: object) -> str:
    """A piece of a file as a message may hold it: short, on one line, and printable."""
    line = ascii(text) if isinstance(text, str) else ascii(str(text))
    return line if len(line) <= 60 else f"{line[:56]}...{line[-1]}"


def choices(given: str, known: Iterable[str]) -> str:
    """What could have stood there: the nearest spelling, or else all of it."""
    names = [name if name.isprintable() else shown(name) for name in known]
    if near := difflib.get_close_matches(given[:64], names, n=1):
        return f"did you mean {near[0]}?"
    return f"expected {' or '.join(names[:12])}{' …' if len(names) > 12 else ''}"
