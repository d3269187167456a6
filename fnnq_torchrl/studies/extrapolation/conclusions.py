"""Conclusions from the intervals, in sentences."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.reproduction.markdown import interval_words
from fnnq_torchrl.studies.reproduction.verdicts import Verdict
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference

from .findings import Findings
from .forgetting import FirstSide
from .playing import TESTS

MOVES = 0.1
"""The smallest movement of Q, per unit of the seen side, that counts as one. It is our choice."""

CATCHES = 0.5
"""The smallest difference, in catches of all tests of a side, that matters. It is our choice."""


def above(interval: Interval, bound: float) -> Verdict:
    """Return the verdict on "more than a bound": all of the interval, none of it, or neither."""
    if interval.low > bound:
        return Verdict.HOLDS
    return Verdict.FAILS if interval.high <= bound else Verdict.OPEN


def moved(findings: Findings) -> Interval:
    """Return the mean movement on the unseen side, per unit of the seen side."""
    return bootstrap_interval(np.mean, findings.moved_in(findings.where.unseen))


def movement_words(interval: Interval) -> str:
    """Return a movement of Q in words, which follow "its Q"."""
    if interval.high < MOVES:
        return "stayed where it was"
    if interval.low >= 1:
        return "moved farther than where it learned"
    if interval.low >= 0.5:
        return "moved more than half as far as where it learned"
    if interval.low >= MOVES and interval.high < 0.5:
        return "moved, but less than half as far as where it learned"
    return "may have moved or not" if interval.low < MOVES else "moved, by how much can't be told"


def difference_words(interval: Interval, more: str, less: str) -> str:
    """Return a difference in catches in words: more, less, none that matters, or unknown."""
    if interval.low >= CATCHES:
        return more
    if interval.high <= -CATCHES:
        return less
    if interval.low > -CATCHES and interval.high < CATCHES:
        return "makes no difference that matters"
    return "may make a difference or not"


def conclusions(by_kind: Mapping[str, Findings]) -> list[str]:
    """Return the conclusions, one line each.

    They are on the paper's claims, on the network whose Q moves farther, and for each value
    function on what the movement does to catching.
    """
    local, other = by_kind["fnnq"], by_kind["mlp"]
    of_local, of_other = moved(local), moved(other)
    stays = {Verdict.HOLDS: Verdict.FAILS, Verdict.FAILS: Verdict.HOLDS}
    local_verdict = stays.get(above(of_local, MOVES), Verdict.OPEN)
    more = paired_difference(*_pairs(other, local)).mean
    order = {
        Verdict.HOLDS: "the MLP moves farther",
        Verdict.FAILS: "the fuzzy network moves farther",
        Verdict.OPEN: "which moves farther can't be told",
    }[above(more, 0)]
    lines = [
        f"The claim that the fuzzy network doesn't extrapolate **{local_verdict.value}**. Where it "
        f"had seen nothing, its Q {movement_words(of_local)}: {interval_words(of_local)}.",
        *(
            f"The claim that it is a local approximator with compact membership functions "
            f"**{stays.get(above(moved(findings), MOVES), Verdict.OPEN).value}** for `{kind}`. Its "
            f"Q there {movement_words(moved(findings))}: {interval_words(moved(findings))}."
            for kind, findings in by_kind.items()
            if kind.startswith("fnnq, ")
        ),
        f"The claim that the MLP does **{above(of_other, MOVES).value}**. Its Q there "
        f"{movement_words(of_other)}: {interval_words(of_other)}.",
        f"Of the two, {order}: MLP − fuzzy network {interval_words(more, signed=True)}, by pairs "
        "of seeds.",
    ]
    for kind, findings in by_kind.items():
        helped = bootstrap_interval(np.mean, findings.helped)
        kept = bootstrap_interval(np.mean, findings.first_side.kept)
        lines.append(
            f"`{kind}`: on the unseen side its Q {movement_words(moved(findings))}. For catching "
            f"there, this Q {difference_words(helped, 'helps', 'hurts')}: "
            f"{interval_words(helped, signed=True)} catches of {TESTS}, against random actions "
            "where nothing was seen. For catching on the first side, learning on the second "
            f"{difference_words(kept, 'helps', 'hurts: it forgets')}: "
            f"{interval_words(kept, signed=True)}."
        )
    return lines


def forgetting_conclusion(constant: Sequence[FirstSide]) -> str:
    """Return the conclusion on forgetting with a constant α, in one line."""
    told = []
    for each in constant:
        interval = bootstrap_interval(np.mean, each.kept)
        said = difference_words(interval, "helps", "hurts: it forgets")
        told.append(f"`{each.kind}` it {said} ({interval_words(interval, signed=True)})")
    return (
        "With a constant α, learning on the second side has this effect on catching on the first: "
        f"with {'; with '.join(told)}."
    )


def _pairs(one: Findings, other: Findings) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return both movements on the unseen side, for the seeds that diverged in neither."""
    seeds, others = (findings.sound.snapshots.seed.numpy() for findings in (one, other))
    return (
        one.moved_in(one.where.unseen)[np.isin(seeds, others)],
        other.moved_in(other.where.unseen)[np.isin(others, seeds)],
    )
