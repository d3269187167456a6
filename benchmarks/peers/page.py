"""The page docs/peers.md: a template with figures and conclusions, both computed from the runs."""

import textwrap
from collections.abc import Sequence
from pathlib import Path
from statistics import mean
from string import Template

import numpy as np
from numpy.typing import NDArray
from scipy.stats import ttest_ind

from benchmarks.tables import short, spread, table
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
    score_interval,
    seconds,
)
from .task import task
from .tune import FIRST_SEED, LEARNING_RATES, best_rate, read_tuning

GOAL = 4
"""The score, in catches of five, whose time of arrival the page gives."""

_TEMPLATE = Template("""\
# Peers on the same task

Q(λ) on a fuzzy rule base is meant for learning from little data. Here it learns the same task as
two usual deep Q-networks, from as many steps:

$conclusion

![Score against learning steps, and against wall time](figures/peers.png)

All learn in the same world, with the same $candidates candidate actions, γ = $gamma, the same end
of a situation and $steps learning steps. Every $every steps the greedy policy plays the paper's
five situations; its *score* is the number of catches.

`make peers` measures the figures and writes this page, its conclusions included. They were measured
on $machine.

## What they learn

The *mean score* is over all evaluations after learning began, the *final score* over the last
$final. Brackets are $confidence % Student's t intervals over the runs, cut off at $best catches.
The last column has the steps after which the mean over the runs is at $goal catches or above, and
stays there.

$learning

## How long it takes

The table has the wall time of one run of $steps steps, without imports and evaluation: the median,
with the fastest and the slowest. Each of our runs had the machine for itself, or as much of it as
other users left. Of the peers' runs, as many ran at once as there are cores, with one thread each.
*The world* is the part of the time that the world's own steps took; eagerly, most of that is the
work of TorchRL and TensorDict for each small step. *To $goal catches* includes compiling, with the
programs already in the cache on disk.

$time

## Who they are

* *Q(λ)* is this package with its defaults, with and without a trace. It has 20 weights, and none
  of its parameters was tuned for this comparison. It is evaluated after every five situations; its
  score at a number of steps is that of its last evaluation before.
* *DQN, TorchRL* is made of TorchRL's own `DQNLoss`, `SoftUpdate`, `Collector`, replay buffer and
  `EGreedyModule`, on `FollowBall` with an `ActionDiscretizer`.
* *DQN, Stable-Baselines3* is its `DQN` on `envs.gymnasium.GymWorld`, which passes both Gymnasium's
  checker of environments and that of Stable-Baselines3. It is installed in an environment of its
  own, `benchmarks/peers/.venv`.

Both DQNs observe the bearing in rad, within ±1, and have the same architecture and schedule, with
Adam and the Huber loss:

$settings

Each DQN has the best of the learning rates that were tried, by the mean score over runs from seed
$first_seed on. Those seeds are used nowhere else (`python -m benchmarks.peers.tune`):

$tuning

Versions: $versions.
""")


def write_page(path: Path, machine: str, results: Results) -> None:
    """Write the page.

    Args:
        path: the file to write.
        machine: the machine on which the results were measured, in words.
        results: the runs of all learners.
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
        "best": len(config.evaluation.situations),
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
    """Return the conclusions from the runs: when each learner arrives, and how long a run takes."""
    ours = WORDS[OURS]
    lines = [f"{ours} {_arrives(results, OURS)}."]
    for name, peer in PEERS.items():
        scores = mean_score(results[name])
        difference = mean_score(results[OURS]).mean() - scores.mean()
        low, high = _difference_interval(mean_score(results[OURS]), scores)
        lines.append(
            f"{peer.words} {_arrives(results, name)}. Over all evaluations {ours} scores "
            f"{difference:+.2f} catches relative to it ({low:+.2f} to {high:+.2f}): "
            f"{_verdict(low, high)}."
        )
    alone, eager = seconds(results[ALONE])[-1], eager_seconds(results)[-1]
    for name, peer in PEERS.items():
        theirs = seconds(results[name])[-1]
        lines.append(
            f"A run of {peer.words} takes {short(theirs / alone)} times as long as a compiled run "
            f"of ours, compiling included. It takes {_about(theirs / eager)} as a run of ours that "
            "steps eagerly, as the peers do, but had the machine for itself."
        )
    return lines


def _about(ratio: float) -> str:
    """Return a ratio of times in words: a rough one, since the conditions weren't the same."""
    return "about as long" if 2 / 3 < ratio < 3 / 2 else f"about {ratio:.2g} times as long"


def _bullet(line: str) -> str:
    return textwrap.fill(line, 100, initial_indent="* ", subsequent_indent="  ")


def _arrives(results: Results, name: str) -> str:
    """Return the steps after which the mean stays at the goal, in words after a learner's name."""
    place = at_last(results[name], GOAL)
    if place is None:
        return f"doesn't come to {GOAL} catches on average, or doesn't stay there"
    steps = results[name][0].steps[place]
    return f"is at {GOAL} catches on average or above from {steps:,} steps on"


def _difference_interval(
    ours: NDArray[np.float64], theirs: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the interval of a difference of two means, by Welch's t."""
    welch = ttest_ind(ours, theirs, equal_var=False)
    low, high = welch.confidence_interval(CONFIDENCE)
    return float(low), float(high)


def _verdict(low: float, high: float) -> str:
    if low > 0:
        return "an advantage"
    return "a disadvantage" if high < 0 else "this may be chance"


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
    center, low, high = score_interval(samples, len(task().evaluation.situations))
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
