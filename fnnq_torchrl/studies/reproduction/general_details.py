"""The tables behind the verdicts on the paper's general claims, each over its whole experiment."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.chain import not_learned
from fnnq_torchrl.studies.experiments import Experiment, Job
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.words import setting_words, value_words

from .markdown import interval_words, table
from .quantities import DIVERGED, SCORE, STEPS, VALUE_ERROR

Experiments = Mapping[str, Experiment]

_SENSITIVITY = """The mean score in the paper's task, in tests without exploration, {runs:,} seeds:

{scores}
![Mean score against ε, trace by output](figures/sensitivity.png)

![Mean score against ε, trace by gradient](figures/sensitivity_gradient.png)

The error of the values (root mean square of Q − Q\\*, where Q\\* lies within 0 and 1) on a chain
of {length} states after {situations:,} situations, over {value_runs:,} seeds:

{values}
Watkins' Q(λ) cuts the trace before an action that isn't greedy, so its values go to Q\\* for every
ε. In Peng's Q(λ), the results of exploratory actions stay in the values of earlier pairs.
"""

_CHAIN = """The steps until the last situation with a wrong action: the geometric mean over {runs:,}
seeds, and the exponent p with which the steps grow like nᵖ from n = {longer} to {longest}:

{steps}
{unlearned}With λ = 0, α doesn't matter: only the order of the values decides, and it is the same
for every α. With ε = 0, as here, Peng's, Watkins' and naive Q(λ) are the same. An accumulating
trace, the paper's, also credits wrong actions that were repeated on the way. The longer the trace,
the more of them must be unlearned.

![Steps to learn against the length of the chain](figures/chain.png)
"""

_TWO_STATES = """The share of {runs:,} runs that diverge within {situations:,} episodes of so
many steps (α = {alpha:g}, γ = {gamma:g}):

{shares}
All values are 0, which every approximator here can represent. The Gaussian is half as high in the
first state as in the second. The first state learns towards the value of the second. Each such
update raises the value of the second state twice as much as that of the first, so the target runs
ahead. In longer episodes more updates are in the second state, as in the world itself, and the
expected growth becomes negative. Normalised as in the paper's eq. 8, the same Gaussian is 1
everywhere. Both states then have the same value, no target runs ahead, and no run diverges.
[extrapolation.md](extrapolation.md) compares the approximators in the paper's task.
"""

GAUSSIAN_SHARE = 0.5
"""The height of the single Gaussian at the first of the two states; it is 1 at the second."""


def sensitivity_details(experiments: Experiments) -> str:
    """Return the scores and the errors of the values for every ε, λ and variant."""
    scores, values = experiments["sensitivity"], experiments["sensitivity_values"]
    epsilons = sorted(scores.values("epsilon"))
    of_scores = [
        [
            f"{value_words(variant)}, {value_words(trace)}, {setting_words('lam', lam)}",
            *(
                interval_words(bootstrap_interval(np.mean, SCORE.of(job)))
                for epsilon in epsilons
                for job in [scores.job(variant=variant, trace=trace, lam=lam, epsilon=epsilon)]
            ),
        ]
        for trace in scores.values("trace")
        for variant in scores.values("variant")
        for lam in sorted(scores.values("lam"))
    ]
    smaller = sorted(values.values("epsilon"))
    of_values = [
        [
            f"{value_words(variant)}, {setting_words('lam', lam)}",
            *(
                interval_words(bootstrap_interval(np.mean, VALUE_ERROR.of(job)))
                for epsilon in smaller
                for job in [values.job(variant=variant, lam=lam, epsilon=epsilon)]
            ),
        ]
        for variant in values.values("variant")
        for lam in sorted(values.values("lam"))
    ]
    config = values.jobs[0].config
    return _SENSITIVITY.format(
        runs=scores.runs,
        scores=table(["", *(setting_words("epsilon", each) for each in epsilons)], of_scores),
        length=config.env.length,
        situations=config.situations,
        value_runs=values.runs,
        values=table(["", *(setting_words("epsilon", each) for each in smaller)], of_values),
    )


def exploration_details(experiments: Experiments) -> str:
    """Return the scores with every ε and every temperature."""
    explored = experiments["best_exploration"]
    parts = []
    for name, key in (("epsilon_greedy", "epsilon"), ("boltzmann", "temperature")):
        part = explored.where("exploration", name)
        jobs = sorted(part.jobs, key=lambda job: float(job.settings[key]))
        rows = [
            [
                value_words(job.settings[key]),
                interval_words(bootstrap_interval(np.mean, SCORE.of(job))),
            ]
            for job in jobs
        ]
        parts.append(table([setting_words("exploration", name), "mean score"], rows))
    return (
        f"Over all {explored.runs:,} seeds:\n\n"
        + "\n".join(parts)
        + "\n![Mean score by exploration](figures/best_exploration.png)\n"
    )


def chain_details(experiments: Experiments) -> str:
    """Return the steps to learn for every length, λ and trace, and how they grow."""
    chain = experiments["chain"]
    lengths = sorted(chain.values("env.length"))
    rows = []
    for trace in chain.values("trace"):
        for lam in sorted(chain.values("lam")):
            jobs = [chain.job_with({"trace": trace, "lam": lam, "env.length": n}) for n in lengths]
            cells = [
                STEPS.show(bootstrap_interval(np.mean, STEPS.of(job))) + _unlearned(job)
                for job in jobs
            ]
            rows.append([_of_trace(trace, lam), *cells, interval_words(_exponent(jobs, lengths))])
    dagger = "†: so many runs have not learned the way in {:,} situations. "
    return _CHAIN.format(
        runs=chain.runs,
        longer=lengths[-2],
        longest=lengths[-1],
        steps=table(["", *(f"n = {n}" for n in lengths), "p"], rows),
        unlearned=dagger.format(chain.jobs[0].config.situations) if "†" in str(rows) else "",
    )


def two_states_details(experiments: Experiments) -> str:
    """Return the share of runs that diverge for every approximator, λ and episode length."""
    states = experiments["two_states"]
    limits = sorted(states.values("env.time_limit_steps"))
    rows = []
    names = {
        "table": "table",
        "rbf": "one Gaussian",
        "fnnq": "one Gaussian, normalised (FNN)",
    }
    for kind in states.values("value.kind"):
        for lam in sorted(states.values("lam")):
            jobs = [
                states.job_with({"value.kind": kind, "lam": lam, "env.time_limit_steps": limit})
                for limit in limits
            ]
            shares = [DIVERGED.show(bootstrap_interval(np.mean, DIVERGED.of(job))) for job in jobs]
            rows.append([f"{names.get(kind, kind)}, {setting_words('lam', lam)}", *shares])
    config = states.jobs[0].config
    growth = [
        f"{100 * expected_growth(config.alpha, config.gamma, limit):+.2g} %" for limit in limits
    ]
    rows.append(["expected growth of the weight in an episode, one Gaussian, λ = 0", *growth])
    heads = ["", *(f"{limit} step{'s' * (limit > 1)}" for limit in limits)]
    return _TWO_STATES.format(
        situations=config.situations,
        runs=states.runs,
        alpha=config.alpha,
        gamma=config.gamma,
        shares=table(heads, rows),
    )


def expected_growth(alpha: float, gamma: float, steps: int) -> float:
    """Return the expected relative growth of the single Gaussian's weight in an episode, λ = 0.

    An update at height φ multiplies the weight by 1 + αφ(γ − φ), since the next state has height 1.
    Half of the episodes start in the first state, at height `GAUSSIAN_SHARE`; all other updates are
    at height 1.
    """

    def factor(height: float) -> float:
        return 1 + alpha * height * (gamma - height)

    first = (factor(GAUSSIAN_SHARE) + factor(1)) / 2
    return first * factor(1) ** (steps - 1) - 1


def _of_trace(trace: str, lam: float) -> str:
    return f"{'accumulating' if trace == 'gradient' else trace}, {setting_words('lam', lam)}"


def _unlearned(job: Job) -> str:
    missing = not_learned(job)
    return f" ({missing:,}†)" if missing else ""


def _exponent(jobs: Sequence[Job], lengths: Sequence[int]) -> Interval:
    """Return the exponent p of steps ~ nᵖ between the two longest chains."""
    logarithms: list[NDArray[np.float64]] = [STEPS.of(job) for job in jobs[-2:]]
    slope = (logarithms[1] - logarithms[0]) / np.log2(lengths[-1] / lengths[-2])
    mean, low, high = mean_interval(slope)
    return Interval(float(mean), float(low), float(high))
