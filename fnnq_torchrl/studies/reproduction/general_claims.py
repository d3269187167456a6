"""The paper's claims about Q(λ) in general, beyond its own experiment, as data."""

from dataclasses import dataclass

from .claims import Expected, Settings
from .quantities import DIVERGED, SCORE, STEPS, VALUE_ERROR, Quantity
from .sides import Best, Change, One, Side


@dataclass(frozen=True)
class Contrast:
    """A claim on ``ours`` minus ``theirs`` over the same seeds.

    Attributes:
        experiment: the experiment with the jobs of both sides.
        where: settings of both sides.
        quantity: what is compared.
        ours, theirs: the sides.
        expected: the claimed result.
    """

    experiment: str
    where: Settings
    quantity: Quantity
    ours: Side
    theirs: Side
    expected: Expected


@dataclass(frozen=True)
class GeneralClaim:
    """A claim of the paper, which holds if all its contrasts come out as expected.

    Attributes:
        topic: the name of its section.
        words: quoted from the paper.
        place: the paper's section.
        reading: the claim as we understand it.
        contrasts: the comparisons that judge it.
    """

    topic: str
    words: str
    place: str
    reading: str
    contrasts: tuple[Contrast, ...]


def _more_exploration(trace: str) -> Contrast:
    """From ε = 0.03 to 0.3, the score falls further with λ = 0.8 than without traces."""
    long, short = (Change({"lam": lam}, "epsilon", 0.03, 0.3) for lam in (0.8, 0))
    where = {"variant": "peng", "trace": trace}
    return Contrast("sensitivity", where, SCORE, long, short, Expected.LESS)


def _farther_off(lam: float) -> Contrast:
    """From ε = 0.1 to 0.6, the values move further from Q* than without traces."""
    long, short = (Change({"lam": each}, "epsilon", 0.1, 0.6) for each in (lam, 0))
    where = {"variant": "peng"}
    return Contrast("sensitivity_values", where, VALUE_ERROR, long, short, Expected.MORE)


_PAPERS_TRACE = {"trace": "gradient"}  # for a table, this is both readings of the paper's trace
_LONGEST, _SHORTEST = 40, 5

GENERAL_CLAIMS = (
    GeneralClaim(
        "sensitivity",
        "experimentation-sensitiveness of Q(λ) when non-greedy action selection is used",
        "section 2",
        "A larger ε costs Peng's Q(λ) with a large λ more than it costs λ = 0: in the score in the "
        "paper's task, and in the values on a chain of five states, whose exact values are known.",
        (
            _more_exploration("output"),
            _more_exploration("gradient"),
            _farther_off(0.5),
            _farther_off(0.9),
        ),
    ),
    GeneralClaim(
        "exploration",
        "it might be not as good as Boltzman method",
        "section 2, of ε-greedy",
        "In the paper's task, Boltzmann exploration with its best temperature has a higher mean "
        "score than ε-greedy with its best ε, and than ε-greedy with the paper's ε.",
        tuple(
            Contrast(
                "best_exploration",
                {},
                SCORE,
                Best({"exploration": "boltzmann"}, "temperature"),
                theirs,
                Expected.MORE,
            )
            for theirs in (
                Best({"exploration": "epsilon_greedy"}, "epsilon"),
                One({"exploration": "epsilon_greedy", "epsilon": 0.1}),
            )
        ),
    ),
    GeneralClaim(
        "chain",
        "improves learning speed considerably, especially in tasks that exact scheduling and "
        "selection of actions in each state is important",
        "conclusion",
        f"On a chain of {_LONGEST} states, each with its own right action, the way is learned in "
        "fewer steps with λ = 0.2 and with λ = 0.8 than with λ = 0. A chain of "
        f"{_SHORTEST} states gains less.",
        tuple(
            contrast
            for lam in (0.2, 0.8)
            for contrast in (
                Contrast(
                    "chain",
                    {**_PAPERS_TRACE, "env.length": _LONGEST},
                    STEPS,
                    One({"lam": lam}),
                    One({"lam": 0}),
                    Expected.LESS,
                ),
                Contrast(
                    "chain",
                    _PAPERS_TRACE,
                    STEPS,
                    Change({"env.length": _LONGEST}, "lam", 0, lam),
                    Change({"env.length": _SHORTEST}, "lam", 0, lam),
                    Expected.LESS,
                ),
            )
        ),
    ),
    GeneralClaim(
        "two_states",
        "simply replacing lookup tables with general function approximators has been shown that "
        "might cause learning to fail",
        "section 2",
        "In the two states of Tsitsiklis and Van Roy, more runs diverge with one Gaussian in place "
        "of the table than with the table.",
        (
            Contrast(
                "two_states",
                {"env.time_limit_steps": 1, "lam": 0},
                DIVERGED,
                One({"value.kind": "rbf"}),
                One({"value.kind": "table"}),
                Expected.MORE,
            ),
        ),
    ),
)
