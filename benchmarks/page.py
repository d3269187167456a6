"""Writes docs/performance.md: a template with figures, and one section written by hand."""

import re
from collections.abc import Mapping
from pathlib import Path
from string import Template

_TEMPLATE = Template("""\
# Performance

`make bench` measures these figures and writes this page, but for "What was tried".
Measured on $machine. $gpu

All are medians of $repetitions repetitions, with the fastest and the slowest; the sides took turns,
on a machine shared with others.

## Learning

Million learning steps a second: one learning step is one step of the world and one Q(λ) update of
one run, on the default experiment with λ = 0.2.

$speed

* *C limit* is the experiment written by hand in C with SIMD, 16 runs at a time in the first-level
  cache. It keeps no snapshots and its random numbers are simpler: it shows the limit of the
  machine, not of a library.
* *JAX* is `jit(scan(vmap))`, the usual form of fast JAX code ($jax, on 1,100, 11,000 and
  50,000 runs). Each of its readings is the best of three.
* *ours* is `Trainer.learn` with `engine=compiled`, the snapshots for the evaluation included: the
  steps of all runs up to the end of their last situation, over the time until the last run ends,
  without compiling. More than 20,000 runs have fewer situations each, to keep the benchmark short;
  so lanes are idle for a larger share of the time, while the last runs end.

## Compiling

Seconds to trace the learner's step and to load its program from the cache on disk, in a new
process. The next table has compiling with an empty cache, in the column "cold".

$compile

## The whole command

Imports, learning, evaluation and files. "Cold" is one command with an empty cache of
compiled programs; "warm" are those after it.

$command

## Memory

Resident memory of the process. We keep the weights of each run at its 41 evaluations; the C program
keeps one number of each run. "The rest" includes the memory for tracing the step, which doesn't
depend on the number of runs; the last line leaves it out.

$memory

$large

## An eager step

The time of the parts of one learning step with `engine=eager`. No part includes another: the random
numbers that `env.step` and `restart` draw have their own line. The last line is measured without
the stopwatch of the others.

$eager

## What was tried

$by_hand
""")

_BEGIN, _END = "<!-- by hand: make bench keeps what stands from here … -->", "<!-- … to here -->"
_BY_HAND = re.compile(f"{re.escape(_BEGIN)}.*{re.escape(_END)}", re.DOTALL)
_PLACEHOLDER = f"{_BEGIN}\n\nTo be written.\n\n{_END}"


def write_page(path: Path, sections: Mapping[str, str]) -> None:
    """Write the page; keep the section that is written by hand."""
    kept = _BY_HAND.search(path.read_text(encoding="utf-8")) if path.exists() else None
    by_hand = kept[0] if kept else _PLACEHOLDER
    path.write_text(_TEMPLATE.substitute(sections, by_hand=by_hand), encoding="utf-8")
