"""The text of docs/adaptive.md. Every number and verdict in it is computed from results."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.reproduction.claims import Expected
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS, Verdict, verdict
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.pictures.words import setting_words, value_words
from fnnq_torchrl.training.results import CONFIDENCE

from .scheme import MEASURE, Scheme, held_back, read_scheme

PAPERS, CONSTANT = "decay", "constant"
LAYER_NORM = "value.layer_norm"

_PAGE = """# What adaptive step sizes do

The paper decreases α by a factor after each catch and finds that «the way we decrease α is too
important». It leaves adaptive schemes for later. Here two adaptive step sizes and a constant α are
compared with the paper's decaying α, in the paper's experiment:

{in_short}
Doya's meta-learning, which the paper names, has a page of its own:
[meta_learning.md](meta_learning.md).

`make adaptive` writes this page from result files; no number in it was typed by hand.

## What is compared

* *decaying α*, the paper's: α × {decay:g} after each catch;
* *constant α*;
* *ObGD* (Elsayed, Vasan & Mahmood 2024): α, or less in a step that would overshoot, κ = {kappa:g};
* *α bound* (Dabney & Barto 2012): α, or less; never more than the largest α that would have kept
  the sign of every TD error so far.

Each has α from {lowest:g} to {highest:g}, evenly on a logarithmic scale, and {runs:,} seeds with
each α. The measure is the {measure}, {meaning}. A run that diverges catches nothing from then on.

* *At its best α*: the first half of the seeds chooses the best α and the worst, and the second half
  gives their scores. If the same seeds did both, chance would make the best look better. The
  *spread* is the difference between the scores at the best α and at the worst.
* *Over all α*: the mean over the whole range. It is the score to expect of an α that isn't tuned.
* Brackets are {confidence:g} % bootstrap intervals (BCa). Differences are between the same seeds.
* A difference of fewer than {matters} catches, of five, doesn't matter; that is our choice.

![Mean score against α](figures/adaptive.png)

{sections}
## With a multilayer perceptron

ObGD was made for networks that learn with traces and from every single step: it keeps them from
diverging. The same authors' recipe is Stream Q(λ) (`+experiment=stream_q`): a multilayer perceptron
with normalised layers and sparse initial weights, Watkins' Q(λ) and λ = {stability_lam:g}. Here the
perceptron has {widths} hidden units. ObGD is compared with a constant α, with α from
{stability_lowest:g} to {stability_highest:g} and {stability_runs} seeds each. Then the comparison
is repeated without normalised layers.

![Mean score of the perceptron against α](figures/stability.png)

{stability}"""


def write_page(adaptive: Experiment, stability: Experiment) -> str:
    """Return the text of the page.

    Args:
        adaptive: the results of ``+experiment=adaptive``.
        stability: the results of ``+experiment=stability``.

    Raises:
        NoResults: if a combination of step size, α and λ is missing.
        ValueError: if there are too few seeds for `choose_by_half`.
    """
    alphas, measure = sorted(adaptive.values("alpha")), MEASURES[MEASURE]
    papers = adaptive.where("step_size", PAPERS).jobs[0].settings
    of_stability = stability.jobs[0].settings
    lam = of_stability["lam"]
    by_lam = {each: _Compared.of(adaptive, each, PAPERS) for each in sorted(adaptive.values("lam"))}
    by_norm = {
        each: _Compared.of(stability.where(LAYER_NORM, each), lam, CONSTANT)
        for each in stability.values(LAYER_NORM)
    }
    in_short = [
        *(f"With {setting_words('lam', each)}, {_in_short(by_lam[each])}" for each in by_lam),
        *(f"For {_perceptron(each)}, {_in_short(by_norm[each])}" for each in by_norm),
    ]
    return _PAGE.format(
        lowest=alphas[0],
        highest=alphas[-1],
        runs=adaptive.runs,
        decay=papers["alpha_decay"],
        kappa=papers["kappa"],
        measure=measure.words.partition(" (")[0],
        meaning=measure.meaning,
        confidence=100 * CONFIDENCE,
        matters=MATTERS,
        in_short="".join(f"* {sentence}\n" for sentence in in_short),
        sections="\n".join(
            f"## With {setting_words('lam', each)}\n\n{_comparison(compared)}\n"
            f"{_held_back(adaptive, each)}\n"
            for each, compared in by_lam.items()
        ),
        stability_lam=lam,
        widths=" and ".join(map(str, of_stability["value.widths"])),
        stability_runs=stability.runs,
        stability_lowest=min(stability.values("alpha")),
        stability_highest=max(stability.values("alpha")),
        stability="\n".join(
            f"### {'With' if each else 'Without'} normalised layers\n\n"
            f"{_diverged_in_all(stability.where(LAYER_NORM, each))}\n\n{_comparison(compared)}"
            for each, compared in by_norm.items()
        ),
    )


@dataclass(frozen=True)
class _Compared:
    """The scores of several step sizes with one λ, compared with those of a reference.

    Attributes:
        reference: the name of the step size that the others are compared with.
        runs: the number of runs of each job.
        schemes: the scores of all step sizes, by name.
        at_best: each other step size's score minus the reference's, both at their best α, by name.
        over_alphas: the same difference in the mean score over all α.
    """

    reference: str
    runs: int
    schemes: dict[str, Scheme]
    at_best: dict[str, Interval]
    over_alphas: dict[str, Interval]

    @classmethod
    def of(cls, experiment: Experiment, lam: float, reference: str) -> Self:
        schemes = {
            step_size: read_scheme(experiment, step_size, lam)
            for step_size in experiment.values("step_size")
        }
        theirs = schemes[reference]
        others = {name: scheme for name, scheme in schemes.items() if name != reference}
        return cls(
            reference,
            experiment.runs,
            schemes,
            {
                name: paired_difference(ours.at_best, theirs.at_best).mean
                for name, ours in others.items()
            },
            {
                name: paired_difference(ours.over_alphas, theirs.over_alphas).mean
                for name, ours in others.items()
            },
        )


def _in_short(compared: _Compared) -> str:
    """Return the conclusions on all step sizes, without the numbers behind them."""
    at_best, over_alphas = (
        _grouped({name: _more_or_less(each) for name, each in found.items()})
        for found in (compared.at_best, compared.over_alphas)
    )
    return (
        f"compared with {value_words(compared.reference)}, each at its best α, {at_best}. "
        f"Over all α, {over_alphas}."
    )


def _grouped(told: Mapping[str, str]) -> str:
    """Return a clause for each group of step sizes whose scores have the same words."""
    parts = []
    for words in dict.fromkeys(told.values()):
        *others, last = [value_words(name) for name in told if told[name] == words]
        names = f"{', '.join(others)} and {last} score" if others else f"{last} scores"
        parts.append(f"{names} {words}")
    return "; ".join(parts)


def _perceptron(normalised: bool) -> str:
    return f"a multilayer perceptron {'with' if normalised else 'without'} normalised layers"


def _diverged_in_all(experiment: Experiment) -> str:
    """Return a sentence on the number of diverged runs of each step size."""
    told = []
    for step_size in experiment.values("step_size"):
        runs = [job.evaluations for job in experiment.where("step_size", step_size).jobs]
        diverged = sum(evaluations.diverged_runs for evaluations in runs)
        of_all = sum(evaluations.runs for evaluations in runs)
        told.append(f"with {value_words(step_size)} {diverged:,} of {of_all:,}")
    return f"Runs that diverged, over all α: {', '.join(told)}."


def _held_back(experiment: Experiment, lam: float) -> str:
    """Return a sentence on the α at which the α bound changed anything."""
    alphas = held_back(experiment, lam)
    if not alphas:
        return (
            "The α bound was never below α here: its runs are those of the constant α, step for "
            "step."
        )
    others = len(experiment.values("alpha")) - len(alphas)
    same = " With the others its runs are those of the constant α, step for step." if others else ""
    return f"The α bound was below α with α = {', '.join(f'{a:g}' for a in alphas)}.{same}"


def _comparison(compared: _Compared) -> str:
    """Return the tables, after a sentence on each step size other than the reference."""
    against = f"against {value_words(compared.reference)}"
    head = ["", "before learning", "best α", "there", against, "over all α", against, "spread"]
    return (
        "".join(f"* {_sentence(compared, name)}\n" for name in compared.at_best)
        + "\n"
        + table(head, [_row(compared, name) for name in compared.schemes])
        + "\n"
        + _diverged(compared.schemes, compared.runs)
    )


def _diverged(schemes: Mapping[str, Scheme], runs: int) -> str:
    """Return a table of the diverged runs at each α."""
    if not any(sum(scheme.diverged.values()) for scheme in schemes.values()):
        return "No run diverged.\n"
    alphas = [f"α = {alpha:g}" for alpha in next(iter(schemes.values())).diverged]
    rows = [
        [value_words(name), *(f"{count:,}" for count in scheme.diverged.values())]
        for name, scheme in schemes.items()
    ]
    return table([f"diverged, of {runs:,} runs", *alphas], rows)


def _sentence(compared: _Compared, name: str) -> str:
    """Return a sentence that compares a step size with the reference."""
    reference = value_words(compared.reference)
    ours, theirs = (
        interval_words(compared.schemes[which].spread) for which in (name, compared.reference)
    )
    return (
        f"**{value_words(name)}** against {reference}: each at its best α, it scores "
        f"{_more_or_less(compared.at_best[name])}; over all α, "
        f"{_more_or_less(compared.over_alphas[name])}. Its spread is {ours} catches, that of "
        f"{reference} {theirs}."
    )


def _more_or_less(difference: Interval) -> str:
    """Return a difference of scores in words, by the rules of `reproduction.verdicts.verdict`."""
    _, low, high = difference
    if verdict(low, high, Expected.SAME) is Verdict.HOLDS:
        return f"the same to within {MATTERS} catches"
    for expected in (Expected.MORE, Expected.LESS):
        found = verdict(low, high, expected)
        if found is Verdict.HOLDS:
            return expected.value
        if found is Verdict.BARELY:
            return f"{expected.value} (perhaps by less than {MATTERS} catches)"
    return "neither clearly more nor less nor the same"


def _row(compared: _Compared, name: str) -> list[str]:
    scheme = compared.schemes[name]
    at_best, over_alphas = (
        "" if name == compared.reference else interval_words(found[name], signed=True)
        for found in (compared.at_best, compared.over_alphas)
    )
    return [
        value_words(name),
        f"{scheme.before:.2f}",
        f"{scheme.best_alpha:g}",
        interval_words(bootstrap_interval(np.mean, scheme.at_best)),
        at_best,
        interval_words(bootstrap_interval(np.mean, scheme.over_alphas)),
        over_alphas,
        interval_words(scheme.spread),
    ]
