"""The text of docs/adaptive.md. Every number and verdict in it is computed from results."""

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS, in_a_word
from fnnq_torchrl.training.pictures.words import setting_words, value_words
from fnnq_torchrl.training.results import CONFIDENCE

from .answer import answer, task_of
from .comparison import Compared, comparison
from .scheme import MEASURE, held_back, read_scheme
from .weights import Weights

PAPERS, CONSTANT, OBGD = "decay", "constant", "obgd"
LAYER_NORM = "value.layer_norm"

_PAGE = """# What adaptive step sizes do

The paper decreases α by a factor after each catch and finds that «the way we decrease α is too
important». It leaves adaptive schemes for later. Does one of them free the user of choosing α?

{answer}
*Untuned*: the mean score over {alphas} α from {lowest:g} to {highest:g} (on Mountain Car
{car_alphas} from {car_lowest:g} to {car_highest:g}), evenly on a logarithmic scale. That is what to
expect of an α that nobody tuned. *Tuned*: the score at the best α, which other seeds have chosen.
The ball's scores are catches of five. On Mountain Car the score is the reward of an episode, −1 a
step. Differences below {matters} catches or {car_matters:g} steps don't matter; the sections below
have the intervals.

* **What remains to choose.** {sensitivity}
* **Perceptrons.** {perceptrons}

Doya's meta-learning, which the paper names, has a page of its own. There all
schemes but the α bound also learn on a ball that changes in the middle of learning:
[meta_learning.md](meta_learning.md).

`make adaptive` writes this page from result files; no number in it was typed by hand.

## What is compared

* *decaying α*, the paper's: α × {decay:g} after each catch;
* *constant α*;
* *ObGD* (Elsayed, Vasan & Mahmood 2024): α, or less in a step that would overshoot, κ = {kappa:g};
* *α bound* (Dabney & Barto 2012): α, or less; never more than the largest α that would have kept
  the sign of every TD error so far.

Each has α from {lowest:g} to {highest:g}, evenly on a logarithmic scale, and {runs:,} seeds with
each α. The measure is the {measure}, {meaning}. A run that diverges catches nothing from then on.

* *At its best α*: the first half of the seeds chooses the best α and the worst, and the second half
  gives their scores. If the same seeds did both, chance would make the best look better. The
  *spread* is the difference between the scores at the best α and at the worst.
* *Over all α*: the mean over the whole range. It is the score to expect of an α that isn't tuned.
* Brackets are {confidence:g} % bootstrap intervals (BCa). Differences are between the same seeds.
* A difference of fewer than {matters} catches, of five, doesn't matter; that is our choice. *More*
  and *less* are by at least as much. *Slightly*: there is a difference, perhaps a smaller one.
  *Same*: any difference is smaller. *Open*: more runs are needed to tell.

![Mean score against α](figures/adaptive.png)

{sections}
## With a multilayer perceptron

ObGD was made for networks that learn with traces and from every single step: it keeps them from
diverging. The same authors' recipe is Stream Q(λ) (`+experiment=stream_q`): a multilayer perceptron
with normalised layers and sparse initial weights, Watkins' Q(λ) and λ = {stability_lam:g}. Here the
perceptron has {widths} hidden units. ObGD is compared with a constant α, with α from
{stability_lowest:g} to {stability_highest:g} and {stability_runs} seeds each. Then the comparison
is repeated without normalised layers.

![Mean score of the perceptron against α](figures/stability.png)

{stability}
{weights}"""


def write_page(adaptive: Experiment, stability: Experiment, weights: Weights) -> str:
    """Return the text of the page.

    Args:
        adaptive: the results of ``+experiment=adaptive``.
        stability: the results of ``+experiment=stability``.
        weights: the part on step sizes for each weight.

    Raises:
        NoResults: if a combination of step size, α and λ is missing.
        ValueError: if there are too few seeds for `choose_by_half`.
    """
    alphas, measure = sorted(adaptive.values("alpha")), MEASURES[MEASURE]
    papers = adaptive.where("step_size", PAPERS).jobs[0].settings
    of_stability = stability.jobs[0].settings
    lam = of_stability["lam"]
    by_lam = {each: Compared.of(adaptive, each, PAPERS) for each in sorted(adaptive.values("lam"))}
    by_norm = {
        each: Compared.of(stability.where(LAYER_NORM, each), lam, CONSTANT)
        for each in stability.values(LAYER_NORM)
    }
    tasks = []
    for each, (rules, true_online) in weights.ball.items():
        shared = rules.schemes[rules.reference].alphas  # the α that both experiments have
        jobs = [job for job in adaptive.jobs if job.settings["alpha"] in shared]
        ours = Experiment(adaptive.name, jobs)
        first = {name: read_scheme(ours, name, each) for name in ours.values("step_size")}
        tasks.append(task_of(f"Ball, {setting_words('lam', each)}", first, rules, true_online))
    on_car, true_online_on_car = weights.car
    tasks.append(task_of("Mountain Car", {}, on_car, true_online_on_car))
    car_alphas = on_car.schemes[on_car.reference].alphas
    return _PAGE.format(
        lowest=alphas[0],
        highest=alphas[-1],
        runs=adaptive.runs,
        decay=papers["alpha_decay"],
        kappa=papers["kappa"],
        measure=measure.words.partition(" (")[0],
        meaning=measure.meaning,
        confidence=100 * CONFIDENCE,
        matters=MATTERS,
        answer=answer(tasks),
        alphas=len(shared),
        car_alphas=len(car_alphas),
        car_matters=on_car.unit.matters,
        car_lowest=min(car_alphas),
        car_highest=max(car_alphas),
        sensitivity=weights.sensitivity,
        perceptrons=" ".join(
            f"{_perceptron(each)} {_obgd_scores(compared)} "
            f"{_diverged_in_all(stability.where(LAYER_NORM, each))}"
            for each, compared in by_norm.items()
        ),
        weights=weights.text,
        sections="\n".join(
            f"## With {setting_words('lam', each)}\n\n{comparison(compared)}\n"
            f"{_held_back(adaptive, each)}\n"
            for each, compared in by_lam.items()
        ),
        stability_lam=lam,
        widths=" and ".join(map(str, of_stability["value.widths"])),
        stability_runs=stability.runs,
        stability_lowest=min(stability.values("alpha")),
        stability_highest=max(stability.values("alpha")),
        stability="\n".join(
            f"### {_perceptron(each)}\n\n{comparison(compared)}"
            for each, compared in by_norm.items()
        ),
    )


def _perceptron(normalised: bool) -> str:
    return f"{'With' if normalised else 'Without'} normalised layers"


def _obgd_scores(compared: Compared) -> str:
    """Return a clause on ObGD's scores, untuned and tuned, beside those of a constant α."""
    ours, theirs = (compared.schemes[name] for name in (OBGD, CONSTANT))
    untuned, tuned = (
        in_a_word(of[OBGD], compared.unit.matters)
        for of in (compared.over_alphas, compared.at_best)
    )
    return (
        f"ObGD scores {ours.over_alphas.mean():.2f} untuned, a constant α "
        f"{theirs.over_alphas.mean():.2f} ({untuned}). Tuned, they score "
        f"{ours.at_best.mean():.2f} and {theirs.at_best.mean():.2f} ({tuned})."
    )


def _diverged_in_all(experiment: Experiment) -> str:
    """Return a sentence on the number of diverged runs of each step size."""
    told = []
    for step_size in experiment.values("step_size"):
        runs = [job.evaluations for job in experiment.where("step_size", step_size).jobs]
        diverged = sum(evaluations.diverged_runs for evaluations in runs)
        of_all = sum(evaluations.runs for evaluations in runs)
        told.append(f"{diverged:,} of {of_all:,} with {value_words(step_size)}")
    return f"Diverged runs, over all α: {', '.join(told)}."


def _held_back(experiment: Experiment, lam: float) -> str:
    """Return a sentence on the α at which the α bound changed anything."""
    alphas = held_back(experiment, lam)
    if not alphas:
        return (
            "The α bound was never below α here: its runs are those of the constant α, step for "
            "step."
        )
    others = len(experiment.values("alpha")) - len(alphas)
    same = " With the others its runs are those of the constant α, step for step." if others else ""
    return f"The α bound was below α with α = {', '.join(f'{a:g}' for a in alphas)}.{same}"
