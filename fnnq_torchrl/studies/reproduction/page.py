"""The page itself, in Markdown. Every number in it comes from the results."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch

from fnnq_torchrl.studies.effective_step import effective_step
from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.figures.job_words import change_words
from fnnq_torchrl.studies.figures.readings import norms
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import Difference, bootstrap_interval, paired_difference
from fnnq_torchrl.training.pictures.words import setting_words
from fnnq_torchrl.training.results import CONFIDENCE

from .claims import CLAIMS, Claim, Comparison, Settings
from .markdown import interval_words, table
from .pool import Pool, default_settings, words
from .verdicts import MATTERS, Compared, Verdict, compare, quick_verdict, together, verdict_shares

PAPER_RUNS = 22

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
"""What the page is written from."""

IN_SHORT = ("fig2", "fig3", "decay")
"""What the claims can be judged from with few runs."""

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

_ABOUT = f"""# What of the paper holds

Written by `make reproduction` from result files; no number here was typed by hand.

The paper reports means over {PAPER_RUNS} runs, without intervals. Here each claim of its section 3
and its conclusion is read as a difference between two configurations over the same seeds, and
judged twice: over the first {PAPER_RUNS} seeds, which is what the paper could have seen, and over
all.

* A *score* is the number of catches in an evaluation's five situations. {{measures}}
* Brackets are {100 * CONFIDENCE:g} % bootstrap intervals (BCa; percentiles beyond 1,000 runs), IQM
  is the interquartile mean. *d* is the mean difference in standard deviations of the runs'
  differences, *P* the probability that a run of the first scores more than one of the second (draws
  count half), *n* the number of seeds that it takes to see such a difference with a probability of
  80 %.
* A claimed difference *holds* if its whole interval lies on the claimed side of 0, *perhaps by less
  than {MATTERS} catches* if the interval has such values, and *does not* if it reaches across 0, or
  lies beyond, and has no value of {MATTERS} catches on that side. «The same» holds if the interval
  stays within ±{MATTERS} catches, and does not if it stays out; «another» is the opposite. All else
  *can't be told*. A claim of several differences is as good as the worst, and holds *in part* if
  some do and some don't. The {MATTERS} catches are our choice.
* Runs of the same seed have little in common, so the *d* of pairs is about the usual one, of two
  groups, over √2. Each interval stands for itself: of twenty, one misses. With {PAPER_RUNS} runs of
  scores that can't pass five, intervals are somewhat too narrow.
"""

_READINGS = """## What the two readings of step h do to λ

![‖f‖² over states and actions, the effective step size, and the score](figures/readings.png)

Step h of Table 1 says Tr(s, a) ← Tr(s, a) + 1. The trace is kept in a network like the one for Q.
With f = ∂Q(s, a)/∂w, here the normalised firing strengths of the rules, the two readings are

* *output*, to the letter: the network's output at (s, a) rises by one, e ← e + f/‖f‖²;
* *gradient*, today's: e ← e + f.

What a pair has added to the trace lets an error δ, k steps later, move its Q by αδ(γλ)ᵏ by *output*
and by αδ(γλ)ᵏ‖f‖² by *gradient*, while the present pair's own error (step g) moves its Q by αδ′‖f‖²
under both. So by *output* an earlier pair weighs 1/‖f‖² times what it does by *gradient*, and where
γλ > ‖f‖² the same error moves the pair before the last *more* than the last itself. In a table
‖f‖² = 1, and there is one reading. Here rules overlap and share the firing, and

> ‖f‖² evenly over bearings and actions: median {median:.2f}, 5 to 95 %: {low:.2f} to {high:.2f};
> {ahead:.2f} at the smallest, near straight ahead, whither a robot that follows its ball steers.

From one step to the next the robot sees nearly the same. If it sees and does the same for long, the
decayed trace settles at γλ/(1 − γλ) times what each step adds, and a step takes Q(s, a) towards its
target by

    output:   α(‖f‖² + γλ/(1 − γλ))          gradient:   α‖f‖²/(1 − γλ)

of the error. At an end, whose target r stays where it is, a step beyond 1 overshoots, and one
beyond 2 leaves Q farther off than it was; before, the target moves along with Q. With
α = {alpha:g} and γ = {gamma:g} that is

{steps}
Where ‖f‖² is small, a small λ by *output* is much like a larger α; a large one steps beyond the
target, until α has decayed. By *gradient* the step stays in proportion to ‖f‖². That is arithmetic;
this is what the runs did, where those that diverge count as catching nothing from then on:

{scores}
"""


def write_page(experiments: Mapping[str, Experiment]) -> str:
    """The page, from the results of `EXPERIMENTS`.

    Raises:
        NoResults: a comparison lacks its jobs.
    """
    default = default_settings(experiments["fig3_large"], {"lam": 0.2})
    pool = Pool(default, experiments.values())
    by_claim = [_claim(pool, claim) for claim in CLAIMS]
    meanings = "; ".join(
        f"the *{measure.words.partition(' (')[0]}* is {measure.meaning}"
        for measure in MEASURES.values()
    )
    parts = [
        _ABOUT.format(measures=f"Of a run, {meanings}."),
        _summary([row for row, _ in by_claim]),
        "![Learning curves for different λ](figures/fig2.png)\n\n"
        "![Learning curves with λ = 0.2 and without](figures/fig3.png)\n",
        *(section for _, section in by_claim),
        _readings(experiments["traces"]),
        _open_choices(experiments["open_choices"]),
        _rest(experiments),
    ]
    return "\n".join(parts)


def verdicts_in_short(experiments: Mapping[str, Experiment]) -> list[tuple[str, str, list[str]]]:
    """Each claim with its verdict and the differences that it stands on, over all runs.

    Args:
        experiments: `IN_SHORT` or others that have their configurations.

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


def _summary(rows: Sequence[Sequence[str]]) -> str:
    head = [
        "the paper says",
        "where",
        f"over {PAPER_RUNS} seeds",
        "over all",
        "differences over all",
    ]
    return "## In short\n\n" + table(head, rows)


def _claim(pool: Pool, claim: Claim) -> tuple[list[str], str]:
    """Return the claim's row of the summary, and its section."""
    few, whole = (
        [compare(pool, comparison, {}, runs) for comparison in claim.comparisons]
        for runs in (PAPER_RUNS, None)
    )
    of_few, of_whole = (together([each.verdict for each in found]).value for found in (few, whole))
    most = min(each.runs for each in whole)
    samples, shares = verdict_shares(pool, claim, PAPER_RUNS)
    parts = ", ".join(f"{share:.0%} «{each.value}»" for each, share in shares.items())
    head = ["", "seeds", "first", "second", "difference", "d", "P", "n", ""]
    rows = [
        _row(comparison, each)
        for found in (few, whole)
        for comparison, each in zip(claim.comparisons, found, strict=True)
    ]
    lines = [
        f"## «{claim.words}» ({claim.place})\n",
        f"{claim.reading} **Over {PAPER_RUNS} seeds: {of_few}; over {most:,}: {of_whole}.**\n",
        table(head, rows),
        f"With {PAPER_RUNS} seeds of one's own one would have found: {parts} "
        f"(of {samples:,} samples).\n",
        _elsewhere(pool, claim),
    ]
    effects = [
        f"{words(comparison.ours)} − {words(comparison.theirs)}: "
        f"{interval_words(each.difference.mean, signed=True)}"
        for comparison, each in zip(claim.comparisons, whole, strict=True)
    ]
    summary = [f"«{claim.words}»", claim.place, of_few]
    return [*summary, f"{of_whole} ({most:,})", "; ".join(effects)], "\n".join(lines)


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
    return f"{measure}: {words(comparison.ours)} against {words(comparison.theirs)} ({expected})"


def _elsewhere(pool: Pool, claim: Claim) -> str:
    """Under which other readings and choices the claim holds."""
    own = {key for each in claim.comparisons for key in (*each.ours, *each.theirs)}
    found: dict[Verdict, list[str]] = {verdict: [] for verdict in Verdict}
    seen: list[Settings] = []
    for changes in pool.changes():
        also = {key: value for key, value in changes.items() if key not in own}
        if not also or also in seen:
            continue
        seen.append(also)
        try:
            verdict, runs = quick_verdict(pool, claim, also)
        except NoResults:
            continue  # not all that the claim compares was run with this choice
        found[verdict].append(f"{words(also)} ({runs:,} seeds)")
    sentences = [
        f"{start} {'; '.join(choices)}."
        for verdict, start in (
            (Verdict.HOLDS, "It holds with:"),
            (Verdict.BARELY, f"It holds, perhaps by less than {MATTERS} catches, with:"),
            (Verdict.PART, "It holds in part with:"),
            (Verdict.FAILS, "It does not with:"),
            (Verdict.OPEN, "It can't be told with:"),
        )
        if (choices := found[verdict])
    ]
    return f"With other choices: {' '.join(sentences)}\n" if sentences else ""


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
    picture = "![Scores against λ by both readings](figures/traces.png)\n"
    return _READINGS.format(
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
    """How much each open choice moves the result, and what becomes of λ with it."""
    measure = MEASURES["mean_score"].of
    without, with_lam = min(choices.values("lam")), max(choices.values("lam"))
    base = [job for job in choices.jobs if change_words(choices, job, "lam") == "default"]
    scores = {
        (change_words(choices, job, "lam"), job.settings["lam"]): measure(job.evaluations)
        for job in choices.jobs
    }
    rows = []
    for name in dict.fromkeys(name for name, _ in scores):
        ours = scores[name, with_lam]
        moved = paired_difference(ours, scores["default", with_lam])
        gained = paired_difference(ours, scores[name, without])
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
    return (
        "## What the paper leaves open\n\n"
        "The paper gives no figure for the robot's speed V₀, the sensor's noise, the actions among "
        "which the best is sought and the decay of α, calls the labels' second number a variance, "
        "and leaves step h to be read. Each choice by itself, the others as by default, over "
        f"{seeds:,} seeds:\n\n" + table(head, rows) + "\n"
        "![Mean score with each choice](figures/open_choices.png)\n"
    )


def _rest(experiments: Mapping[str, Experiment]) -> str:
    counts = ", ".join(f"{name} {each.runs:,}" for name, each in experiments.items())
    return (
        "## The decay of α\n\n![Final score and forgetting](figures/decay.png)\n\n"
        "## Exploration\n\nThe paper takes ε-greedy, which «might be not as good as Boltzman "
        "method».\n\n![Mean score by exploration](figures/exploration.png)\n\n"
        "## Peng, Watkins, naive; other traces; the paper's finite window\n\n"
        "![Mean score by variant and trace](figures/variants.png)\n\n"
        f"Seeds of each experiment: {counts}.\n"
    )


def _count(difference: Difference) -> str:
    """The seeds that it takes to see a difference, if it is one."""
    _, low, high = difference.mean
    return f"{difference.runs_needed:,.0f}" if low > 0 or high < 0 else "–"
