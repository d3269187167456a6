"""The second part of docs/reproduction.md: the paper's claims about Q(λ) in general."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.statistics import Interval

from .claim_sections import count_needed, counted
from .general_claims import GENERAL_CLAIMS, Contrast, GeneralClaim
from .general_details import (
    chain_details,
    exploration_details,
    sensitivity_details,
    two_states_details,
)
from .markdown import interval_words, table
from .pool import words
from .sides import Change, Side
from .verdicts import Compared, Verdict, compare_runs, together

GENERAL_EXPERIMENTS = (
    "sensitivity",
    "sensitivity_values",
    "best_exploration",
    "chain",
    "two_states",
)
"""The experiments that this part is written from."""

GENERAL_FIGURES = {
    "sensitivity": "sensitivity",
    "sensitivity_gradient": "sensitivity",
    "best_exploration": "best_exploration",
    "chain": "chain",
}
"""The figures of this part, each with its experiment."""

HEADING = "# What the paper says of Q(λ) in general"
"""The first line of this part."""

_DETAILS: dict[str, Callable[[Mapping[str, Experiment]], str]] = {
    "sensitivity": sensitivity_details,
    "exploration": exploration_details,
    "chain": chain_details,
    "two_states": two_states_details,
}
"""The tables behind each claim, by its topic."""

_BEGINNING = f"""{HEADING}

{{counts}}

Some sentences of the paper aren't about its experiment. Each is read here as a difference in an
experiment of our own; `conf/experiment/` has one for each, with its world. `make general-claims`
writes this part of the page from result files.

{{summary}}
The verdicts are as [above](#how-a-claim-is-judged). The smallest difference that matters is again
our choice: 0.1 catches of five, a factor of 1.1 in steps, 0.01 in values that lie within 0 and 1,
5 % of the runs. Brackets are 95 % bootstrap intervals.
"""


@dataclass(frozen=True)
class _Found:
    """A contrast with its sides in words and its result."""

    contrast: Contrast
    ours: str
    theirs: str
    compared: Compared

    @property
    def verdict(self) -> str:
        return self.compared.verdict.words(self.contrast.quantity.least)

    @property
    def difference(self) -> str:
        return self.contrast.quantity.show_difference(self.compared.difference.mean)


def write_general(experiments: Mapping[str, Experiment]) -> str:
    """Return the text of this part of the page.

    Args:
        experiments: the results of `GENERAL_EXPERIMENTS`, by name.

    Raises:
        NoResults: if a comparison lacks its jobs.
    """
    judged = [
        (claim, [_compare(experiments, contrast) for contrast in claim.contrasts])
        for claim in GENERAL_CLAIMS
    ]
    beginning = _BEGINNING.format(counts=_counts(judged), summary=_summary(judged))
    sections = [
        f"{_section(claim, found)}\n{_DETAILS[claim.topic](experiments)}" for claim, found in judged
    ]
    return "\n".join([beginning, *sections])


def with_general(page: str, part: str) -> str:
    """Return a page with its second part replaced, or appended if it has none."""
    first = page.partition(f"\n{HEADING}\n")[0].rstrip()
    return f"{first}\n\n{part}"


def _compare(experiments: Mapping[str, Experiment], contrast: Contrast) -> _Found:
    experiment, quantity = experiments[contrast.experiment], contrast.quantity
    ours, theirs = (
        side.measured(experiment, contrast.where, quantity)
        for side in (contrast.ours, contrast.theirs)
    )
    # A side that was chosen by the first half of the seeds has the other half only.
    runs = min(ours.runs.size, theirs.runs.size)
    compared = compare_runs(
        ours.runs[-runs:], theirs.runs[-runs:], contrast.expected, quantity.matters
    )
    return _Found(contrast, ours.words, theirs.words, compared)


def _verdict(found: Sequence[_Found]) -> Verdict:
    return together([each.compared.verdict for each in found])


def _verdict_words(found: Sequence[_Found]) -> str:
    return _verdict(found).words(found[0].contrast.quantity.least)


def _counts(judged: Sequence[tuple[GeneralClaim, Sequence[_Found]]]) -> str:
    verdicts = [_verdict(found) for _, found in judged]
    return (
        f"The paper makes {len(judged)} claims about Q(λ) and function approximation in general "
        f"that can be tried. Over all seeds {counted(verdicts, 'what matters')}."
    )


def _summary(judged: Sequence[tuple[GeneralClaim, Sequence[_Found]]]) -> str:
    rows = []
    for claim, found in judged:
        seeds = min(each.compared.runs for each in found)
        differences = (
            f"{_where(each)}{each.ours} − {each.theirs}: {each.difference}" for each in found
        )
        verdict = f"{_verdict_words(found)} ({seeds:,})"
        rows.append([f"«{claim.words}»", claim.place, verdict, "; ".join(differences)])
    return table(["the paper says", "where", "verdict (seeds)", "differences"], rows)


def _where(found: _Found) -> str:
    where = words(found.contrast.where)
    return f"{where}: " if where else ""


def _section(claim: GeneralClaim, found: Sequence[_Found]) -> str:
    """Return a claim's section without its details."""
    head = ["", "seeds", "first", "second", "difference", "d", "P", "n", "verdict"]
    rows = [
        [
            f"{each.contrast.quantity.words}: {_where(each)}{each.ours} against {each.theirs} "
            f"(claimed: {each.contrast.expected.value})",
            f"{each.compared.runs:,}",
            _shown(each, each.contrast.ours, each.compared.ours),
            _shown(each, each.contrast.theirs, each.compared.theirs),
            each.difference,
            f"{each.compared.difference.effect:+.2f}",
            interval_words(each.compared.difference.improvement),
            count_needed(each.compared.difference),
            each.verdict,
        ]
        for each in found
    ]
    verdict = _verdict_words(found)
    return (
        f"## «{claim.words}» ({claim.place})\n\n"
        f"We read: {claim.reading} **Over all seeds: {verdict}.**\n\n{table(head, rows)}"
    )


def _shown(found: _Found, side: Side, mean: Interval) -> str:
    quantity = found.contrast.quantity
    return (quantity.show_difference if isinstance(side, Change) else quantity.show)(mean)
