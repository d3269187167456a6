"""Numbers and tables of a page, in Markdown."""

from collections.abc import Iterable, Sequence

import numpy as np

from fnnq_torchrl.studies.statistics import Interval


def interval_words(interval: Interval, signed: bool = False) -> str:
    """«4.57 [4.42, 4.71]», or the value alone where its interval isn't known.

    Args:
        interval: of scores or their differences.
        signed: with a sign even where it is positive, as a difference has.
    """
    value, low, high = interval
    digits = 2 if not np.isfinite(low) or high - low > 0.05 else 3
    sign = "+" if signed else ""
    bounds = f" [{low:{sign}z.{digits}f}, {high:{sign}z.{digits}f}]" if np.isfinite(low) else ""
    return f"{value:{sign}z.{digits}f}{bounds}"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table, each row as long as its head."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
