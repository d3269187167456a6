"""Verdicts on claims, from all runs, from the first runs, and from many samples of the runs."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import NoResults
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import (
    Difference,
    Interval,
    bootstrap_interval,
    interquartile_mean,
    paired_difference,
)
from fnnq_torchrl.training.intervals import mean_interval

from .claims import Claim, Comparison, Expected, Settings
from .markdown import interval_words
from .pool import Pool, same_seeds

MATTERS = 0.1
"""The smallest difference, in catches of five, that matters. It is our choice, not the paper's."""


class Verdict(Enum):
    """The verdict of the runs on a claim."""

    HOLDS = "holds"
    BARELY = "holds, perhaps by less than {}"
    PART = "holds in part"
    FAILS = "does not hold"
    OPEN = "can't be told"

    def words(self, least: str = f"{MATTERS} catches") -> str:
        """Return the verdict in words.

        Args:
            least: the smallest difference that matters, in words.
        """
        return self.value.format(least)


@dataclass(frozen=True)
class Compared:
    """The results of a comparison over some runs."""

    runs: int
    ours: Interval
    theirs: Interval
    ours_iqm: float
    theirs_iqm: float
    difference: Difference
    verdict: Verdict


def verdict(low: float, high: float, expected: Expected, matters: float = MATTERS) -> Verdict:
    """Return the verdict on an expected difference, from the confidence interval of the difference.

    * MORE holds if the interval lies above 0, and holds barely if a part of it is below
      ``matters``. It fails if the interval reaches 0 and lies below ``matters``. LESS is the mirror
      image.
    * SAME holds if the interval lies within ±``matters``, and fails if it lies wholly outside.
      OTHER is the opposite.

    In all other cases, and if the interval is unknown (NaN), the verdict is open.

    Args:
        low, high: the bounds of the interval.
        expected: the claimed result.
        matters: the smallest difference that matters.
    """
    if expected is Expected.LESS:
        return verdict(-high, -low, Expected.MORE, matters)
    if expected is Expected.MORE:
        if low > 0:
            return Verdict.HOLDS if low >= matters else Verdict.BARELY
        return Verdict.FAILS if high < matters else Verdict.OPEN
    if low > -matters and high < matters:
        return Verdict.HOLDS if expected is Expected.SAME else Verdict.FAILS
    if low >= matters or high <= -matters:
        return Verdict.FAILS if expected is Expected.SAME else Verdict.HOLDS
    return Verdict.OPEN


def in_a_word(difference: Interval, matters: float = MATTERS) -> str:
    """Return *(slightly) more*, *(slightly) less*, *same* or *open* for a difference, by `verdict`.

    *Slightly* more or less: there is a difference, but perhaps a smaller one than ``matters``.
    """
    _, low, high = difference
    if verdict(low, high, Expected.SAME, matters) is Verdict.HOLDS:
        return "same"
    for expected in (Expected.MORE, Expected.LESS):
        found = verdict(low, high, expected, matters)
        if found is Verdict.HOLDS:
            return expected.value
        if found is Verdict.BARELY:
            return f"slightly {expected.value}"
    return "open"


def compared_words(difference: Interval, matters: float = MATTERS) -> str:
    """Return a difference with its interval and its word, such as ``+0.2 [+0.1, +0.3] more``."""
    return f"{interval_words(difference, signed=True)} {in_a_word(difference, matters)}"


def compare(pool: Pool, comparison: Comparison, also: Settings, runs: int | None) -> Compared:
    """Compare two configurations over their first runs.

    Args:
        pool: the jobs.
        comparison: the comparison to make.
        also: settings that both sides have in addition to their own.
        runs: the number of runs; None for all runs that both sides have.

    Raises:
        NoResults: if a job is missing, or has fewer runs.
    """
    ours, theirs = _scores(pool, comparison, also, runs)
    return compare_runs(ours, theirs, comparison.expected)


def compare_runs(
    ours: NDArray[np.float64],
    theirs: NDArray[np.float64],
    expected: Expected,
    matters: float = MATTERS,
) -> Compared:
    """Compare the numbers of two configurations' runs over the same seeds.

    Args:
        ours, theirs: one number for each run, ``[runs]``.
        expected, matters: as in `verdict`.
    """
    difference = paired_difference(ours, theirs)
    _, low, high = difference.mean
    return Compared(
        runs=ours.size,
        ours=bootstrap_interval(np.mean, ours),
        theirs=bootstrap_interval(np.mean, theirs),
        ours_iqm=float(interquartile_mean(ours)),
        theirs_iqm=float(interquartile_mean(theirs)),
        difference=difference,
        verdict=verdict(low, high, expected, matters),
    )


def together(found: list[Verdict]) -> Verdict:
    """Return the verdict on a claim from the verdicts on its comparisons.

    The claim holds if all comparisons hold, and holds in part if some hold and some fail. Otherwise
    its verdict is the worst of theirs.
    """
    if Verdict.FAILS in found and {Verdict.HOLDS, Verdict.BARELY} & {*found}:
        return Verdict.PART
    for worst in (Verdict.FAILS, Verdict.OPEN, Verdict.BARELY):
        if worst in found:
            return worst
    return Verdict.HOLDS


def quick_verdict(pool: Pool, claim: Claim, also: Settings) -> tuple[Verdict, int]:
    """Return the verdict over all runs by Student's t intervals, and the number of those runs.

    Raises:
        NoResults: if a job is missing.
    """
    found, runs = [], []
    for comparison in claim.comparisons:
        ours, theirs = _scores(pool, comparison, also, None)
        _, low, high = mean_interval(ours - theirs)
        found.append(verdict(float(low), float(high), comparison.expected))
        runs.append(ours.size)
    return together(found), min(runs)


def verdict_shares(pool: Pool, claim: Claim, runs: int) -> tuple[int, dict[Verdict, float]]:
    """Return the shares of the verdicts in samples of a given number of runs.

    All runs are cut into samples of this size. The intervals are Student's t.

    Args:
        pool: the jobs.
        claim: the claim to judge.
        runs: the number of runs in a sample.

    Returns:
        The number of samples, and each verdict's share of the samples.

    Raises:
        NoResults: if a job is missing, or has fewer runs.
    """
    by_comparison = []
    for comparison in claim.comparisons:
        _scores(pool, comparison, {}, runs)  # raises if there are fewer runs
        ours, theirs = _scores(pool, comparison, {}, None)
        samples = (ours - theirs)[: ours.size // runs * runs].reshape(-1, runs)
        _, low, high = mean_interval(samples, axis=1)
        bounds = zip(low.tolist(), high.tolist(), strict=True)
        by_comparison.append([verdict(*interval, comparison.expected) for interval in bounds])
    of_samples = [together(list(found)) for found in zip(*by_comparison, strict=True)]
    shares = {each: of_samples.count(each) / len(of_samples) for each in Verdict}
    return len(of_samples), shares


def _scores(
    pool: Pool, comparison: Comparison, also: Settings, runs: int | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    jobs = [pool.job({**also, **own}) for own in (comparison.ours, comparison.theirs)]
    most = same_seeds(jobs)
    if runs is not None and runs > most:
        raise NoResults(f"there are {most:,} runs to compare, fewer than {runs:,}")
    measure = MEASURES[comparison.measure].of
    ours, theirs = (measure(job.evaluations)[: runs or most] for job in jobs)
    return ours, theirs
