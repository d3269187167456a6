"""The text of docs/reproduction.md. Every number in it is computed from results."""

from collections.abc import Mapping

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.training.results import CONFIDENCE

from .claim_sections import PAPER_RUNS, claim_section, counts, judge, summary
from .claims import CLAIMS
from .general import GENERAL_EXPERIMENTS, GENERAL_FIGURES, write_general
from .highest import highest
from .open_choices import open_choices_section
from .pool import Pool, default_settings
from .readings import readings_section
from .verdicts import MATTERS

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
"""The experiments that the first part of the page is written from."""

FIGURES = {
    "fig2": "fig2_large",
    "fig3": "fig3_large",
    "traces": "traces",
    "readings": "traces",
    "decay": "decay",
    "exploration": "exploration",
    "variants": "variants",
    "open_choices": "open_choices",
} | GENERAL_FIGURES
"""The page's figures, each with its experiment (:mod:`fnnq_torchrl.studies.figures.gallery`)."""

_BEGINNING = f"""# What of the paper holds

{{counts}}
Four more claims are about Q(λ) in general: [second part](#what-the-paper-says-of-qλ-in-general).

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
  *perhaps by less than {MATTERS} catches*, if a part of the interval is nearer to 0 than {MATTERS}
  catches. It *does not hold* if the interval reaches to 0 or beyond, and has no value of {MATTERS}
  catches or more on the claimed side.
* A claim that two configurations are *the same* holds if the whole interval lies within ±{MATTERS}
  catches, and does not hold if all of it lies outside. The claim that they differ (*another* in the
  tables) is judged the opposite way.
* In all other cases the verdict is *can't be told*.
* A claim of several differences has the worst of their verdicts. It holds *in part* if some
  differences hold and others do not.
* The {MATTERS} catches are our choice.
* Brackets are {100 * CONFIDENCE:g} % bootstrap intervals: BCa, or percentiles beyond 1,000 runs.
  IQM is the interquartile mean. *d* is the mean difference in standard deviations of the runs'
  differences. *P* is the probability that a run of the first configuration scores more than a run
  of the second; a draw counts half. *n* is the number of seeds with which a test sees such a
  difference with a probability of 80 %.
* Runs of the same seed have little in common. So the *d* of pairs is about the usual *d* of two
  groups, divided by √2.
* The intervals are not corrected for their number: one in twenty misses. Scores can't pass five, so
  with {PAPER_RUNS} runs the intervals are somewhat too narrow.
"""


def write_page(experiments: Mapping[str, Experiment]) -> str:
    """Return the text of the page.

    Args:
        experiments: the results of `EXPERIMENTS` and `GENERAL_EXPERIMENTS`, by name.

    Raises:
        NoResults: if a comparison lacks its jobs.
    """
    general = {name: experiments[name] for name in GENERAL_EXPERIMENTS}
    experiments = {name: experiments[name] for name in EXPERIMENTS}
    default = default_settings(experiments["fig3_large"], {"lam": 0.2})
    pool = Pool(default, experiments.values())
    judged = [judge(pool, claim) for claim in CLAIMS]
    measures = "\n".join(
        f"  * the *{measure.words.partition(' (')[0]}*: {measure.meaning}"
        for measure in MEASURES.values()
    )
    parts = [
        _BEGINNING.format(counts=counts(judged), summary=summary(judged), measures=measures),
        *(claim_section(pool, each) for each in judged),
        readings_section(experiments["traces"]),
        open_choices_section(experiments["open_choices"]),
        _rest(experiments),
        write_general(general),
    ]
    return "\n".join(parts)


def _rest(experiments: Mapping[str, Experiment]) -> str:
    seeds = ", ".join(f"{name} {each.runs:,}" for name, each in experiments.items())
    final = highest(experiments["decay"], "final_score")
    explored, varied = (
        highest(experiments[name], "mean_score") for name in ("exploration", "variants")
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
        f"Seeds of each experiment: {seeds}.\n"
    )
