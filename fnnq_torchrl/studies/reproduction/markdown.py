"""Numbers and tables of a page, in Markdown."""

from collections.abc import Iterable, Sequence

import numpy as np

from fnnq_torchrl.studies.statistics import Interval


def interval_words(interval: Interval, signed: bool = False) -> str:
    """Return a value with its interval, as "4.57 [4.42, 4.71]", or alone if that is unknown.

    Args:
        interval: a score or a difference, with its interval.
        signed: True to write a plus sign before positive numbers, as for a difference.
    """
    value, low, high = interval
    digits = 2 if not np.isfinite(low) or high - low > 0.05 else 3
    sign = "+" if signed else ""
    bounds = f" [{low:{sign}z.{digits}f}, {high:{sign}z.{digits}f}]" if np.isfinite(low) else ""
    return f"{value:{sign}z.{digits}f}{bounds}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown. Each row has as many cells as the head."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
