"""Split a line of a file of rules into tokens with their places."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import isfinite, isnan

from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices, shown

_TOKEN = re.compile(r"[^\s,:()\[\]]+|[,:()\[\]]")


@dataclass(frozen=True)
class Token:
    """A piece of a line without spaces, and its place."""

    text: str
    place: Place

    def error(self, message: str) -> RulesError:
        """Return an error whose message gives the token's place and text."""
        return self.place.error(f"{shown(self.text)}: {message}")


class Tokens:
    """The tokens of a line, read one after the other.

    Args:
        text: the line.
        place: the place where the line begins.
    """

    def __init__(self, text: str, place: Place) -> None:
        self._all = [
            Token(match.group(), Place(place.file, place.line, place.column + match.start()))
            for match in _TOKEN.finditer(text)
        ]
        self._next = 0
        self._end = Place(place.file, place.line, place.column + len(text.rstrip()))

    def peek(self) -> str:
        """Return the next token's text without consuming it; an empty text at the end."""
        return self._all[self._next].text if self._next < len(self._all) else ""

    def take(self, expected: str) -> Token:
        """Read the next token.

        Args:
            expected: the expected token in words, for the message if the line ends here.
        """
        if self._next == len(self._all):
            raise self._end.error(f"the line ends here; expected {expected}")
        self._next += 1
        return self._all[self._next - 1]

    def word(self, *words: str) -> Token:
        """Read the next token, which must be one of these lower-case words in any case."""
        token = self.take(" or ".join(words))
        if token.text.lower() not in words:
            raise token.error(f"expected {' or '.join(words)}")
        return token

    def one_of(self, names: Iterable[str], what: str) -> Token:
        """Read the next token, which must be one of these names in the same case.

        Args:
            names: the names.
            what: the kind of thing that they name, for the message.
        """
        known, token = [*names], self.take(what)
        if token.text not in known:
            raise token.error(f"no such {what}; {choices(token.text, known)}")
        return token

    def number(self, what: str = "a number", *, finite: bool = True) -> float:
        """Read the next token, which must be a number."""
        token = self.take(what)
        return number(token, what, finite=finite)

    def numbers(self) -> list[float]:
        """Read all tokens up to the end, which must be numbers."""
        found = []
        while self.peek():
            found.append(self.number())
        return found

    def end(self) -> None:
        """Check that the line ends here."""
        if self._next < len(self._all):
            raise self._all[self._next].error("expected the end of the line")


def number(token: Token, what: str = "a number", *, finite: bool = True) -> float:
    """Convert a token to a number.

    Raises:
        RulesError: if it isn't a number, is NaN, or is infinite although ``finite`` is set.
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
