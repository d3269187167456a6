"""docs/peers.md: figures in a template. What the page concludes is computed from the runs too."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from statistics import mean
from string import Template

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ttest_ind

from benchmarks.tables import short, spread, table
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.results import CONFIDENCE, FINAL_EVALUATIONS

from .dqn import Settings, in_words
from .learners import PEERS
from .results import (
    ALONE,
    EAGER,
    NO_TRACE,
    OURS,
    WORDS,
    Results,
    at_last,
    eager_seconds,
    final_score,
    mean_score,
    seconds,
)
from .task import task
from .tune import FIRST_SEED, LEARNING_RATES, best_rate, read_tuning

GOAL = 4
"""Catches of five whose time is told."""

_TEMPLATE = Template("""\
# Peers on the same task

`make peers` measures these figures and writes this page, its conclusions too. Measured on
$machine.

Q(λ) on a fuzzy rule base is meant for learning from little. So the question is what usual deep
Q-learning makes of the same task with as many steps: the same world, the same $candidates candidate
actions, γ = $gamma, the same end of a situation, and $steps learning steps. Every $every steps the
greedy policy plays the paper's five situations; its *score* is how many of them it ends in a catch.

![Score against learning steps, and against wall time](figures/peers.png)

$conclusion

## What they learn

The *mean score* is over all evaluations after learning began, the *final score* over the last
$final; brackets are $confidence % Student's t intervals over the runs. The last column says after
how many steps the mean over the runs is at $goal catches or above, and stays there.

$learning

## How long it takes

Wall time of one run of $steps steps, without imports and evaluation: medians, with the fastest and
the slowest. Ours ran by themselves, the peers as many at once as there are cores, with a thread
each, on a machine shared with others. *The world* is what of it the world's own steps took, which
all learners share: eagerly, it is TorchRL and TensorDict's way of doing small things. *To $goal
catches* includes compiling, whose programs the cache on disk already had.

$time

## Who they are

* *Q(λ)* is this package with its defaults, with and without a trace: 20 weights, none of whose
  parameters was sought for this comparison. It is evaluated after every five situations; its score
  after so many steps is that of the last evaluation until then.
* *DQN, TorchRL* is made of TorchRL's own `DQNLoss`, `SoftUpdate`, `Collector`, replay buffer and
  `EGreedyModule`, on `FollowBall` with an `ActionDiscretizer`.
* *DQN, Stable-Baselines3* is its `DQN`, through `envs.gymnasium.GymWorld`, which both
  Gymnasium's and its own checker of environments pass. It has an environment of its own,
  `benchmarks/peers/.venv`.

Both DQNs see the bearing as it is, in ±1 rad, and have the same architecture and schedule, with
Adam and Huber's loss:

$settings

The learning rate is each one's best of those that were tried, by the mean score over runs from seed
$first_seed on, which appear nowhere else (`python -m benchmarks.peers.tune`):

$tuning

Versions: $versions.
""")


def write_page(path: Path, machine: str, results: Results) -> None:
    """Write the page.

    Args:
        path: of the page.
        machine: on which the results were measured.
        results: of all learners.
    """
    config = task()
    moments = results[OURS][0].steps
    settings = in_words(Settings(learning_rate=0.0))
    sections = {
        "machine": machine,
        "candidates": config.action.candidates,
        "gamma": config.gamma,
        "steps": f"{moments[-1]:,}",
        "every": moments[1],
        "final": FINAL_EVALUATIONS,
        "confidence": f"{100 * CONFIDENCE:g}",
        "goal": GOAL,
        "conclusion": "\n".join(map(_bullet, conclusions(results))),
        "learning": _learning_table(results),
        "time": _time_table(results),
        "settings": table(["setting", "value"], settings),
        "first_seed": FIRST_SEED,
        "tuning": _tuning_table(),
        "versions": _versions(results),
    }
    path.write_text(_TEMPLATE.substitute(sections), encoding="utf-8")


def conclusions(results: Results) -> list[str]:
    """What the runs say of each peer, a sentence for each question."""
    ours = WORDS[OURS]
    lines = [f"{ours} {_arrives(results, OURS)}."]
    for name, peer in PEERS.items():
        scores = mean_score(results[name])
        difference = mean_score(results[OURS]).mean() - scores.mean()
        low, high = _difference_interval(mean_score(results[OURS]), scores)
        lines.append(
            f"{peer.words} {_arrives(results, name)}. Over all evaluations {ours} scores "
            f"{difference:+.2f} catches by comparison ({low:+.2f} to {high:+.2f}), "
            f"{_verdict(low, high)}."
        )
    alone, eager = seconds(results[ALONE])[-1], eager_seconds(results)[-1]
    for name, peer in PEERS.items():
        theirs = seconds(results[name])[-1]
        lines.append(
            f"A run of {peer.words} takes {short(theirs / alone)} times as long as one of ours "
            f"compiled, compiling included, and {_about(theirs / eager)} as one of ours that steps "
            "eagerly, as the peers do, but had the machine for itself."
        )
    return lines


def _about(ratio: float) -> str:
    """A ratio of times that weren't taken under the same conditions."""
    return "about as long" if 2 / 3 < ratio < 3 / 2 else f"about {ratio:.2g} times as long"


def _bullet(line: str) -> str:
    return textwrap.fill(line, 100, initial_indent="* ", subsequent_indent="  ")


def _arrives(results: Results, name: str) -> str:
    """When the mean is there to stay, in words that follow a learner's name."""
    place = at_last(results[name], GOAL)
    if place is None:
        return f"doesn't come to {GOAL} catches on average, or not to stay"
    return (
        f"stays at {GOAL} catches on average or above after {results[name][0].steps[place]:,} steps"
    )


def _difference_interval(
    ours: NDArray[np.float64], theirs: NDArray[np.float64]
) -> tuple[float, float]:
    """Of the difference of two means, by Welch's t."""
    welch = ttest_ind(ours, theirs, equal_var=False)
    low, high = welch.confidence_interval(CONFIDENCE)
    return float(low), float(high)


def _verdict(low: float, high: float) -> str:
    if low > 0:
        return "an advantage"
    return "a disadvantage" if high < 0 else "which may be chance"


def _learning_table(results: Results) -> str:
    rows = []
    for name, words in WORDS.items():
        runs = results[name]
        place = at_last(runs, GOAL)
        rows.append(
            [
                words,
                f"{len(runs):,}",
                _with_interval(mean_score(runs)),
                _with_interval(final_score(runs)),
                "never" if place is None else f"{runs[0].steps[place]:,}",
            ]
        )
    heads = ["learner", "runs", "mean score", "final score", f"{GOAL} catches after, steps"]
    return table(heads, rows)


def _with_interval(samples: NDArray[np.float64]) -> str:
    center, low, high = mean_interval(samples, confidence=CONFIDENCE)
    return f"{center:.2f} ({low:.2f} to {high:.2f})"


def _time_table(results: Results) -> str:
    ours, batch, alone = WORDS[OURS], results[OURS], results[ALONE]
    there = at_last(batch, GOAL)
    rows = [
        [
            f"{ours}, compiled, alone",
            spread([run.compile_seconds for run in alone]),
            spread([run.seconds[-1] for run in alone]),
            "",
            _seconds_at(there, seconds(alone)),
        ],
        [
            f"{ours}, compiled, each of {len(batch):,}",
            short(batch[0].compile_seconds),
            short(batch[0].seconds[-1]),
            "",
            "",
        ],
        [
            f"{ours}, eager, by {results[EAGER][0].steps[-1]:,} of its steps",
            "",
            short(eager_seconds(results)[-1]),
            "",
            _seconds_at(there, eager_seconds(results)),
        ],
    ]
    for name, peer in PEERS.items():
        runs = results[name]
        rows.append(
            [
                peer.words,
                "",
                spread([run.seconds[-1] for run in runs]),
                spread([run.world_seconds for run in runs if run.world_seconds is not None]),
                _seconds_at(at_last(runs, GOAL), seconds(runs)),
            ]
        )
    return table(["seconds", "compiling", "learning", "the world", f"to {GOAL} catches"], rows)


def _seconds_at(place: int | None, times: Sequence[float]) -> str:
    return "never" if place is None else short(times[place])


def _tuning_table() -> str:
    scores = read_tuning()
    rows = []
    for name, peer in PEERS.items():
        by_rate = scores[name]
        cells = [f"{mean(by_rate[rate]):.2f}" for rate in LEARNING_RATES]
        runs, chosen = len(by_rate[LEARNING_RATES[0]]), best_rate(by_rate)
        rows.append([peer.words, str(runs), *cells, f"{chosen:g}"])
    rates = [f"{rate:g}" for rate in LEARNING_RATES]
    return table(["mean score with", "runs", *rates, "chosen"], rows)


def _versions(results: Results) -> str:
    found = dict.fromkeys(
        f"{library} {number}"
        for name in (OURS, NO_TRACE, *PEERS)
        for library, number in results[name][0].versions.items()
    )
    return ", ".join(found)
