"""The page in Markdown. Every number and every verdict in it comes from the results."""

from collections.abc import Sequence
from itertools import groupby
from operator import attrgetter

import numpy as np

from fnnq_torchrl.studies.experiments import NoResults
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS, Verdict
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.results import CONFIDENCE

from .sources import BY_HAND, Source

EVEN = "even"
GRADIENT = f"{BY_HAND}, then by gradient"

_PAGE = """# Where labels come from

The paper sets its membership functions by hand and doesn't learn them by gradient, since «doing
this job using some clustering method would give better results». The paper has no experiment on
this. Here is one, over {runs:,} seeds of each choice. Only choices with equal numbers of rules are
compared:

{conclusions}
`make memberships` writes this page from result files; no number in it was typed by hand.

## What is compared

The labels of the bearing come from these sources. The four labels of the action are always the
paper's.

* *By hand*: the paper's five labels (eq. 12).
* *Even*: evenly spaced over the field of view. Neighbours have the same membership, ½, halfway
  between them.
* *K-means*: at the cluster centres of visited bearings. A label is as wide as an evenly spaced one
  with the same mean distance to its neighbours.
* *Mixture of Gaussians*: the components of a mixture fitted to visited bearings, with their widths.
* *Then by gradient*: centres and widths start as by hand or even, and are learned together with the
  consequents, by the gradient of Q and with the same trace.

The visited bearings come from 100 situations of *random play*, or of *learned runs* that explore as
they did while learning. In random play the robot mostly loses the ball, and then reads a bearing at
the edge of the view.

Each choice has α of {alphas}. The first half of the seeds chooses the best α, which may be the
lowest or the highest of them. The second half gives the score: the mean over all evaluations of
the catches in five tests. Brackets are {confidence:g} % bootstrap intervals. Differences are
between the same seeds. A difference of fewer than {matters} catches counts as too small to matter;
this limit is our choice.

{sections}"""


def write_page(sources: Sequence[Source]) -> str:
    """Return the page.

    Args:
        sources: the results with labels from each source.

    Raises:
        NoResults: if there are neither labels by hand nor evenly spaced ones to compare with.
    """
    count = attrgetter("count")
    by_count = [[*group] for _, group in groupby(sorted(sources, key=count), count)]
    return _PAGE.format(
        runs=min(each.runs for each in sources),
        conclusions="".join(f"* {line}\n" for line in _conclusions(by_count)),
        alphas=", ".join(f"{alpha:g}" for alpha in sources[0].alphas),
        confidence=100 * CONFIDENCE,
        matters=MATTERS,
        sections="\n".join(map(_section, by_count)),
    )


def _conclusions(by_count: Sequence[Sequence[Source]]) -> list[str]:
    """Return lines on the paper's recommendation, on even labels, and on each number of labels."""
    lines = []
    for name, words in ((BY_HAND, "the paper's labels"), (GRADIENT, "gradient learning of them")):
        compared = [better for group in by_count for better in _clusters_against(group, name)]
        lines.append(
            f"The recommendation of clustering rather than {words} **{_verdict(compared).value}**: "
            "at the same number of labels, those from clusters score more in "
            f"{sum(compared)} of {len(compared)} comparisons."
        )
    compared = [better for group in by_count for better in _clusters_against(group, EVEN)]
    lines.append(
        "Evenly spaced labels need no visited states. Labels from clusters score more than they do "
        f"in {sum(compared)} of {len(compared)} comparisons."
    )
    for group in by_count:
        reference = _reference(group)
        told = [
            f"{each.name}: {better_words(_difference(each, reference))}"
            for each in group
            if each is not reference
        ]
        lines.append(
            f"With {reference.count} labels, compared with *{_called(reference)}*: "
            f"{'; '.join(told)}."
        )
    return lines


def _clusters_against(group: Sequence[Source], name: str) -> list[bool]:
    """Return True for each clustered source that scores more than the source of this name."""
    return [
        _difference(each, other).low > 0
        for other in group
        if other.name == name
        for each in group
        if each.clustered
    ]


def _verdict(compared: Sequence[bool]) -> Verdict:
    if all(compared):
        return Verdict.HOLDS
    return Verdict.PART if any(compared) else Verdict.FAILS


def _reference(group: Sequence[Source]) -> Source:
    """Return the source to compare with: labels by hand if there are any, else even labels."""
    for name in (BY_HAND, EVEN):
        for each in group:
            if each.name == name:
                return each
    raise NoResults(f"there are no evenly spaced labels to compare with those from {group[0].name}")


def _called(source: Source) -> str:
    return BY_HAND if source.name == BY_HAND else "evenly spaced"


def better_words(difference: Interval) -> str:
    """Return the words for a difference in scores, in catches."""
    if difference.low >= MATTERS:
        return "better"
    if difference.high <= -MATTERS:
        return "worse"
    if difference.low > -MATTERS and difference.high < MATTERS:
        return f"the same to within {MATTERS} catches"
    for words, beyond in (("better", difference.low > 0), ("worse", difference.high < 0)):
        if beyond:
            return f"{words}, perhaps by less than {MATTERS} catches"
    return "neither clearly better nor worse nor the same"


def _difference(ours: Source, theirs: Source) -> Interval:
    return paired_difference(ours.scores, theirs.scores).mean


def _section(group: Sequence[Source]) -> str:
    reference = _reference(group)
    rows = [
        [
            each.name,
            ", ".join(f"{centre:.2g} ± {width:.2g}" for centre, width in each.labels),
            f"{each.best_alpha:g}",
            interval_words(bootstrap_interval(np.mean, each.scores)),
            "" if each is reference else interval_words(_difference(each, reference), signed=True),
            f"{each.diverged:,}",
        ]
        for each in group
    ]
    head = [
        "",
        "labels: centre ± σ in rad",
        "best α",
        "mean score",
        f"against {_called(reference)}",
        "diverged runs, all α",
    ]
    return f"## With {reference.count} labels\n\n{table(head, rows)}"
