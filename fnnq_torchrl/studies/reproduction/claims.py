"""The paper's claims about its experiment, as comparisons of configurations."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

Settings = Mapping[str, Any]
"""The settings in which a configuration differs from the default one, by their keys."""


class Expected(Enum):
    """The claimed result of a comparison."""

    MORE = "more"
    LESS = "less"
    SAME = "the same"
    OTHER = "another"


@dataclass(frozen=True)
class Comparison:
    """A measure of one configuration minus that of another, over the same seeds."""

    measure: str  # a name in fnnq_torchrl.studies.measures.MEASURES
    ours: Settings
    theirs: Settings
    expected: Expected


@dataclass(frozen=True)
class Claim:
    """A claim of the paper, which holds if all its comparisons come out as expected."""

    words: str  # quoted from the paper
    place: str  # the paper's section
    reading: str  # the claim as we understand it
    comparisons: tuple[Comparison, ...]


def _lam(measure: str, ours: float, theirs: float, expected: Expected) -> Comparison:
    return Comparison(measure, {"lam": ours}, {"lam": theirs}, expected)


def _decay(measure: str, ours: float, expected: Expected) -> Comparison:
    return Comparison(measure, {"alpha_decay": ours}, {"alpha_decay": 0.99}, expected)


CLAIMS = (
    Claim(
        "For small λs all of them are the same",
        "section 3",
        "λ = 0, 0.1 and 0.2 have the same mean score.",
        (
            _lam("mean_score", 0.1, 0, Expected.SAME),
            _lam("mean_score", 0.2, 0.1, Expected.SAME),
            _lam("mean_score", 0.2, 0, Expected.SAME),
        ),
    ),
    Claim(
        "λ = 0.2 seems to be a little better",
        "section 3",
        "λ = 0.2 has a higher mean score than λ = 0.1 and than λ = 0.",
        (_lam("mean_score", 0.2, 0.1, Expected.MORE), _lam("mean_score", 0.2, 0, Expected.MORE)),
    ),
    Claim(
        "when λ is not small, the results degrades significantly",
        "section 3",
        "λ = 0.4 and λ = 0.8 have a lower mean score than λ = 0.1. (The paper names no λ.)",
        (_lam("mean_score", 0.4, 0.1, Expected.LESS), _lam("mean_score", 0.8, 0.1, Expected.LESS)),
    ),
    Claim(
        "Comparing with simple Q-Learning … these Q(λ) extension results better",
        "section 3",
        "λ = 0.2 has a higher mean score than λ = 0.",
        (_lam("mean_score", 0.2, 0, Expected.MORE),),
    ),
    Claim(
        "This improves learning speed considerably",
        "conclusion",
        "Soon after learning began, λ = 0.2 has a higher score than λ = 0 (d says by how much).",
        (_lam("early_score", 0.2, 0, Expected.MORE),),
    ),
    Claim(
        "the way we decrease α is too important",
        "conclusion",
        "The fastest decay that we tried, 0.9, and no decay end up with different scores.",
        (Comparison("final_score", {"alpha_decay": 1}, {"alpha_decay": 0.9}, Expected.OTHER),),
    ),
    Claim(
        "increasing it too fast may lead to sticking in a suboptimal solution",
        "conclusion; we read decreasing",
        "On average, a decay of 0.9 ends up with a lower score than 0.99.",
        (_decay("final_score", 0.9, Expected.LESS),),
    ),
    Claim(
        "while not doing so, learning is too slow",
        "conclusion",
        "Soon after learning began, the score without decay is lower than with a decay of 0.99.",
        (_decay("early_score", 1, Expected.LESS),),
    ),
    Claim(
        "and the agent learns something and forgets it again repeatedly",
        "conclusion, on learning without decay",
        "Without decay, more is forgotten than with a decay of 0.99.",
        (_decay("forgetting", 1, Expected.MORE),),
    ),
)
