"""The page in Markdown. Every number in it comes from the results."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from fnnq_torchrl.studies.effective_step import effective_step
from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.figures.job_words import change_words, job_words
from fnnq_torchrl.studies.figures.readings import norms
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import Difference, bootstrap_interval, paired_difference
from fnnq_torchrl.training.pictures.words import setting_words
from fnnq_torchrl.training.results import CONFIDENCE

from .claims import CLAIMS, Claim, Comparison, Expected, Settings
from .markdown import interval_words, table
from .pool import Pool, default_settings, words
from .verdicts import (
    MATTERS,
    Compared,
    Verdict,
    compare,
    quick_verdict,
    together,
    verdict,
    verdict_shares,
)

PAPER_RUNS = 22
"""The number of runs behind each of the paper's means."""

EXPERIMENTS = (
    "fig2_large",
    "fig3_large",
    "decay_large",
    "traces",
    "decay",
    "exploration",
    "variants",
    "open_choices",
)
"""The experiments that the page is written from."""

IN_SHORT = ("fig2", "fig3", "decay")
"""The experiments with few runs that the claims can be judged from."""

FIGURES = {
    "fig2": "fig2_large",
    "fig3": "fig3_large",
    "traces": "traces",
    "readings": "traces",
    "decay": "decay",
    "exploration": "exploration",
    "variants": "variants",
    "open_choices": "open_choices",
}
"""The page's figures, each with its experiment (:mod:`fnnq_torchrl.studies.figures.gallery`)."""

_BEGINNING = f"""# What of the paper holds

{{counts}}

The paper reports means over {PAPER_RUNS} runs, without intervals. Here each claim of its section 3
and its conclusion is read as a difference between two configurations over the same seeds. It is
judged twice: over the first {PAPER_RUNS} seeds, as many as the paper had, and over all seeds.
`make reproduction` writes this page from result files; no number in it was typed by hand.

## In short

{{summary}}
![Learning curves for different λ](figures/fig2.png)

![Learning curves with λ = 0.2 and without](figures/fig3.png)

## How a claim is judged

* A *score* is the number of catches in an evaluation's five situations. Each run has four measures:
{{measures}}
* A claimed difference *holds* if its whole interval lies on the claimed side of 0. It holds,
  *perhaps by less than {MATTERS} catches*, if a part of that interval is nearer to 0 than that. It
  *does not hold* if the interval reaches to 0 or beyond, and has no value of {MATTERS} catches or
  more on the claimed side.
* A claim that two configurations are *the same* holds if the whole interval lies within ±{MATTERS}
  catches, and does not hold if all of it lies outside. For the claim that one is *another* than
  the other it is the opposite.
* In all other cases the verdict is *can't be told*.
* A claim of several differences is as good as the worst of them. It holds *in part* if some
  differences hold and others do not.
* The {MATTERS} catches are our choice.
* Brackets are {100 * CONFIDENCE:g} % bootstrap intervals: BCa, or percentiles beyond 1,000 runs.
  IQM is the interquartile mean. *d* is the mean difference in standard deviations of the runs'
  differences. *P* is the probability that a run of the first configuration scores more than a run
  of the second; a draw counts half. *n* is the number of seeds with which such a difference is seen
  with a probability of 80 %.
* Runs of the same seed have little in common. So the *d* of pairs is about the usual *d* of two
  groups, divided by √2.
* Each interval stands for itself, and one in twenty misses. With {PAPER_RUNS} runs of scores that
  can't pass five, the intervals are somewhat too narrow.
"""

_READINGS = """## What the two readings of step h do to λ

{best}

![‖f‖² over states and actions, the effective step size, and the score](figures/readings.png)

Step h of Table 1 says Tr(s, a) ← Tr(s, a) + 1. The trace is kept in a network like the one for Q,
so this can be read in two ways. With f = ∂Q(s, a)/∂w, here the normalised firing strengths of the
rules, they are

* *output*, the paper's letter: the trace network's output at (s, a) rises by one, e ← e + f/‖f‖²;
* *gradient*, as is usual today: e ← e + f.

By *output*, an error δ that comes k steps after a pair (s, a) moves the pair's Q by αδ(γλ)ᵏ. By
*gradient* it moves it by αδ(γλ)ᵏ‖f‖². The pair's own error δ′ (step g) moves its Q by αδ′‖f‖² under
both. So an earlier pair weighs 1/‖f‖² times as much by *output* as by *gradient*. Where γλ > ‖f‖²,
the same error even moves the pair before the present one *more* than the present pair. In a table
‖f‖² = 1, and both readings are the same. Here rules overlap and share the firing strength:

> Evenly over bearings and actions, ‖f‖² has the median {median:.2f}, and 90 % of its values lie
> between {low:.2f} and {high:.2f}. It is smallest, {ahead:.2f}, near straight ahead, where a robot
> that follows its ball sees it.

From one step to the next the robot sees nearly the same. If it sees and does the same for long, the
decayed trace settles at γλ/(1 − γλ) times what each step adds. A step then takes Q(s, a) towards
its target by

    output:   α(‖f‖² + γλ/(1 − γλ))          gradient:   α‖f‖²/(1 − γλ)

of the error. In a situation's last step the target, r, doesn't move: there a step beyond 1
overshoots, and one beyond 2 leaves Q farther off than it was. In earlier steps the target moves
along with Q. With α = {alpha:g} and γ = {gamma:g} these steps are

{steps}
By *output* and where ‖f‖² is small, a small λ is much like a larger α, and a large λ steps beyond
the target until α has decayed. By *gradient* the step stays in proportion to ‖f‖². That is
arithmetic. The runs had these results, where a run that diverges catches nothing from then on:

{scores}
"""


def write_page(experiments: Mapping[str, Experiment]) -> str:
    """Return the page.

    Args:
        experiments: the results of `EXPERIMENTS`, by name.

    Raises:
        NoResults: a comparison lacks its jobs.
    """
    default = default_settings(experiments["fig3_large"], {"lam": 0.2})
    pool = Pool(default, experiments.values())
    judged = [_judge(pool, claim) for claim in CLAIMS]
    measures = "\n".join(
        f"  * the *{measure.words.partition(' (')[0]}*: {measure.meaning}"
        for measure in MEASURES.values()
    )
    parts = [
        _BEGINNING.format(counts=_counts(judged), summary=_summary(judged), measures=measures),
        *(_claim(pool, each) for each in judged),
        _readings(experiments["traces"]),
        _open_choices(experiments["open_choices"]),
        _rest(experiments),
    ]
    return "\n".join(parts)


def verdicts_in_short(experiments: Mapping[str, Experiment]) -> list[tuple[str, str, list[str]]]:
    """Return each claim with its verdict and the differences behind the verdict, over all runs.

    Args:
        experiments: the results of `IN_SHORT`, or of others with the same configurations.

    Raises:
        NoResults: a comparison lacks its jobs.
    """
    pool = Pool(default_settings(experiments["fig3"], {"lam": 0.2}), experiments.values())
    rows = []
    for claim in CLAIMS:
        found = [compare(pool, comparison, {}, None) for comparison in claim.comparisons]
        differences = [
            f"{_comparison(comparison)}: {interval_words(each.difference.mean, signed=True)}, "
            f"{each.runs:,} seeds"
            for comparison, each in zip(claim.comparisons, found, strict=True)
        ]
        rows.append((claim.words, together([each.verdict for each in found]).value, differences))
    return rows


@dataclass(frozen=True)
class _Judged:
    """A claim with its comparisons over the paper's number of runs, and over all runs."""

    claim: Claim
    few: list[Compared]
    whole: list[Compared]

    @property
    def over_few(self) -> Verdict:
        return together([each.verdict for each in self.few])

    @property
    def over_whole(self) -> Verdict:
        return together([each.verdict for each in self.whole])

    @property
    def most(self) -> int:
        """The number of runs that all comparisons have."""
        return min(each.runs for each in self.whole)


def _judge(pool: Pool, claim: Claim) -> _Judged:
    few, whole = (
        [compare(pool, comparison, {}, runs) for comparison in claim.comparisons]
        for runs in (PAPER_RUNS, None)
    )
    return _Judged(claim, few, whole)


def _counts(judged: Sequence[_Judged]) -> str:
    """Return the number of claims with each verdict, in words."""
    few, whole = (
        _and(f"{_several(which, found.count(which))}" for which in Verdict if which in found)
        for found in ([each.over_few for each in judged], [each.over_whole for each in judged])
    )
    return (
        f"The paper makes {len(judged)} claims about its experiment. Over all seeds {whole}. "
        f"Over {PAPER_RUNS} seeds, as many as the paper had, {few}."
    )


def _several(which: Verdict, count: int) -> str:
    plural = {
        Verdict.HOLDS: "hold",
        Verdict.BARELY: f"hold, perhaps by less than {MATTERS} catches",
        Verdict.PART: "hold in part",
        Verdict.FAILS: "do not hold",
        Verdict.OPEN: "can't be told",
    }
    return f"{count} {which.value if count == 1 else plural[which]}"


def _and(parts: Iterable[str]) -> str:
    *others, last = parts
    return f"{'; '.join(others)}; and {last}" if others else last


def _summary(judged: Sequence[_Judged]) -> str:
    head = [
        "the paper says",
        "where",
        f"over {PAPER_RUNS} seeds",
        "over all",
        "differences over all",
    ]
    rows = []
    for each in judged:
        differences = (
            f"{words(comparison.ours)} − {words(comparison.theirs)}: "
            f"{interval_words(found.difference.mean, signed=True)}"
            for comparison, found in zip(each.claim.comparisons, each.whole, strict=True)
        )
        rows.append(
            [
                f"«{each.claim.words}»",
                each.claim.place,
                each.over_few.value,
                f"{each.over_whole.value} ({each.most:,})",
                "; ".join(differences),
            ]
        )
    return table(head, rows)


def _claim(pool: Pool, judged: _Judged) -> str:
    """Return a claim's section."""
    claim = judged.claim
    samples, shares = verdict_shares(pool, claim, PAPER_RUNS)
    parts = "; ".join(
        f"{each.value}: {share:.0%}" for each, share in shares.items() if share >= 0.005
    )
    head = ["", "seeds", "first", "second", "difference", "d", "P", "n", "verdict"]
    rows = [
        _row(comparison, each)
        for found in (judged.few, judged.whole)
        for comparison, each in zip(claim.comparisons, found, strict=True)
    ]
    lines = [
        f"## «{claim.words}» ({claim.place})\n",
        f"We read: {claim.reading} **Over {PAPER_RUNS} seeds: {judged.over_few.value}; "
        f"over {judged.most:,}: {judged.over_whole.value}.**\n",
        table(head, rows),
        f"Verdicts of {samples:,} samples of {PAPER_RUNS} seeds each: {parts}.\n",
        _elsewhere(pool, claim),
    ]
    return "\n".join(lines)


def _row(comparison: Comparison, found: Compared) -> list[str]:
    """Return a comparison's row of a claim's table."""
    difference = found.difference
    return [
        _comparison(comparison),
        f"{found.runs:,}",
        f"{interval_words(found.ours)}, IQM {found.ours_iqm:.2f}",
        f"{interval_words(found.theirs)}, IQM {found.theirs_iqm:.2f}",
        interval_words(difference.mean, signed=True),
        f"{difference.effect:+.2f}",
        interval_words(difference.improvement),
        _count(difference),
        found.verdict.value,
    ]


def _comparison(comparison: Comparison) -> str:
    measure = MEASURES[comparison.measure].words.partition(" (")[0]
    expected = comparison.expected.value
    ours, theirs = words(comparison.ours), words(comparison.theirs)
    return f"{measure}: {ours} against {theirs} (claimed: {expected})"


def _elsewhere(pool: Pool, claim: Claim) -> str:
    """Return the verdicts on a claim with choices other than the default ones."""
    own = {key for each in claim.comparisons for key in (*each.ours, *each.theirs)}
    found: dict[Verdict, list[str]] = {each: [] for each in Verdict}
    seen: list[Settings] = []
    for changes in pool.changes():
        also = {key: value for key, value in changes.items() if key not in own}
        if not also or also in seen:
            continue
        seen.append(also)
        try:
            said, runs = quick_verdict(pool, claim, also)
        except NoResults:
            continue  # some of the claim's configurations weren't run with this choice
        found[said].append(f"{words(also)} ({runs:,} seeds)")
    lines = [
        f"* {each.value}: {'; '.join(choices)}\n" for each, choices in found.items() if choices
    ]
    return f"Verdicts with another choice than the default:\n\n{''.join(lines)}" if lines else ""


def _readings(traces: Experiment) -> str:
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
        f"at {_highest(traces.where('trace', trace), 'mean_score', 'trace')} with "
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


def _open_choices(choices: Experiment) -> str:
    """Return the section on the choices that the paper leaves open."""
    measure = MEASURES["mean_score"].of
    without, with_lam = min(choices.values("lam")), max(choices.values("lam"))
    base = [job for job in choices.jobs if change_words(choices, job, "lam") == "default"]
    scores = {
        (change_words(choices, job, "lam"), job.settings["lam"]): measure(job.evaluations)
        for job in choices.jobs
    }
    rows = []
    sizes: dict[Verdict, list[str]] = {each: [] for each in Verdict}
    for name in dict.fromkeys(name for name, _ in scores):
        ours = scores[name, with_lam]
        moved = paired_difference(ours, scores["default", with_lam])
        gained = paired_difference(ours, scores[name, without])
        if name != "default":
            sizes[verdict(moved.mean.low, moved.mean.high, Expected.SAME)].append(name)
        rows.append(
            [
                name,
                interval_words(bootstrap_interval(np.mean, ours)),
                "" if name == "default" else interval_words(moved.mean, signed=True),
                "" if name == "default" else f"{moved.effect:+.2f}",
                interval_words(gained.mean, signed=True),
                f"{gained.effect:+.2f}",
            ]
        )
    lam, none = setting_words("lam", with_lam), setting_words("lam", without)
    head = ["choice", f"mean score with {lam}", "moves it by", "d", f"{lam} against {none}", "d"]
    seeds = min(job.evaluations.runs for job in base)
    told = [
        f"* {start}: {'; '.join(sizes[which])}\n"
        for which, start in (
            (Verdict.FAILS, f"by {MATTERS} catches or more"),
            (Verdict.HOLDS, "by less than that"),
            (Verdict.OPEN, "can't be told"),
        )
        if sizes[which]
    ]
    return (
        "## What the paper leaves open\n\n"
        "The paper gives no figure for the robot's speed V₀, the sensor's noise, the number of "
        "candidate actions and the decay of α. It calls the labels' second number a variance, and "
        "step h has two readings. A choice other than the default moves the mean score with "
        f"{lam}\n\n{''.join(told)}\n"
        f"The table has one choice in each row, with the defaults for all others, over {seeds:,} "
        "seeds:\n\n" + table(head, rows) + "\n"
        "![Mean score with each choice](figures/open_choices.png)\n"
    )


def _rest(experiments: Mapping[str, Experiment]) -> str:
    counts = ", ".join(f"{name} {each.runs:,}" for name, each in experiments.items())
    final = _highest(experiments["decay"], "final_score")
    explored, varied = (
        _highest(experiments[name], "mean_score") for name in ("exploration", "variants")
    )
    return (
        f"## The decay of α\n\nThe final score is highest at {final}.\n\n"
        "![Final score and forgetting](figures/decay.png)\n\n"
        "## Exploration\n\nThe paper takes ε-greedy, which «might be not as good as Boltzman "
        f"method». The mean score is highest at {explored}.\n\n"
        "![Mean score by exploration](figures/exploration.png)\n\n"
        "## Peng, Watkins, naive; other traces; the paper's finite window\n\n"
        f"The mean score is highest at {varied}.\n\n"
        "![Mean score by variant and trace](figures/variants.png)\n\n"
        f"Seeds of each experiment: {counts}.\n"
    )


def _highest(experiment: Experiment, measure: str, without: str | None = None) -> str:
    """Return the job with the highest mean of a measure in words, and that mean."""
    of = MEASURES[measure].of
    best = max(experiment.jobs, key=lambda job: of(job.evaluations).mean())
    mean = bootstrap_interval(np.mean, of(best.evaluations))
    return f"{job_words(experiment, best, without)}, {interval_words(mean)}"


def _count(difference: Difference) -> str:
    """Return the number of seeds that it takes to see a difference, if there is one."""
    _, low, high = difference.mean
    return f"{difference.runs_needed:,.0f}" if low > 0 or high < 0 else "–"
