"""Whether a claim holds, over so many runs and in how many samples of that size."""

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
from .pool import Pool, same_seeds

MATTERS = 0.1
"""A difference of fewer catches than this, of five, is as good as none. Ours, not the paper's."""


class Verdict(Enum):
    """What the runs say to a claim."""

    HOLDS = "holds"
    BARELY = f"holds, perhaps by less than {MATTERS} catches"
    PART = "holds in part"
    FAILS = "does not hold"
    OPEN = "can't be told"


@dataclass(frozen=True)
class Compared:
    """A comparison over some runs."""

    runs: int
    ours: Interval
    theirs: Interval
    ours_iqm: float
    theirs_iqm: float
    difference: Difference
    verdict: Verdict


def verdict(low: float, high: float, expected: Expected) -> Verdict:
    """What the confidence interval of a difference says to what is expected of it.

    * more: it holds if the whole interval lies above 0, barely if it has differences that don't
      matter, and does not if it has none that does; less is its mirror image.
    * the same: it holds if the interval has no difference that matters, and does not if it has
      nothing else; another is its opposite.

    An unknown interval, NaN, says nothing.
    """
    if expected is Expected.LESS:
        return verdict(-high, -low, Expected.MORE)
    if expected is Expected.MORE:
        if low > 0:
            return Verdict.HOLDS if low >= MATTERS else Verdict.BARELY
        return Verdict.FAILS if high < MATTERS else Verdict.OPEN
    if low > -MATTERS and high < MATTERS:
        return Verdict.HOLDS if expected is Expected.SAME else Verdict.FAILS
    if low >= MATTERS or high <= -MATTERS:
        return Verdict.FAILS if expected is Expected.SAME else Verdict.HOLDS
    return Verdict.OPEN


def compare(pool: Pool, comparison: Comparison, also: Settings, runs: int | None) -> Compared:
    """Compare two configurations over their first runs.

    Args:
        pool: where the jobs are.
        comparison: what to compare.
        also: settings that both sides have besides their own.
        runs: how many; all that both have, if not given.

    Raises:
        NoResults: a job is missing, or has fewer runs.
    """
    ours, theirs = _scores(pool, comparison, also, runs)
    difference = paired_difference(ours, theirs)
    _, low, high = difference.mean
    return Compared(
        runs=ours.size,
        ours=bootstrap_interval(np.mean, ours),
        theirs=bootstrap_interval(np.mean, theirs),
        ours_iqm=float(interquartile_mean(ours)),
        theirs_iqm=float(interquartile_mean(theirs)),
        difference=difference,
        verdict=verdict(low, high, comparison.expected),
    )


def together(found: list[Verdict]) -> Verdict:
    """The verdict on a claim of several comparisons: it holds if all do, in part if some do."""
    if Verdict.FAILS in found and {Verdict.HOLDS, Verdict.BARELY} & {*found}:
        return Verdict.PART
    for worst in (Verdict.FAILS, Verdict.OPEN, Verdict.BARELY):
        if worst in found:
            return worst
    return Verdict.HOLDS


def quick_verdict(pool: Pool, claim: Claim, also: Settings) -> tuple[Verdict, int]:
    """The verdict over all runs by Student's t intervals, and how many runs those are.

    Raises:
        NoResults: a job is missing.
    """
    found, runs = [], []
    for comparison in claim.comparisons:
        ours, theirs = _scores(pool, comparison, also, None)
        _, low, high = mean_interval(ours - theirs)
        found.append(verdict(float(low), float(high), comparison.expected))
        runs.append(ours.size)
    return together(found), min(runs)


def verdict_shares(pool: Pool, claim: Claim, runs: int) -> tuple[int, dict[Verdict, float]]:
    """In how many samples of so many runs each verdict would have been reached.

    The runs are cut into as many samples as they give; the intervals are Student's t.

    Returns:
        The number of samples, and the shares.

    Raises:
        NoResults: a job is missing, or has fewer runs.
    """
    by_comparison = []
    for comparison in claim.comparisons:
        _scores(pool, comparison, {}, runs)  # are there so many?
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
