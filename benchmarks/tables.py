"""Markdown tables that read well in a terminal too."""

from collections.abc import Iterable, Sequence
from statistics import median

NOT_MEASURED = "not measured"


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown: the first column is text, the others are numbers."""
    widths = [max(map(len, column)) for column in zip(columns, *rows, strict=True)]
    rule = ["-" * widths[0], *("-" * (width - 1) + ":" for width in widths[1:])]

    def line(cells: Sequence[str]) -> str:
        first, *others = zip(cells, widths, strict=True)
        padded = [first[0].ljust(first[1]), *(cell.rjust(width) for cell, width in others)]
        return f"| {' | '.join(padded)} |"

    return "\n".join(map(line, (columns, rule, *rows)))


def spread(values: Sequence[float]) -> str:
    """Return the median, with the smallest and the largest value if there are several."""
    if not values:
        return NOT_MEASURED
    middle = short(median(values))
    return f"{middle} ({short(min(values))}–{short(max(values))})" if len(values) > 1 else middle


def median_of(values: Iterable[float]) -> float:
    """Return the median of values, or 0 if there are none."""
    return median([*values] or [0])


def ratio(values: Sequence[float], others: Sequence[float]) -> str:
    """Return the median of ``values`` divided by the median of ``others``, in words."""
    return short(median(values) / median(others)) if values and others else NOT_MEASURED


def short(value: float) -> str:
    """Return a number with about three digits, but with all digits before the decimal point."""
    digits = next((n for n, bound in ((3, 1), (2, 10), (1, 100)) if value < bound), 0)
    return f"{value:,.{digits}f}"


def in_bytes(count: float) -> str:
    """Return a number of bytes in words, in MB from 100,000 bytes on."""
    return f"{count:,.0f} B" if count < 1e5 else f"{count / 1e6:,.1f} MB"
