"""A part of docs/adaptive.md."""

from typing import NamedTuple


class Part(NamedTuple):
    """A part of the page: its conclusions for the page's beginning, and its sections.

    Attributes:
        conclusions: sentences, each a line of the list at the page's beginning.
        text: the sections in Markdown, with headings of the second level and below.
    """

    conclusions: list[str]
    text: str
