"""The section of the page on the two readings of step h of the paper's Table 1."""

import numpy as np
import torch

from fnnq_torchrl.studies.effective_step import effective_step
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.figures.readings import norms
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import bootstrap_interval
from fnnq_torchrl.training.pictures.words import setting_words

from .highest import highest
from .markdown import interval_words, table

_READINGS = """## What the two readings of step h do to λ

{best}

![‖f‖² over states and actions, the effective step size, and the score](figures/readings.png)

Step h of Table 1 says Tr(s, a) ← Tr(s, a) + 1. The trace is kept in a network like the one for Q,
so this can be read in two ways. With f = ∂Q(s, a)/∂w, here the normalised firing strengths of the
rules, they are

* *output*, to the letter: the trace network's output at (s, a) rises by one, e ← e + f/‖f‖²;
* *gradient*, as is usual today: e ← e + f.

By *output*, an error δ that comes k steps after a pair (s, a) moves the pair's Q by αδ(γλ)ᵏ. By
*gradient* the error moves this Q by αδ(γλ)ᵏ‖f‖². The pair's own error δ′ (step g) moves it by
αδ′‖f‖² under both. So an earlier pair weighs 1/‖f‖² times as much by *output* as by *gradient*. If
γλ > ‖f‖², the same error even moves the pair before the present one *more* than the present pair.
In a table ‖f‖² = 1, and both readings are the same. Here rules overlap and share the firing
strength:

> On an even grid of bearings and actions, ‖f‖² has the median {median:.2f}, and 90 % of its values
> lie between {low:.2f} and {high:.2f}. It is smallest, {ahead:.2f}, near straight ahead, where a
> robot that follows the ball sees it.

From one step to the next the robot sees nearly the same. If it sees and does the same for long, the
decayed trace settles at γλ/(1 − γλ) times the increment of a step. A step then takes Q(s, a)
towards its target by the following share of the error, its *effective step size*:

    output:   α(‖f‖² + γλ/(1 − γλ))          gradient:   α‖f‖²/(1 − γλ)

In a situation's last step the target, r, doesn't move: a step size above 1 overshoots it, and one
above 2 leaves Q farther off than it was. In earlier steps the target moves along with Q. With
α = {alpha:g} and γ = {gamma:g} the effective step sizes are

{steps}
By *output*, where ‖f‖² is small, a small λ is much like a larger α, and a large λ steps beyond
the target until α has decayed. By *gradient* the step stays in proportion to ‖f‖². So far this is
arithmetic. In the experiment, where a run that diverges catches nothing from then on, the results
were:

{scores}
"""


def readings_section(traces: Experiment) -> str:
    """Return the section on the two readings.

    Args:
        traces: the results of ``+experiment=traces``.
    """
    settings = traces.jobs[0].settings
    alpha, gamma = settings["alpha"], settings["gamma"]
    norm = norms(traces)
    low, median, high = np.quantile(norm, [0.05, 0.5, 0.95])
    lams = sorted(traces.values("lam"))
    decay = gamma * torch.tensor(lams, dtype=torch.float64)
    steps = [
        [
            f"{trace}, ‖f‖² = {x:.2f}",
            *(f"{step:.2f}" for step in effective_step(torch.tensor(x), alpha, decay, trace)),
        ]
        for trace in traces.values("trace")
        for x in (median, low)
    ]
    rows = []
    for measure in ("mean_score", "final_score"):
        for trace in traces.values("trace"):
            cells = [
                interval_words(bootstrap_interval(np.mean, MEASURES[measure].of(job.evaluations)))
                for lam in lams
                for job in [traces.job(trace=trace, lam=lam)]
            ]
            rows.append([f"{MEASURES[measure].words.partition(' (')[0]}, {trace}", *cells])
    for trace in traces.values("trace"):
        jobs = [traces.job(trace=trace, lam=lam) for lam in lams]
        rows.append(
            [f"diverged runs, {trace}", *(f"{job.evaluations.diverged_runs:,}" for job in jobs)]
        )
    heads = [setting_words("lam", lam) for lam in lams]
    best = " and ".join(
        f"at {highest(traces.where('trace', trace), 'mean_score', 'trace')} with "
        f"{setting_words('trace', trace)}"
        for trace in traces.values("trace")
    )
    picture = "![Scores against λ by both readings](figures/traces.png)\n"
    return _READINGS.format(
        best=f"The mean score is highest {best}.",
        median=median,
        low=low,
        high=high,
        ahead=norm.min(),
        alpha=alpha,
        gamma=gamma,
        steps=table(["", *heads], steps),
        scores=table([f"{traces.runs:,} seeds", *heads], rows) + "\n" + picture,
    )
