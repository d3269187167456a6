"""A line of a file of rules as words and numbers, each with its place."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite, isnan

from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices, shown

_TOKEN = re.compile(r"[^\s,:()\[\]]+|[,:()\[\]]")


@dataclass(frozen=True)
class Token:
    """A piece of a line without spaces."""

    text: str
    place: Place

    def error(self, message: str) -> RulesError:
        """The error of this token, which it shows."""
        return self.place.error(f"{shown(self.text)}: {message}")


class Tokens:
    """The pieces of a line, taken one after the other.

    Args:
        text: the line.
        place: where it begins.
    """

    def __init__(self, text: str, place: Place) -> None:
        self._all = [
            Token(match.group(), Place(place.file, place.line, place.column + match.start()))
            for match in _TOKEN.finditer(text)
        ]
        self._next = 0
        self._end = Place(place.file, place.line, place.column + len(text.rstrip()))

    def peek(self) -> str:
        """The next piece's text; empty at the end."""
        return self._all[self._next].text if self._next < len(self._all) else ""

    def take(self, expected: str) -> Token:
        """The next piece.

        Args:
            expected: what it should be, for the message if there is none.
        """
        if self._next == len(self._all):
            raise self._end.error(f"the line ends here; expected {expected}")
        self._next += 1
        return self._all[self._next - 1]

    def word(self, *words: str) -> Token:
        """The next piece, which must be one of these words; their case doesn't matter."""
        token = self.take(" or ".join(words))
        if token.text.lower() not in words:
            raise token.error(f"expected {' or '.join(words)}")
        return token

    def one_of(self, names: Iterable[str], what: str) -> Token:
        """The next piece, which must be one of these names, as they are written.

        Args:
            names: the names.
            what: they name, for the message.
        """
        known, token = [*names], self.take(what)
        if token.text not in known:
            raise token.error(f"no such {what}; {choices(token.text, known)}")
        return token

    def number(self, what: str = "a number", *, finite: bool = True) -> float:
        """The next piece, which must be a number."""
        token = self.take(what)
        return number(token, what, finite=finite)

    def numbers(self) -> list[float]:
        """All numbers up to the end."""
        found = []
        while self.peek():
            found.append(self.number())
        return found

    def end(self) -> None:
        """Refuse what is left of the line."""
        if self._next < len(self._all):
            raise self._all[self._next].error("expected the end of the line")


def number(token: Token, what: str = "a number", *, finite: bool = True) -> float:
    """The number that a token is.

    Raises:
        RulesError: it is none, or isn't finite where it must be.
    """
    if len(token.text) > 400 or "_" in token.text:
        raise token.error(f"expected {what}")
    try:
        value = float(token.text)
    except ValueError:
        raise token.error(f"expected {what}") from None
    if isnan(value) or (finite and not isfinite(value)):
        raise token.error(f"expected {what}, a finite one")
    return value
