"""Step sizes compared with a reference, each over a range of α."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.verdicts import compared_words
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


def comparison(compared: Compared) -> str:
    """Return the tables of the scores and of the diverged runs."""
    against = f"against {value_words(compared.reference)}"
    head = ["", "before learning", "best α", "there", against, "over all α", against, "spread"]
    rows = [_row(compared, name) for name in compared.schemes]
    return f"{table(head, rows)}\n{_diverged_table(compared.schemes, compared.runs)}"


def _diverged_table(schemes: Mapping[str, Scheme], runs: int) -> str:
    """Return a table of the diverged runs at each α."""
    if not any(sum(scheme.diverged.values()) for scheme in schemes.values()):
        return "No run diverged.\n"
    alphas = [f"α = {alpha:g}" for alpha in next(iter(schemes.values())).alphas]
    rows = [
        [value_words(name), *(f"{count:,}" for count in scheme.diverged.values())]
        for name, scheme in schemes.items()
    ]
    return table([f"diverged, of {runs:,} runs", *alphas], rows)


def _row(compared: Compared, name: str) -> list[str]:
    scheme = compared.schemes[name]
    at_best, over_alphas = (
        "" if name == compared.reference else compared_words(found[name], compared.unit.matters)
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
