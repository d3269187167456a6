"""The page in Markdown. The numbers in it come from the results."""

import numpy as np
from numpy.typing import NDArray

from envs.robot.schemas import FollowObstaclesConfig
from fnnq_torchrl.studies.experiments import Experiment, Job, NoResults
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.rules.comparison import compare
from fnnq_torchrl.studies.rules.job import read_job
from fnnq_torchrl.studies.statistics import bootstrap_interval, paired_difference
from fnnq_torchrl.training.results import CONFIDENCE, FINAL_EVALUATIONS, Evaluations

from .rules import BALL, PARTLY, Advice, by_distance, outcomes, read_rules

_SONAR = "value.inputs.sonar_front_m"

_PAGE = """# What is learned among obstacles

The robot learns to catch the ball and to drive among obstacles with its sonars:

* `follow_obstacles`: {share} % of the situations end in a catch after learning
  (λ = {lam:g}, with sonars). Without sonars, the rules know only the bearing: in a test of {tests}
  situations, the robot catches {blind}. With λ = 0, it catches
  {traceless}.
* `wander`: the robot drives {times} times as long before a collision as with random
  driving (λ = {lam:g}).

`make simulator` writes this page from result files; no number in it was typed by hand.

The paper's simulator has sonars and a head that sees balls, and the paper's own task needs only
the head. These two tasks need the sonars ([docs/worlds.md](worlds.md) describes the worlds). The
fuzzy network learns them by the same Q(λ), with {runs} seeds each. Brackets are {confidence:g} %
bootstrap intervals (BCa); differences are between the same seeds. *After learning* is the mean
over the last {final} tests.

## Catch the ball, touch nothing (`task=follow_obstacles`)

The field is 6 m x 6 m, with three round obstacles at new places in each situation. The ball moves
on a circle, or on a line between walls that it bounces off. Learning takes {situations}
situations. A test has {tests} random situations; the score is the number that end in a catch.

{hunt}
## Drive about, touch nothing (`task=wander`)

The field is the same, without a ball. A situation ends after {limit} steps at the latest, and
learning takes {wandered} situations. Before learning, all actions have the same value, so the robot
drives at random. The score is the number of steps before a collision.

{wander}
## The rules that it has learned

The learned rules give the value of every steering, and the robot takes the best one. The
*distilled* controller of a run gives the steering itself: one number for each of {combinations}
combinations of labels, fitted to the best action. [rules.md](rules.md) explains how.

### Does the distilled controller do what the learned one does?

Not quite. Both played the test after the last situation, with λ = {lam:g} and the same starts. Of
{tests} situations, so many ended in

{faithfulness}
In the learned rules, something near decides early, even while its rules fire weakly. In the
distilled controller, a rule counts only as much as it fires. So in between, the rules that avoid
something and the rules that follow the ball cancel out, and the robot turns away too late.

The steps of the learned controllers show this. In the steps in which the rules about something near
fire with a share of {least:.0%} to {greatest:.0%},

* the distilled controller steers to the other side than the learned one in {partly} %
  (in the other steps: {otherwise} %);
* where it does, the learned one steers as the rules about something near say in {as_near} %.

### What the distilled controllers say

The table shows the action label that is named most often by the {runs} distilled controllers, one
for each run, and in brackets the share of the controllers that name it. Each sonar has two labels,
near and far. The last column has the steps of a run's test (of {steps:.0f}) in which these rules
fire: the sum of their firing strengths.

{rules}
Read aloud, the rules for two near obstacles are:

{aloud}
The runs agree if something is near on the left or on the right: they turn away from it. They agree
less if it is in front, where either side may do, and if something is near on two sides. The latter
is rare, and rules that hardly ever fire have learned little.

## What was tried

The labels of the sonars matter most: the nearer *near* and *far* are, down to 0.1 and 0.5 m from
the sonar, the better. A third label ahead, five labels of the steering, γ = 0.98 and λ = 0.5
learned no better or worse. Half the α and twice the situations helped. With obstacles all round
the robot and farther apart, the sonars didn't help, since few obstacles stood between robot and
ball. No reward is given for keeping away from obstacles.
"""


def write_page(experiment: Experiment) -> str:
    """Return the page.

    Args:
        experiment: the results of ``+experiment=simulator``.

    Raises:
        NoResults: if a job is missing.
        OSError, ValueError: if the weights of a job can't be read, or aren't those of rules.
    """
    lam = max(experiment.values("lam"))
    hunt = experiment.where("env.kind", "follow_obstacles")
    with_sonar = _lams([job for job in hunt.jobs if _SONAR in job.settings], experiment.name)
    blind = next((job for job in hunt.jobs if _SONAR not in job.settings), None)
    wander = _lams(experiment.where("env.kind", "wander").jobs, experiment.name)
    if blind is None or {lam, 0} - {*with_sonar} or {lam, 0} - {*wander}:
        raise NoResults(f"{experiment.name} lacks λ = 0, λ = {lam:g} or the job without sonars")
    reference = with_sonar[lam]
    tests = reference.config.evaluation.tests
    compared = compare(read_job(reference.directory))
    advice, (partly, otherwise) = read_rules(compared), by_distance(compared)
    assert isinstance(reference.config.env, FollowObstaclesConfig)
    learned, distilled = (
        outcomes(played, reference.config.env.collision_reward)
        for played in (compared.learned, compared.distilled)
    )
    steps, at_random = _after(wander[lam], "length"), _before(wander[lam], "length")
    return _PAGE.format(
        situations=reference.config.situations,
        runs=experiment.runs,
        confidence=100 * CONFIDENCE,
        final=FINAL_EVALUATIONS,
        tests=tests,
        lam=lam,
        limit=wander[lam].config.env.time_limit_steps,
        wandered=wander[lam].config.situations,
        share=interval_words(
            bootstrap_interval(np.mean, 100 * _after(reference, "catches") / tests)
        ),
        blind=_difference(blind, reference, "catches"),
        traceless=_difference(with_sonar[0], reference, "catches"),
        times=interval_words(bootstrap_interval(_ratio, steps, at_random)),
        hunt=table(
            ["", "before learning", "after learning"],
            [
                _row(f"with sonars, λ = {lam:g}", reference, "catches"),
                _row("with sonars, λ = 0", with_sonar[0], "catches"),
                _row(f"without sonars, λ = {lam:g}", blind, "catches"),
            ],
        ),
        wander=table(
            ["", "before learning", "after learning"],
            [_row(f"λ = {each:g}", wander[each], "length") for each in (lam, 0)],
        ),
        combinations=compared.controllers[0].distilled.consequents.numel(),
        faithfulness=table(
            ["", "a catch", "a collision", "neither in time"],
            [
                ["learned controller", *map(_mean_words, learned)],
                ["distilled controller", *map(_mean_words, distilled)],
                [
                    "difference, seed by seed",
                    *(
                        interval_words(paired_difference(ours, theirs).mean, signed=True)
                        for ours, theirs in zip(distilled, learned, strict=True)
                    ),
                ],
            ],
        ),
        partly=_percent(partly.opposite, partly.all),
        as_near=_percent(partly.as_near, partly.opposite),
        otherwise=_percent(otherwise.opposite, otherwise.all),
        least=PARTLY[0],
        greatest=PARTLY[1],
        steps=sum(each.steps for each in advice),
        rules=table(
            ["near", *(f"ball {place}" for place in BALL), "steps"],
            [_rule_row(each) for each in advice],
        ),
        aloud="".join(f"* {_aloud(each)}\n" for each in advice if len(each.near) == 2),
    )


def _lams(jobs: list[Job], name: str) -> dict[float, Job]:
    """Return the jobs by λ.

    Raises:
        NoResults: if two jobs have the same λ.
    """
    by_lam = {job.settings["lam"]: job for job in jobs}
    if len(by_lam) != len(jobs):
        raise NoResults(f"{name} has several jobs with the same λ")
    return by_lam


def _column(job: Job, name: str) -> NDArray[np.float64]:
    evaluations: Evaluations = job.evaluations
    return evaluations.column(name).astype(np.float64)


def _before(job: Job, name: str) -> NDArray[np.float64]:
    """Return a column of the evaluations before learning, ``[runs]``."""
    return _column(job, name)[:, 0]


def _after(job: Job, name: str) -> NDArray[np.float64]:
    """Return a column's mean over the last tests, ``[runs]``."""
    mean: NDArray[np.float64] = _column(job, name)[:, -FINAL_EVALUATIONS:].mean(axis=1)
    return mean


def _ratio(
    ours: NDArray[np.float64], theirs: NDArray[np.float64], axis: int
) -> NDArray[np.float64]:
    ratio: NDArray[np.float64] = ours.mean(axis=axis) / theirs.mean(axis=axis)
    return ratio


def _row(words: str, job: Job, name: str) -> list[str]:
    return [words, _mean_words(_before(job, name)), _mean_words(_after(job, name))]


def _mean_words(numbers: NDArray[np.float64]) -> str:
    return interval_words(bootstrap_interval(np.mean, numbers))


def _percent(some: NDArray[np.float64], all_: NDArray[np.float64]) -> str:
    return interval_words(bootstrap_interval(_ratio, 100 * some, all_))


def _difference(job: Job, reference: Job, name: str) -> str:
    difference = paired_difference(_after(job, name), _after(reference, name)).mean
    value, low, high = difference
    if low <= 0 <= high:
        return f"neither clearly more nor fewer ({interval_words(difference, signed=True)})"
    amount = interval_words(difference, signed=True)
    return f"{'fewer' if value < 0 else 'more'} ({amount})"


def _rule_row(advice: Advice) -> list[str]:
    where = ", ".join(advice.near) or "nothing"
    cells = [f"{words} ({share:.0%})" for words, share in advice.steering.values()]
    return [where, *cells, f"{advice.steps:.1f}"]


def _aloud(advice: Advice) -> str:
    sides = {"front": "in front", "left": "on the left", "right": "on the right"}
    where = " and ".join(sides[side] for side in advice.near)
    ahead, left, right = (
        f"{words} ({share:.0%})"
        for words, share in (advice.steering[place] for place in ("ahead", "left", "right"))
    )
    return (
        f"If something is near, {where}: steer {ahead} if the ball is ahead, {left} if it is to "
        f"the left, {right} if it is to the right."
    )
