"""Errors in files of rules, with their place."""

import difflib
from collections.abc import Iterable
from dataclasses import dataclass

from envs.core.parameters import ConfigError


class RulesError(ConfigError):
    """An error in a rule base or in a file of rules; its message is one line."""


@dataclass(frozen=True)
class Place:
    """A place in a file, for messages: ``FILE:line:column``; both count from 1."""

    file: str
    line: int
    column: int = 1

    def error(self, message: str) -> RulesError:
        """Return an error whose message starts with this place."""
        return RulesError(f"{self}: {message}")

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"


def shown(text: object) -> str:
    """Return text from a file in a form for messages: short, printable, on one line."""
    line = ascii(text) if isinstance(text, str) else ascii(str(text))
    return line if len(line) <= 60 else f"{line[:56]}...{line[-1]}"


def choices(given: str, known: Iterable[str]) -> str:
    """Return a hint for messages: the known name with the nearest spelling, or all known names."""
    names = [name if name.isprintable() else shown(name) for name in known]
    if near := difflib.get_close_matches(given[:64], names, n=1):
        return f"did you mean {near[0]}?"
    return f"expected {' or '.join(names[:12])}{' …' if len(names) > 12 else ''}"
