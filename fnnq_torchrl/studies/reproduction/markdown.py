"""Numbers and tables of a page, in Markdown."""

from collections.abc import Iterable, Sequence

import numpy as np

from fnnq_torchrl.studies.statistics import Interval


def interval_words(interval: Interval, signed: bool = False) -> str:
    """Return "4.57 [4.42, 4.71]", or the value alone where its interval is unknown.

    Args:
        interval: the interval of a score or of a difference.
        signed: whether positive numbers have a sign too, as those of a difference.
    """
    value, low, high = interval
    digits = 2 if not np.isfinite(low) or high - low > 0.05 else 3
    sign = "+" if signed else ""
    bounds = f" [{low:{sign}z.{digits}f}, {high:{sign}z.{digits}f}]" if np.isfinite(low) else ""
    return f"{value:{sign}z.{digits}f}{bounds}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table. Each row has as many cells as the head."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
