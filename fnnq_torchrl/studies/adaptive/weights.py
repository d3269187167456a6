"""The part of docs/adaptive.md on rules with a step size for each weight."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.pool import same_seeds
from fnnq_torchrl.studies.statistics import (
    Interval,
    bootstrap_interval,
    choose_by_half,
    paired_difference,
)
from fnnq_torchrl.training.pictures.words import setting_words, value_words

from .comparison import Compared, comparison
from .scheme import CATCHES, Unit

REWARD = Unit(
    "steps an episode",
    10,
    lambda evaluations: evaluations.returns[:, -1],
    lambda evaluations: evaluations.returns[:, 0],
    0,
)
"""The reward of an episode of Mountain Car, which is −1 a step."""

_TEXT = """## With a step size for each weight

These rules learn a step size for each weight, by gradient descent on the squared error. α is only
where the step sizes start. They have a parameter instead, the meta step size, for which each paper
gives a value; here it has that value. The rules are made for a Q that is linear in its weights.

* *IDBD* (Sutton 1992) and *Autostep* (Mahmood et al. 2012) were made for given targets and know
  nothing of traces. Autostep is normalised, and keeps a step from overshooting.
* *TIDBD* and *AutoTIDBD* (Kearney et al. 2019) are the same for temporal differences with traces.
* *Swift-Sarsa* (Javed & Sutton 2025) is true online Sarsa(λ) with a step size for each weight, so
  it is compared with true online Sarsa(λ) and a constant α. A step corrects at most the share η of
  an error, and no step size is above η = {eta:g}.

On the ball each has α from {lowest:g} to {highest:g} and {runs:,} seeds with each α. The best α,
scores, intervals and differences are as above.

![Mean score against the α at which the step sizes start](figures/step_sizes.png)

{ball}
### The meta step size

The meta step size takes the place of α. Here α is {alpha:g}, and each column has another meta step
size, with {meta_runs:,} seeds each. The *spread* is the difference between the scores at the best
and at the worst of them.

{meta}
### Mountain Car

Sarsa({car_lam:g}) with 8 tilings, as in [textbook.md](textbook.md), over {car_runs:,} seeds. The
measure is the reward of an episode, −1 a step, over the first {situations} episodes. An episode
ends after {limit:,} steps at the latest. A difference of fewer than {car_matters:g} steps doesn't
matter; that is our choice. All but Swift-Sarsa have replacing traces. The largest α is a whole step
with 8 tilings.

{car}"""


class Weights(NamedTuple):
    """The part of the page on step sizes for each weight.

    Attributes:
        ball: the comparisons on the ball by λ: that of all rules but Swift-Sarsa, and that of
            Swift-Sarsa with true online Sarsa(λ).
        car: the same two comparisons on Mountain Car.
        sensitivity: a sentence on what still has to be chosen.
        text: the sections in Markdown, with headings of the second level and below.
    """

    ball: dict[float, tuple[Compared, Compared]]
    car: tuple[Compared, Compared]
    sensitivity: str
    text: str


def weights_part(step_sizes: Experiment, meta: Experiment, car: Experiment) -> Weights:
    """Return the part of the page.

    Args:
        step_sizes, meta, car: the results of ``+experiment=step_sizes``, ``meta_step_sizes`` and
            ``step_sizes_car``.

    Raises:
        NoResults: if a combination is missing.
        ValueError: if there are too few seeds for `choose_by_half`.
    """
    peng, sarsa = (step_sizes.where("variant", variant) for variant in ("peng", "sarsa"))
    ball = {
        lam: (Compared.of(peng, lam, "decay"), Compared.of(sarsa, lam, "constant"))
        for lam in sorted(step_sizes.values("lam"))
    }
    car_lam = car.values("lam")[0]
    rules, swift = (
        Compared.of(car.where("trace", trace), car_lam, "constant", REWARD)
        for trace in ("replacing", "dutch")
    )
    alphas, settings = sorted(step_sizes.values("alpha")), car.jobs[0].settings
    text = _TEXT.format(
        eta=meta.jobs[0].settings["eta"],
        lowest=alphas[0],
        highest=alphas[-1],
        runs=step_sizes.runs,
        ball="\n".join(
            f"### On the ball, with λ = {lam:g}\n\n{_both(*of_lam)}" for lam, of_lam in ball.items()
        ),
        alpha=meta.jobs[0].settings["alpha"],
        meta_runs=meta.runs,
        meta=_meta_table(meta),
        car_lam=car_lam,
        car_runs=car.runs,
        situations=settings["situations"],
        limit=settings["env.time_limit_steps"],
        car_matters=REWARD.matters,
        car=_both(rules, swift),
    )
    return Weights(ball, (rules, swift), _sensitivity(meta), text)


def _both(rules: Compared, swift: Compared) -> str:
    """Return the comparison of the rules, and that of Swift-Sarsa with true online Sarsa(λ)."""
    return f"{comparison(rules)}\nTrue online Sarsa(λ):\n\n{comparison(swift)}"


def _meta_table(meta: Experiment) -> str:
    """Return a table of the scores with each meta step size, and their spread."""
    sizes = sorted(meta.values("meta_step_size"))
    rows = []
    for name in meta.values("step_size"):
        for lam in sorted(meta.values("lam")):
            scores = _scores(meta, name, lam)
            of_each = [interval_words(bootstrap_interval(np.mean, each)) for each in scores]
            words = f"{value_words(name)}, {setting_words('lam', lam)}"
            rows.append([words, *of_each, interval_words(_spread(scores))])
    return table(["", *(f"{size:g}" for size in sizes), "spread"], rows)


def _sensitivity(meta: Experiment) -> str:
    """Return a sentence on the rules that the meta step size matters to."""
    spreads = {
        name: max(_spread(_scores(meta, name, lam)).value for lam in meta.values("lam"))
        for name in meta.values("step_size")
    }
    told = ", ".join(f"{value_words(name)} {spread:.2f}" for name, spread in spreads.items())
    sizes = sorted(meta.values("meta_step_size"))
    return (
        f"The meta step size takes the place of α. From {sizes[0]:g} to {sizes[-1]:g} it changes "
        f"the score on the ball by up to: {told} catches."
    )


def _scores(meta: Experiment, name: str, lam: float) -> NDArray[np.float64]:
    """Return the scores with each meta step size, rising, ``[sizes, runs]``."""
    runs = same_seeds(meta.jobs)
    jobs = [
        meta.job(step_size=name, lam=lam, meta_step_size=size)
        for size in sorted(meta.values("meta_step_size"))
    ]
    return np.stack([CATCHES.of(job.evaluations)[:runs] for job in jobs])


def _spread(scores: NDArray[np.float64]) -> Interval:
    """Return the difference between the scores at the best choice and at the worst."""
    best, worst = choose_by_half(scores), choose_by_half(-scores)
    return paired_difference(best.judged, -worst.judged).mean
