"""Step sizes compared with a reference, each over a range of α: sentences and tables."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.reproduction.claims import Expected
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS, Verdict, verdict
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.pictures.words import value_words

from .scheme import CATCHES, Scheme, Unit, read_scheme


@dataclass(frozen=True)
class Compared:
    """The scores of several step sizes with one λ, compared with those of a reference.

    Attributes:
        reference: the name of the step size that the others are compared with.
        runs: the number of runs of each job.
        schemes: the scores of all step sizes, by name.
        at_best: each other step size's score minus the reference's, both at their best α, by name.
        over_alphas: the same difference in the mean score over all α.
        unit: the unit of the scores.
    """

    reference: str
    runs: int
    schemes: dict[str, Scheme]
    at_best: dict[str, Interval]
    over_alphas: dict[str, Interval]
    unit: Unit

    @classmethod
    def of(cls, experiment: Experiment, lam: float, reference: str, unit: Unit = CATCHES) -> Self:
        """Compare the step sizes of an experiment, which differs in no other key but α and λ.

        Raises:
            NoResults, ValueError: as in :func:`.scheme.read_scheme`.
        """
        schemes = {
            step_size: read_scheme(experiment, step_size, lam, unit)
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
            unit,
        )


def in_short(compared: Compared) -> str:
    """Return the conclusions on all step sizes, without the numbers behind them."""
    at_best, over_alphas = (
        _grouped({name: more_or_less(each, compared.unit) for name, each in found.items()})
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


def comparison(compared: Compared) -> str:
    """Return the tables, after a sentence on each step size other than the reference."""
    against = f"against {value_words(compared.reference)}"
    head = ["", "before learning", "best α", "there", against, "over all α", against, "spread"]
    return (
        "".join(f"* {_sentence(compared, name)}\n" for name in compared.at_best)
        + "\n"
        + table(head, [_row(compared, name) for name in compared.schemes])
        + "\n"
        + diverged_table(compared.schemes, compared.runs)
    )


def diverged_table(schemes: Mapping[str, Scheme], runs: int) -> str:
    """Return a table of the diverged runs at each α."""
    if not any(sum(scheme.diverged.values()) for scheme in schemes.values()):
        return "No run diverged.\n"
    alphas = [f"α = {alpha:g}" for alpha in next(iter(schemes.values())).diverged]
    rows = [
        [value_words(name), *(f"{count:,}" for count in scheme.diverged.values())]
        for name, scheme in schemes.items()
    ]
    return table([f"diverged, of {runs:,} runs", *alphas], rows)


def _sentence(compared: Compared, name: str) -> str:
    """Return a sentence that compares a step size with the reference."""
    reference = value_words(compared.reference)
    ours, theirs = (
        interval_words(compared.schemes[which].spread) for which in (name, compared.reference)
    )
    return (
        f"**{value_words(name)}** against {reference}: each at its best α, it scores "
        f"{more_or_less(compared.at_best[name], compared.unit)}; over all α, "
        f"{more_or_less(compared.over_alphas[name], compared.unit)}. Its spread is {ours} "
        f"{compared.unit.name}, that of {reference} {theirs}."
    )


def more_or_less(difference: Interval, unit: Unit = CATCHES) -> str:
    """Return a difference of scores in words, by the rules of `reproduction.verdicts.verdict`."""
    low, high = (bound * MATTERS / unit.matters for bound in difference[1:])
    least = f"{unit.matters:g} {unit.name}"
    if verdict(low, high, Expected.SAME) is Verdict.HOLDS:
        return f"the same to within {least}"
    for expected in (Expected.MORE, Expected.LESS):
        found = verdict(low, high, expected)
        if found is Verdict.HOLDS:
            return expected.value
        if found is Verdict.BARELY:
            return f"{expected.value} (perhaps by less than {least})"
    return "neither clearly more nor less nor the same"


def _row(compared: Compared, name: str) -> list[str]:
    scheme = compared.schemes[name]
    at_best, over_alphas = (
        "" if name == compared.reference else interval_words(found[name], signed=True)
        for found in (compared.at_best, compared.over_alphas)
    )
    return [
        value_words(name),
        f"{scheme.before:.2f}" if np.isfinite(scheme.before) else "",
        f"{scheme.best_alpha:g}",
        interval_words(bootstrap_interval(np.mean, scheme.at_best)),
        at_best,
        interval_words(bootstrap_interval(np.mean, scheme.over_alphas)),
        over_alphas,
        interval_words(scheme.spread),
    ]
