"""The page itself, in Markdown. Every number and every verdict in it comes from the results."""

from collections.abc import Mapping

import numpy as np

from fnnq_torchrl.experiments import Experiment
from fnnq_torchrl.figures.words import setting_words, value_words
from fnnq_torchrl.measures import MEASURES
from fnnq_torchrl.reproduction.claims import Expected
from fnnq_torchrl.reproduction.markdown import interval_words, table
from fnnq_torchrl.reproduction.verdicts import MATTERS, Verdict, verdict
from fnnq_torchrl.results import CONFIDENCE
from fnnq_torchrl.stats import Interval, bootstrap_interval, paired_difference

from .scheme import MEASURE, Scheme, read_scheme

PAPERS = "decay"

_PAGE = """# What adaptive step sizes do

Written by `make adaptive` from result files; no number here was typed by hand.

The paper decreases α by a factor after each catch, finds that «the way we decrease α is too
important», and leaves adaptive schemes for later. Here are two, and a constant α, against its own,
in its experiment, with α from {lowest:g} to {highest:g} and {runs:,} seeds each:

* *decaying α*, the paper's: α × {decay:g} after each catch;
* *constant α*;
* *ObGD* (Elsayed, Vasan & Mahmood 2024): α, or less in a step that would overshoot, κ = {kappa:g};
* *α bound* (Dabney & Barto 2012): α, or the largest that would have turned no TD error's sign.

The measure is the {measure}, {meaning}.
Brackets are {confidence:g} % bootstrap intervals (BCa); differences are of the same seeds.
The best α is chosen by the first half of the seeds and judged by the second, lest chance choose.
*Over all α* is the mean over the whole range: what an α drawn from it is worth, to one who doesn't
tune. *Spread* is what lies between the best α and the worst.
Fewer than {matters} catches, of five, don't matter; that is our choice.
Of all runs, {diverged:,} diverged; from then on they count as catching nothing.

![Mean score against α](figures/adaptive.png)

{sections}"""


def write_page(experiment: Experiment) -> str:
    """The page, from the results of ``experiment=adaptive``.

    Raises:
        NoResults: a combination of step size, α and λ is missing, or there are too few seeds.
    """
    alphas, measure = sorted(experiment.values("alpha")), MEASURES[MEASURE]
    papers = experiment.where("step_size", PAPERS).jobs[0].settings
    return _PAGE.format(
        lowest=alphas[0],
        highest=alphas[-1],
        runs=experiment.runs,
        decay=papers["alpha_decay"],
        kappa=papers["kappa"],
        measure=measure.words.partition(" (")[0],
        meaning=measure.meaning,
        confidence=100 * CONFIDENCE,
        matters=MATTERS,
        diverged=sum(job.evaluations.diverged_runs for job in experiment.jobs),
        sections="\n".join(_section(experiment, lam) for lam in sorted(experiment.values("lam"))),
    )


def _section(experiment: Experiment, lam: float) -> str:
    """What is to be said with one λ: a sentence for each step size, and a table."""
    schemes = {
        step_size: read_scheme(experiment, step_size, lam)
        for step_size in experiment.values("step_size")
    }
    sentences = [_sentence(schemes, name) for name in schemes if name != PAPERS]
    head = ["", "best α", "there", "against the paper's", "over all α", "against it", "spread"]
    return (
        f"## With {setting_words('lam', lam)}\n\n"
        + "".join(f"* {sentence}\n" for sentence in sentences)
        + "\n"
        + table(head, [_row(schemes, name) for name in schemes])
    )


def _differences(schemes: Mapping[str, Scheme], name: str) -> tuple[Interval, Interval]:
    """Of a step size from the paper's: each at its best α, and over all α."""
    ours, papers = schemes[name], schemes[PAPERS]
    return (
        paired_difference(ours.at_best, papers.at_best).mean,
        paired_difference(ours.over_alphas, papers.over_alphas).mean,
    )


def _sentence(schemes: Mapping[str, Scheme], name: str) -> str:
    """The conclusion on a step size, whichever way it falls."""
    at_best, over_alphas = _differences(schemes, name)
    ours, papers = schemes[name].spread, schemes[PAPERS].spread
    return (
        f"**{value_words(name)}**, against the paper's: each at its best α, it scores "
        f"{_more_or_less(at_best)}; over all α, {_more_or_less(over_alphas)}. Its "
        f"spread is {ours:.2f} catches, the paper's {papers:.2f}."
    )


def _more_or_less(difference: Interval) -> str:
    """What the interval of a difference says, in the words of the reproduction's verdicts."""
    _, low, high = difference
    if verdict(low, high, Expected.SAME) is Verdict.HOLDS:
        return f"the same, to within {MATTERS} catches"
    for expected in (Expected.MORE, Expected.LESS):
        found = verdict(low, high, expected)
        if found is Verdict.HOLDS:
            return expected.value
        if found is Verdict.BARELY:
            return f"{expected.value}, perhaps by less than {MATTERS} catches"
    return "what can't be told from the same"


def _row(schemes: Mapping[str, Scheme], name: str) -> list[str]:
    scheme = schemes[name]
    at_best, over_alphas = (
        ("", "")
        if name == PAPERS
        else (interval_words(each, signed=True) for each in _differences(schemes, name))
    )
    return [
        value_words(name),
        f"{scheme.best_alpha:g}",
        interval_words(bootstrap_interval(np.mean, scheme.at_best)),
        at_best,
        interval_words(bootstrap_interval(np.mean, scheme.over_alphas)),
        over_alphas,
        f"{scheme.spread:.2f}",
    ]
