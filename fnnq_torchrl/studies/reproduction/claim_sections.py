"""The sections of the page on single claims, and their summary."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import Difference

from .claims import CLAIMS, Claim, Comparison, Settings
from .markdown import interval_words, table
from .pool import Pool, default_settings, words
from .verdicts import (
    MATTERS,
    Compared,
    Verdict,
    compare,
    quick_verdict,
    together,
    verdict_shares,
)

PAPER_RUNS = 22
"""The number of runs behind each of the paper's means."""

IN_SHORT = ("fig2", "fig3", "decay")
"""The experiments with few runs that are enough to judge the claims."""


@dataclass(frozen=True)
class Judged:
    """A claim with its comparisons over the paper's number of runs, and over all runs."""

    claim: Claim
    few: list[Compared]
    whole: list[Compared]

    @property
    def over_few(self) -> Verdict:
        return together([each.verdict for each in self.few])

    @property
    def over_whole(self) -> Verdict:
        return together([each.verdict for each in self.whole])

    @property
    def most(self) -> int:
        """The number of runs that every comparison has at least."""
        return min(each.runs for each in self.whole)


def judge(pool: Pool, claim: Claim) -> Judged:
    """Judge a claim over the paper's number of runs and over all runs.

    Raises:
        NoResults: if a comparison lacks its jobs.
    """
    few, whole = (
        [compare(pool, comparison, {}, runs) for comparison in claim.comparisons]
        for runs in (PAPER_RUNS, None)
    )
    return Judged(claim, few, whole)


def counts(judged: Sequence[Judged]) -> str:
    """Return the number of claims with each verdict, in words."""
    few = counted([each.over_few for each in judged])
    whole = counted([each.over_whole for each in judged])
    return (
        f"The paper makes {len(judged)} claims about its experiment. Over all seeds {whole}. "
        f"Over {PAPER_RUNS} seeds, as many as the paper had, {few}."
    )


def counted(found: Sequence[Verdict], least: str = f"{MATTERS} catches") -> str:
    """Return how many verdicts are of each kind, as "4 hold; and 2 hold in part".

    Args:
        found: the verdicts.
        least: the smallest difference that matters, in words.
    """
    plural = {
        Verdict.HOLDS: "hold",
        Verdict.BARELY: Verdict.BARELY.words(least).replace("holds", "hold"),
        Verdict.PART: "hold in part",
        Verdict.FAILS: "do not hold",
        Verdict.OPEN: "can't be told",
    }
    numbers = {which: found.count(which) for which in Verdict if which in found}
    *others, last = (
        f"{number} {which.words(least) if number == 1 else plural[which]}"
        for which, number in numbers.items()
    )
    return f"{'; '.join(others)}; and {last}" if others else last


def summary(judged: Sequence[Judged]) -> str:
    """Return the table of all claims with their verdicts."""
    head = [
        "the paper says",
        "where",
        f"over {PAPER_RUNS} seeds",
        "over all",
        "differences over all",
    ]
    rows = []
    for each in judged:
        differences = (
            f"{words(comparison.ours)} − {words(comparison.theirs)}: "
            f"{interval_words(found.difference.mean, signed=True)}"
            for comparison, found in zip(each.claim.comparisons, each.whole, strict=True)
        )
        rows.append(
            [
                f"«{each.claim.words}»",
                each.claim.place,
                each.over_few.words(),
                f"{each.over_whole.words()} ({each.most:,})",
                "; ".join(differences),
            ]
        )
    return table(head, rows)


def claim_section(pool: Pool, judged: Judged) -> str:
    """Return a claim's section."""
    claim = judged.claim
    samples, shares = verdict_shares(pool, claim, PAPER_RUNS)
    parts = "; ".join(
        f"{each.words()}: {share:.0%}" for each, share in shares.items() if share >= 0.005
    )
    head = ["", "seeds", "first", "second", "difference", "d", "P", "n", "verdict"]
    rows = [
        _row(comparison, each)
        for found in (judged.few, judged.whole)
        for comparison, each in zip(claim.comparisons, found, strict=True)
    ]
    lines = [
        f"## «{claim.words}» ({claim.place})\n",
        f"We read: {claim.reading} **Over {PAPER_RUNS} seeds: {judged.over_few.words()}; "
        f"over {judged.most:,}: {judged.over_whole.words()}.**\n",
        table(head, rows),
        f"Verdicts of {samples:,} samples of {PAPER_RUNS} seeds each: {parts}.\n",
        _elsewhere(pool, claim),
    ]
    return "\n".join(lines)


def _row(comparison: Comparison, found: Compared) -> list[str]:
    """Return a comparison's row of a claim's table."""
    difference = found.difference
    return [
        _comparison(comparison),
        f"{found.runs:,}",
        f"{interval_words(found.ours)}, IQM {found.ours_iqm:.2f}",
        f"{interval_words(found.theirs)}, IQM {found.theirs_iqm:.2f}",
        interval_words(difference.mean, signed=True),
        f"{difference.effect:+.2f}",
        interval_words(difference.improvement),
        count_needed(difference),
        found.verdict.words(),
    ]


def _comparison(comparison: Comparison) -> str:
    measure = MEASURES[comparison.measure].words.partition(" (")[0]
    expected = comparison.expected.value
    ours, theirs = words(comparison.ours), words(comparison.theirs)
    return f"{measure}: {ours} against {theirs} (claimed: {expected})"


def _elsewhere(pool: Pool, claim: Claim) -> str:
    """Return a list of the verdicts on a claim, with each choice other than the default."""
    own = {key for each in claim.comparisons for key in (*each.ours, *each.theirs)}
    found: dict[Verdict, list[str]] = {each: [] for each in Verdict}
    seen: list[Settings] = []
    for changes in pool.changes():
        also = {key: value for key, value in changes.items() if key not in own}
        if not also or also in seen:
            continue
        seen.append(also)
        try:
            said, runs = quick_verdict(pool, claim, also)
        except NoResults:
            continue  # some of the claim's configurations weren't run with this choice
        found[said].append(f"{words(also)} ({runs:,} seeds)")
    lines = [
        f"* {each.words()}: {'; '.join(choices)}\n" for each, choices in found.items() if choices
    ]
    return f"Verdicts with another choice than the default:\n\n{''.join(lines)}" if lines else ""


def count_needed(difference: Difference) -> str:
    """Return the number of seeds needed to see a difference; a dash if the difference may be 0."""
    _, low, high = difference.mean
    return f"{difference.runs_needed:,.0f}" if low > 0 or high < 0 else "–"


def verdicts_in_short(experiments: Mapping[str, Experiment]) -> list[tuple[str, str, list[str]]]:
    """Return each claim with its verdict and the differences behind the verdict, over all runs.

    Args:
        experiments: the results by the names in `IN_SHORT`.

    Raises:
        NoResults: if a comparison lacks its jobs.
    """
    pool = Pool(default_settings(experiments["fig3"], {"lam": 0.2}), experiments.values())
    rows = []
    for claim in CLAIMS:
        found = [compare(pool, comparison, {}, None) for comparison in claim.comparisons]
        differences = [
            f"{_comparison(comparison)}: {interval_words(each.difference.mean, signed=True)}, "
            f"{each.runs:,} seeds"
            for comparison, each in zip(claim.comparisons, found, strict=True)
        ]
        rows.append((claim.words, together([each.verdict for each in found]).words(), differences))
    return rows
