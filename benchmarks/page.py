"""Write docs/performance.md from a template with figures; keep its section written by hand."""

import re
from collections.abc import Mapping
from pathlib import Path
from string import Template

_TEMPLATE = Template("""\
# Performance

`make bench` measures these figures and writes this page, but for "What was tried".
Measured on $machine. $gpu

All figures are medians of $repetitions repetitions, with the fastest and the slowest. The programs
took turns, on a machine shared with other users.

## Learning

Million learning steps a second: one learning step is one step of the world and one Q(λ) update of
one run, on the default experiment with λ = 0.2.

$speed

* *C limit* is the experiment written by hand in C with SIMD, 16 runs at a time in the first-level
  cache. It keeps no snapshots and its random numbers are simpler: it shows the limit of the
  machine, not of a library.
* *JAX* is `jit(scan(vmap))`, the usual form of fast JAX code ($jax, on 1,100, 11,000 and
  50,000 runs). Each of its readings is the best of three.
* *ours* is `Trainer.learn` with `engine=compiled`, including the snapshots for the evaluation: the
  steps of all runs up to the end of their last situation, divided by the time until the last run
  ends, without compiling. With more than 20,000 runs, each learns from fewer situations, to keep
  the benchmark short. So a larger share of the time passes while the last runs end and the other
  lanes, the places of runs in the batch, are idle.

## Value functions

The same of $network_runs runs, each value function beside a program in C for it alone. The first
compiling is tracing the step, writing it out and gcc's own time.

$networks

## Compiling

Seconds to find the learner's program in the cache on disk, in a new process. Tracing and compiling
with an empty cache are in the next table, in the column "cold".

$compile

## The whole command

Imports, learning, evaluation and files. "Cold" is one command with an empty cache of
compiled programs; "warm" are the commands after it.

$command

The parts of a small command that finds its programs in the cache, beside the imports that any
program with TorchRL makes. The command imports without looking for garbage among the modules
(`fnnq_torchrl.launch.imports`), so it can take less than these imports alone.

$stages

## Memory

Resident memory of the process. We keep the weights of each run at its 41 evaluations; the C program
keeps one number of each run. "The rest" includes what doesn't depend on the number of runs; the
last line excludes it.

$memory

$large

## An eager step

The time of the parts of one learning step with `engine=eager`. No part includes another: the random
numbers that `env.step` and `restart` draw have their own line. The last line is measured without
the stopwatch that measures the parts.

$eager

## What was tried

$by_hand
""")

_BEGIN, _END = "<!-- by hand: make bench keeps what stands from here … -->", "<!-- … to here -->"
_BY_HAND = re.compile(f"{re.escape(_BEGIN)}.*{re.escape(_END)}", re.DOTALL)
_PLACEHOLDER = f"{_BEGIN}\n\nTo be written.\n\n{_END}"


def write_page(path: Path, sections: Mapping[str, str]) -> None:
    """Write the page, and keep its section written by hand, if the file exists.

    Args:
        path: the file to write.
        sections: the texts of the template's other fields, by name.
    """
    kept = _BY_HAND.search(path.read_text(encoding="utf-8")) if path.exists() else None
    by_hand = kept[0] if kept else _PLACEHOLDER
    path.write_text(_TEMPLATE.substitute(sections, by_hand=by_hand), encoding="utf-8")
