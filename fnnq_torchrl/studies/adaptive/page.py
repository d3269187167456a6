"""The page itself, in Markdown. Every number and every verdict in it comes from the results."""

from collections.abc import Mapping

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
The best α and the worst are chosen by the first half of the seeds and judged by the second, lest
chance choose; *spread* is what lies between the two.
*Over all α* is the mean over the whole range, even on a logarithmic scale: what an α drawn from it
is worth, to one who doesn't tune. Fewer than {matters} catches, of five, don't matter; that is our
choice.
Runs that diverge count as catching nothing from then on.

![Mean score against α](figures/adaptive.png)

{sections}
## With a multilayer perceptron

ObGD was made to keep networks stable that learn with traces, from one step after the other. This is
Stream Q(λ), the recipe of the same authors (`+experiment=stream_q`): a multilayer perceptron with
normalised layers and sparse initial weights, Watkins' Q(λ) and λ = {stability_lam:g}. Here it has
{widths} hidden units, and ObGD stands beside a constant α, with α from {stability_lowest:g} to
{stability_highest:g} and {stability_runs} seeds each; and all once more without normalised layers.

![Mean score of the perceptron against α](figures/stability.png)

{stability}"""


def write_page(adaptive: Experiment, stability: Experiment) -> str:
    """The page.

    Args:
        adaptive: the results of ``experiment=adaptive``.
        stability: those of ``experiment=stability``.

    Raises:
        NoResults: a combination of step size, α and λ is missing, or there are too few seeds.
    """
    alphas, measure = sorted(adaptive.values("alpha")), MEASURES[MEASURE]
    papers = adaptive.where("step_size", PAPERS).jobs[0].settings
    of_stability = stability.jobs[0].settings
    lam = of_stability["lam"]
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
        sections="\n".join(_with_lam(adaptive, lam) for lam in sorted(adaptive.values("lam"))),
        stability_lam=lam,
        widths=" and ".join(map(str, of_stability["value.widths"])),
        stability_runs=stability.runs,
        stability_lowest=min(stability.values("alpha")),
        stability_highest=max(stability.values("alpha")),
        stability="\n".join(
            _with_norm(stability.where(LAYER_NORM, normalised), lam)
            for normalised in stability.values(LAYER_NORM)
        ),
    )


def _with_lam(experiment: Experiment, lam: float) -> str:
    """What is to be said with one λ."""
    return (
        f"## With {setting_words('lam', lam)}\n\n{_comparison(experiment, lam, PAPERS)}\n"
        f"{_held_back(experiment, lam)}\n"
    )


def _with_norm(experiment: Experiment, lam: float) -> str:
    """What is to be said of the perceptron, its layers normalised or not."""
    [normalised] = experiment.values(LAYER_NORM)
    head = f"### {'With' if normalised else 'Without'} normalised layers"
    told = []
    for step_size in experiment.values("step_size"):
        runs = [job.evaluations for job in experiment.where("step_size", step_size).jobs]
        diverged = sum(evaluations.diverged_runs for evaluations in runs)
        of_all = sum(evaluations.runs for evaluations in runs)
        told.append(f"with {value_words(step_size)} {diverged:,} of {of_all:,}")
    counts = f"Runs that diverged, over all α: {', '.join(told)}."
    return f"{head}\n\n{counts}\n\n{_comparison(experiment, lam, CONSTANT)}"


def _held_back(experiment: Experiment, lam: float) -> str:
    """Where the α bound did anything at all."""
    alphas = held_back(experiment, lam)
    if not alphas:
        return (
            "The α bound was never below α here, whichever it was: "
            "its runs are those of the constant, step for step."
        )
    others = len(experiment.values("alpha")) - len(alphas)
    same = "; with the others its runs are those of the constant, step for step" if others else ""
    return f"The α bound was below α with α = {', '.join(f'{a:g}' for a in alphas)}{same}."


def _comparison(experiment: Experiment, lam: float, reference: str) -> str:
    """A sentence for each step size but the one that they are compared with, and tables."""
    schemes = {
        step_size: read_scheme(experiment, step_size, lam)
        for step_size in experiment.values("step_size")
    }
    sentences = [_sentence(schemes, name, reference) for name in schemes if name != reference]
    against = f"against {value_words(reference)}"
    head = ["", "before learning", "best α", "there", against, "over all α", against, "spread"]
    return (
        "".join(f"* {sentence}\n" for sentence in sentences)
        + "\n"
        + table(head, [_row(schemes, name, reference) for name in schemes])
        + "\n"
        + _diverged(schemes, experiment.runs)
    )


def _diverged(schemes: Mapping[str, Scheme], runs: int) -> str:
    """How many runs did, at each α."""
    if not any(sum(scheme.diverged.values()) for scheme in schemes.values()):
        return "No run diverged.\n"
    alphas = [f"α = {alpha:g}" for alpha in next(iter(schemes.values())).diverged]
    rows = [
        [value_words(name), *(f"{count:,}" for count in scheme.diverged.values())]
        for name, scheme in schemes.items()
    ]
    return table([f"diverged, of {runs:,} runs", *alphas], rows)


def _differences(
    schemes: Mapping[str, Scheme], name: str, reference: str
) -> tuple[Interval, Interval]:
    """Of two step sizes: each at its best α, and over all α."""
    ours, theirs = schemes[name], schemes[reference]
    return (
        paired_difference(ours.at_best, theirs.at_best).mean,
        paired_difference(ours.over_alphas, theirs.over_alphas).mean,
    )


def _sentence(schemes: Mapping[str, Scheme], name: str, reference: str) -> str:
    """The conclusion on a step size, whichever way it falls."""
    at_best, over_alphas = _differences(schemes, name, reference)
    ours, theirs = (interval_words(schemes[which].spread) for which in (name, reference))
    return (
        f"**{value_words(name)}**, against {value_words(reference)}: each at its best α, it scores "
        f"{_more_or_less(at_best)}; over all α, {_more_or_less(over_alphas)}. Its "
        f"spread is {ours} catches, the other's {theirs}."
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


def _row(schemes: Mapping[str, Scheme], name: str, reference: str) -> list[str]:
    scheme = schemes[name]
    at_best, over_alphas = (
        ("", "")
        if name == reference
        else (interval_words(each, signed=True) for each in _differences(schemes, name, reference))
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
