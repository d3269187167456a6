"""The page in Markdown. Every number and every verdict in it comes from the results."""

from collections.abc import Sequence

import numpy as np

from fnnq_torchrl.studies.measures import EARLY_EVALUATIONS, MEASURES
from fnnq_torchrl.studies.reproduction.claims import Expected
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.pool import same_seeds
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS, Verdict, verdict
from fnnq_torchrl.studies.statistics import Interval, bootstrap_interval, paired_difference
from fnnq_torchrl.training.results import CONFIDENCE, FINAL_EVALUATIONS

from .arms import HOPES, NOTHING, OPERATOR, ROUGH, WRONG, Arm, find
from .operator import CARELESS, EPISODES, GAIN, NOISE_STD, demonstrate

_PAGE = """# What prior knowledge does

In the paper all rules start at 0. Its introduction has another idea: «the robot learns its general
behavior by imitating an operator and fine tunes by RL». Here, `rules.prior=FILE` starts from rules
that you write, and `rules.demonstrations=FILE.csv` from an operator's actions. The results:

{in_short}
`make prior` writes this page from result files; no number in it was typed by hand.

## How to give prior knowledge

```
python -m fnnq_torchrl.train rules.prior=rough.txt
python -m fnnq_torchrl.train rules.prior=mine.fll 'rules.frozen=[far_left/hard_left]'
python -m fnnq_torchrl.train rules.prior=outputs/an_earlier_job
python -m fnnq_torchrl.train rules.demonstrations=FILE.csv
python -m fnnq_torchrl.rules run=outputs/an_earlier_job record=FILE.csv
```

* A file has rules of values, `if bearing is far_left and steer is hard_left then value is 0.5`, or
  rules of actions, `if bearing is far_left then steer hard_left`, and need not have all of them
  (`.txt`). Or it has a whole rule base or a distilled controller, as `export=` writes it (`.txt`,
  `.json`, `.fll`, `.fis`). Rules that the file leaves out start at 0.
* If a file defines labels, the network gets the file's inputs, labels, t-norm and `elsewhere`,
  and the finished job doesn't need the file. Labels that you have set (`value.inputs`,
  `value.action`, `value.names`) take precedence, and the file must then have the same labels.
* A rule of an action becomes values. If it says a\\* for a state, the value rule of that state and
  the action label at a starts at margin · (1 − ((a − a\\*)/d)²), where d is the distance between
  the outermost labels: the margin (`rules.margin`) for a\\*, 0 at the far end. Between the states
  of two rules, the best action is about the weighted mean of their a\\*, as in a Takagi–Sugeno
  controller.
* A directory of a finished job gives the mean over its runs.
* `rules.frozen` names rules that learning doesn't change: the labels of the inputs and of the
  action, joined by `/`. `*` stands for any label, and so do labels left out at the end.
* Demonstrations are rows of observations and an action. The consequents are fitted so that Q of the
  operator's action exceeds Q of each other candidate by the margin times their squared distance (as
  a share of the range). The loss is a large-margin loss (Hester et al. 2018), smoothed and convex,
  and the same for all runs. A state's best action label then has the margin as its value, as with
  rules of actions. If there is a prior too, the fit starts from it.

## What is compared

* *{nothing}*: all rules start at 0;
* *{hopes}*: all rules start at {hope:g}. These rules prefer no action, but untried actions
  look good, so that all are tried. The same holds for any prior with high values;
* *{rough}*: five rules of actions, [`rough.txt`](../conf/rules/rough.txt);
* *{wrong}*: the same rules with the opposite actions, [`wrong.txt`](../conf/rules/wrong.txt);
* *{operator}*: {steps:,} steps of {episodes} situations,
  [`operator.csv`](../conf/rules/operator.csv). The operator is simulated: it steers by −{gain:g}
  times the bearing, with a normal error of standard deviation {noise:g}, and at random
  in {careless:g} % of the steps.

Each has {runs:,} seeds; the last three have the margins {margins}. Everything else is as by
default. The early score is the mean over the first {early} evaluations after learning began, one
after every {every} situations; the final score is the mean over the last {final}. Brackets are
{confidence:g} % bootstrap intervals; differences are between the same seeds. A difference of fewer
than {matters} catches, of five, counts as too small to matter; this limit is our choice.

![Score over the course of learning](figures/prior.png)

{scores}
*Lowest* is the lowest point of the mean learning curve after learning began: a run can unlearn its
prior knowledge before it learns it again.

## How the rules change

![The rules before and after learning](figures/prior_rules.png)

The table shows how far the best action after learning is from that of the prior knowledge, in units
of steer (its range is 2), as a mean over the bearings at which a ball starts. The last column has
the same distance for runs that started from nothing:

{distances}"""


def write_page(arms: Sequence[Arm]) -> str:
    """Return the page.

    Args:
        arms: the jobs of the experiment.

    Raises:
        NoResults: if an arm is missing, or the arms have different seeds.
    """
    arms = [*arms]
    runs = same_seeds([arm.job for arm in arms])
    nothing, hopes = find(arms, NOTHING), find(arms, HOPES)
    margins = sorted({arm.margin for arm in arms if arm.source not in (NOTHING, HOPES)})
    told = [find(arms, source, margins[-1]) for source in (ROUGH, WRONG, OPERATOR)]
    return _PAGE.format(
        in_short="".join(f"* {each}\n" for each in _in_short(arms, margins)),
        nothing=NOTHING,
        hopes=HOPES,
        rough=ROUGH,
        wrong=WRONG,
        operator=OPERATOR,
        hope=float(hopes.start.max()),
        steps=len(demonstrate(nothing.job.config.env)),
        episodes=EPISODES,
        gain=GAIN,
        noise=NOISE_STD,
        careless=100 * CARELESS,
        runs=runs,
        margins=" and ".join(f"{margin:g}" for margin in margins),
        early=EARLY_EVALUATIONS,
        every=nothing.job.settings["evaluation.every"],
        final=FINAL_EVALUATIONS,
        confidence=100 * CONFIDENCE,
        matters=MATTERS,
        scores=_scores(arms, nothing),
        distances=_distances(told, nothing),
    )


def _in_short(arms: list[Arm], margins: Sequence[float]) -> list[str]:
    """Return the results in sentences, one string for each."""
    nothing, hopes, most = find(arms, NOTHING), find(arms, HOPES), margins[-1]
    rough, wrong, operator = (find(arms, source, most) for source in (ROUGH, WRONG, OPERATOR))
    sentences = [
        f"**{name}** (margin {most:g}) catches {arm.curve[0]:.2f} of 5 before learning; starting "
        f"from nothing catches {nothing.curve[0]:.2f}. Compared with starting from nothing, it "
        f"scores {_against(arm, nothing, 'early_score')} in the first {EARLY_EVALUATIONS} "
        f"evaluations, and {_against(arm, nothing, 'final_score')} in the last {FINAL_EVALUATIONS}."
        for name, arm in (
            ("A rough controller", rough),
            ("A wrong controller", wrong),
            ("Imitation of a noisy operator", operator),
        )
    ]
    recovers = _verdict(wrong, nothing, "final_score", Expected.LESS) is Verdict.FAILS
    sentences[1] += " So learning corrects it." if recovers else " Learning does not correct it."
    sentences.append(
        f"**High values alone** have a part in this. Without a preferred action, they score "
        f"{_against(hopes, nothing, 'early_score')} than starting from nothing in the first "
        f"{EARLY_EVALUATIONS} evaluations. Compared with them, the rough controller scores "
        f"{_against(rough, hopes, 'early_score')}, the wrong controller "
        f"{_against(wrong, hopes, 'early_score')}, and the operator "
        f"{_against(operator, hopes, 'early_score')}."
    )
    if len(margins) > 1:
        least = find(arms, ROUGH, margins[0])
        sentences.append(
            f"**The margin matters.** With {margins[0]:g} instead of {most:g}, learning soon "
            "forgets part of the rough controller: the lowest mean score is "
            f"{least.curve[1:].min():.2f} instead of {rough.curve[1:].min():.2f}."
        )
    return sentences


def _difference(arm: Arm, other: Arm, measure: str) -> Interval:
    runs = same_seeds([arm.job, other.job])
    return paired_difference(arm.measure(measure)[:runs], other.measure(measure)[:runs]).mean


def _verdict(arm: Arm, other: Arm, measure: str, expected: Expected) -> Verdict:
    _, low, high = _difference(arm, other, measure)
    return verdict(low, high, expected)


def _against(arm: Arm, other: Arm, measure: str) -> str:
    """Return the words for the difference of two arms, as in "it scores … in the first 10"."""
    difference = _difference(arm, other, measure)
    value, low, high = difference
    if low <= 0 <= high:
        return f"neither clearly more nor less ({interval_words(difference, signed=True)})"
    same = " (too little to matter)" if _same(difference) else ""
    if value > 0:
        return f"{interval_words(difference)} more{same}"
    return f"{interval_words(Interval(-value, -high, -low))} less{same}"


def _same(difference: Interval) -> bool:
    return verdict(difference.low, difference.high, Expected.SAME) is Verdict.HOLDS


def _scores(arms: Sequence[Arm], nothing: Arm) -> str:
    """Return the table of scores, with a row for each arm, and a sentence on forgetting."""
    against = "against nothing"
    head = ["", "before", "early score", against, "lowest", "final score", against, "forgetting"]
    rows = []
    for arm in arms:
        cells = [arm.words, f"{arm.curve[0]:.2f}"]
        for measure in ("early_score", "final_score"):
            difference = (
                ""
                if arm is nothing
                else interval_words(_difference(arm, nothing, measure), signed=True)
            )
            cells += [_mean(arm, measure), difference]
            if measure == "early_score":
                cells.append(f"{arm.curve[1:].min():.2f}")
        rows.append([*cells, _mean(arm, "forgetting")])
    forgetting = MEASURES["forgetting"].meaning
    return f"{table(head, rows)}\n*Forgetting* is {forgetting}."


def _mean(arm: Arm, measure: str) -> str:
    return interval_words(bootstrap_interval(np.mean, arm.measure(measure)))


def _distances(told: Sequence[Arm], nothing: Arm) -> str:
    rows = []
    for arm in told:
        ours, theirs = arm.distance_to(arm.start), nothing.distance_to(arm.start)
        rows.append(
            [
                arm.words,
                *(interval_words(bootstrap_interval(np.mean, each)) for each in (ours, theirs)),
            ]
        )
    return table(["", "with this prior", "from nothing"], rows)
