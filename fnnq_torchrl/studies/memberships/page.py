"""The page in Markdown. Every number and every verdict in it comes from the results."""

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from fnnq_torchrl.studies.experiments import NoResults
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.results import CONFIDENCE

from .sources import BY_HAND, Source

EVEN = "even"

_PAGE = """# Where labels come from

The paper sets its membership functions by hand and doesn't learn them by gradient, since «doing
this job using some clustering method would give better results». It gives no experiment. This is
one, over {runs:,} seeds of each choice, at equal numbers of rules.

{conclusions}
`make memberships` writes this page from result files; no number in it was typed by hand.

## What is compared

The labels of the bearing come from these sources; the four labels of the action are the paper's
throughout.

* *By hand*: the paper's five labels (eq. 12).
* *Even*: evenly spaced over the field of view. Neighbours have the same membership, ½, halfway
  between them.
* *K-means*: at the cluster centres of visited bearings, as wide as evenly spaced labels with the
  same mean distance to their neighbours would be.
* *Mixture of Gaussians*: the components of a mixture fitted to visited bearings, with their widths.
* *Then by gradient*: centres and widths start from those above and are learned along with the
  consequents, by the gradient of Q, through the same trace.

The visited bearings are those of 100 situations of *random play*, or of *learned runs* that explore
as they did while learning. In random play the robot mostly loses the ball, and then sees it at the
edge of the view.

Each choice has α of {alphas}. The first half of the seeds chooses the best α, and the second half
gives the score: the mean, over all evaluations, of the catches in five tests. Brackets are
{confidence:g} % bootstrap intervals. Differences are between the same seeds. One of fewer than
{matters} catches doesn't matter; that is our choice.

{sections}"""


def write_page(sources: Sequence[Source]) -> str:
    """Return the page.

    Args:
        sources: the results with labels from each source.

    Raises:
        NoResults: there are no evenly spaced labels to compare with, or none by hand.
    """
    by_count = [
        [*group]
        for _, group in groupby(
            sorted(sources, key=lambda each: each.count), lambda each: each.count
        )
    ]
    return _PAGE.format(
        runs=min(each.runs for each in sources),
        conclusions="".join(f"* {line}\n" for line in _conclusions(by_count)),
        alphas=", ".join(f"{alpha:g}" for alpha in sources[0].alphas),
        confidence=100 * CONFIDENCE,
        matters=MATTERS,
        sections="\n".join(map(_section, by_count)),
    )


def _conclusions(by_count: Sequence[Sequence[Source]]) -> list[str]:
    """Return a line on each number of labels, and one on the paper's recommendation."""
    lines, verdicts = [], []
    for group in by_count:
        reference = _reference(group)
        told = []
        for each in group:
            if each is not reference:
                difference = _difference(each, reference)
                told.append(f"{each.name}: {better_words(difference)}")
                if "k-means" in each.name or "mixture" in each.name:
                    verdicts.append(difference.low > 0)
        lines.append(
            f"With {reference.count} labels, compared with those {_called(reference)}: "
            f"{'; '.join(told)}."
        )
    said = "holds" if all(verdicts) else "does not hold" if not any(verdicts) else "depends"
    return [
        f"The recommendation of clustering **{said}**: in {sum(verdicts)} of {len(verdicts)} "
        "comparisons, labels from clusters score more.",
        *lines,
    ]


def _reference(group: Sequence[Source]) -> Source:
    """Return the labels to compare with: those by hand where there are some, else the even ones."""
    for name in (BY_HAND, EVEN):
        for each in group:
            if each.name == name:
                return each
    raise NoResults(f"there are no evenly spaced labels to compare those of {group[0].name} with")


def _called(source: Source) -> str:
    return BY_HAND if source.name == BY_HAND else "evenly spaced"


def better_words(difference: Interval) -> str:
    """Return a difference in scores in words."""
    if difference.low >= MATTERS:
        return "better"
    if difference.high <= -MATTERS:
        return "worse"
    if difference.low > -MATTERS and difference.high < MATTERS:
        return f"the same to within {MATTERS} catches"
    if difference.low > 0 or difference.high < 0:
        return (
            f"{'better' if difference.low > 0 else 'worse'}, perhaps by less than {MATTERS} catches"
        )
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
