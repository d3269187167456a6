"""The page ``docs/textbook.md``, written from the results in Markdown."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from fnnq_torchrl.studies.experiments import Experiment, Job, NoResults
from fnnq_torchrl.studies.reproduction.markdown import table
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.results import CONFIDENCE

from .published import REWARDS, RUNS, STEPS, TILINGS, Comparison, Point, compare
from .returns import NAME
from .walk import Errors

_WORDS = {"gradient": "accumulating", "clearing": "replacing, with clearing"}
"""Descriptions of traces, by their names in the configuration, if the name isn't clear enough."""

Samples = Callable[[Job], NDArray[np.float64]]

_PAGE = """# The textbook's figures

Sutton and Barto's book *Reinforcement learning* (2018) compares traces on Mountain Car and on the
random walk. This page repeats its figures with this program and compares them with the published
ones.

{conclusion}

`make textbook` writes this page from result files. Only the published numbers were typed by hand.

## Mountain Car, Sarsa(λ) with replacing traces (figure 12.10)

Eight tilings of 8 × 8 tiles, γ = 1, ε = 0. The measure is the mean number of steps an episode over
the first 50 episodes. The published values are from the public replication of the book by S. Zhang:
means over {published_runs} runs, read off a plot to within ± 2. Brackets are {confidence:g} %
intervals. The difference is our mean minus the published mean, both at the published α · 8. Its
error, after ±, is √(s.e.² + 2²). The standard error (s.e.) of the difference assumes that the
published runs spread as ours do.

{steps}
![Steps an episode against α, for each λ](figures/textbook_car.png)

## Mountain Car, four traces (figure 12.11)

λ = 0.9. The measure is the mean reward of an episode over the first 20 episodes. The published
values were read off a plot to within ± 5.

{rewards}
Here *dutch* is true online Sarsa(λ); in the replication it isn't. The replication has no results
for accumulating traces with α · 8 above 0.6.

## Random walk, TD(λ) and the off-line λ-return (figures 12.3, 12.6 and 12.8)

The walk has {states} states. The measure is the root-mean-square error of their values, averaged
over the first 10 episodes and {walk_runs:,} runs. The true values are −0.9, −0.8, …, 0.9. Before
learning all values are 0, so the error should be √0.3 = 0.548; the program measured {before:.3f}.
The off-line λ-return algorithm changes the values only after an episode, towards the λ-returns. It
is no learner of this program; the page computes it from the walks in which the runs learned.

{walk}
![The error against α, for each λ and trace](figures/textbook_walk.png)

## Differences from the replication

* **The next action** is chosen before the update and taken in the next step, as in the book's
  boxes. A program that chooses the action again after the update has different results: its steps
  an episode differ by 10 to 15 with replacing traces, and are several times as many with
  accumulating traces.
* **Traces** are cleared at the end of an episode. The replication never clears them. That costs it
  about 9 steps an episode at λ = 0.99, and it probably explains the difference for accumulating
  traces: in a separate program, which isn't part of this repository, clearing them changes 406 ± 1
  steps into 389 ± 1 (α · 8 = 0.2, 600 runs). Ties and the places of the grids change this by 3 at
  most.
* **Ties** between actions are broken at random; the replication takes the lowest action. This
  changes the steps an episode by 2 at most.
* **Tiles** have one weight each in both programs: the replication hashes its tiles, but its 1,944
  tiles fit into its table of 2,048 weights. Its grids begin at other places, since it measures
  position and velocity from 0 and not from the lower end of their ranges.
* **The cap** is 5,000 steps an episode in both programs. Here an episode that reaches the cap is
  truncated, and its last step bootstraps.
"""


def write_page(car: Experiment, traces: Experiment, walk: Sequence[Errors]) -> str:
    """Return the text of the page.

    Args:
        car, traces: the results of ``+experiment=sutton_barto_12_10`` and ``…12_11``.
        walk: the errors of ``+experiment=sutton_barto_12_6``, and of the off-line λ-return.

    Raises:
        NoResults: if a job at a published point is missing.
    """
    steps = [
        _row(f"λ = {lam:g}", car.where("lam", lam).jobs, point, _lengths, min)
        for lam, point in STEPS.items()
    ]
    rewards = [
        _row(_WORDS.get(trace, trace), _of(traces, trace), point, _returns, max)
        for trace, point in REWARDS.items()
    ]
    heads = ["", "published (α · 8)", "ours there", f"ours, {RUNS} runs", "difference", "our best"]
    return _PAGE.format(
        conclusion=_conclusion(car, traces),
        published_runs=RUNS,
        confidence=100 * CONFIDENCE,
        steps=table(heads, steps),
        rewards=table(heads, rewards),
        states=19,
        walk_runs=min(len(each.errors) for each in walk),
        before=walk[0].before,
        walk=_walk_table(walk),
    )


def _conclusion(car: Experiment, traces: Experiment) -> str:
    steps = [
        (f"λ = {lam:g}", compare(_lengths(_at(car.where("lam", lam).jobs, point)), point))
        for lam, point in STEPS.items()
    ]
    rewards = [
        (_WORDS.get(trace, trace), compare(_returns(_at(_of(traces, trace), point)), point))
        for trace, point in REWARDS.items()
    ]
    lines = [_judged("steps an episode (figure 12.10)", steps)]
    lines.append(_judged("rewards of an episode (figure 12.11)", rewards))
    return "\n".join([*lines, f"* Each mean is over {min(car.runs, traces.runs):,} runs."])


def _judged(what: str, compared: Sequence[tuple[str, Comparison]]) -> str:
    """Return the line that says which means agree with the published ones."""
    words = {
        agrees: [
            f"{name} ({each.difference:+.0f} ± {each.error:.0f})"
            for name, each in compared
            if each.agrees == agrees
        ]
        for agrees in (True, False)
    }
    line = f"* **Our {what} are the published ones**, within twice the error, for "
    line += ", ".join(words[True]) or "none"
    return line + (f". They differ for {', '.join(words[False])}." if words[False] else ".")


def _of(traces: Experiment, trace: str) -> list[Job]:
    return traces.where("trace", trace).jobs


def _lengths(job: Job) -> NDArray[np.float64]:
    return job.evaluations.lengths[:, -1]


def _returns(job: Job) -> NDArray[np.float64]:
    return job.evaluations.returns[:, -1]


def _at(jobs: Sequence[Job], point: Point) -> Job:
    """Return the job at a published point.

    Raises:
        NoResults: if there isn't exactly one such job.
    """
    found = [job for job in jobs if abs(job.settings["alpha"] * TILINGS - point.at) < 1e-6]
    if len(found) != 1:
        raise NoResults(f"there are {len(found)} jobs with alpha={point.at / TILINGS:g}, not one")
    return found[0]


def _row(
    name: str,
    jobs: Sequence[Job],
    point: Point,
    samples: Samples,
    best_of: Callable[..., Job],
) -> list[str]:
    here = samples(_at(jobs, point))
    best = best_of(jobs, key=lambda job: samples(job).mean())
    compared = compare(here, point)
    return [
        name,
        f"{point.value:g} ({point.at:g})",
        _interval_words(here),
        _interval_words(here[:RUNS]),
        f"{compared.difference:+.1f} ± {compared.error:.1f}",
        f"{samples(best).mean():.1f} ({best.settings['alpha'] * TILINGS:g})",
    ]


def _interval_words(samples: NDArray[np.float64]) -> str:
    mean, low, high = mean_interval(samples)
    return f"{mean:.1f} [{low:.1f}, {high:.1f}]"


def _walk_table(errors: Sequence[Errors]) -> str:
    rows = []
    for lam in sorted({each.lam for each in errors}):
        row = [f"λ = {lam:g}"]
        for trace in (NAME, "gradient", "dutch"):
            line = [each for each in errors if (each.trace, each.lam) == (trace, lam)]
            if not line:
                raise NoResults(f"the random walk lacks trace={trace} with lam={lam:g}")
            best = min(line, key=lambda each: each.errors.mean())
            mean, low, high = mean_interval(best.errors)
            row.append(f"{mean:.4f} [{low:.4f}, {high:.4f}] (α = {best.alpha:g})")
        rows.append(row)
    return table(["", f"{NAME}, best α", "accumulating, best α", "dutch, best α"], rows)
