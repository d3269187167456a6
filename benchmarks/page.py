"""docs/performance.md: figures in a template, and one section that is written by hand."""

import re
from collections.abc import Mapping
from pathlib import Path
from string import Template

_TEMPLATE = Template("""\
# Performance

`make bench` measures these figures and writes this page; only "What was tried" is written by hand.
Measured on $machine. $gpu

All are medians of $repetitions repetitions, with the fastest and the slowest; the sides took turns,
on a machine shared with others.

## Learning

Million learning steps a second: one learning step is one step of the world and one Q(λ) update of
one run, on the default experiment with λ = 0.2.

$speed

* *C limit* is the experiment written by hand in C with SIMD, 16 runs at a time in the first-level
  cache. It keeps no snapshots and its random numbers are simpler: not what a library could do, but
  what the machine can.
* *JAX* is `jit(scan(vmap))`, the way fast JAX code is written ($jax, on 1,100, 11,000 and
  50,000 runs). Each of its readings is the best of three.
* *ours* is `Trainer.learn` with `engine=compiled`, the snapshots for the evaluation included: the
  steps of all runs up to the end of their last situation, over the time until the last run is done,
  without compiling. More than 20,000 runs have fewer situations each, to keep the benchmark short;
  while the last runs end, lanes stand idle for a larger share of the time than with 200.

## Value functions

The same of $network_runs runs, each value function beside a program in C for it alone. The first
compiling is tracing the step, writing it out and gcc's own time.

$networks

## Compiling

Seconds to trace the learner's step and to find its program in the cache on disk, in a new process;
compiling with an empty cache is in the next table, cold.

$compile

## The whole command

Imports, learning, evaluation and files. Cold is with an empty cache of compiled programs, once;
warm is what follows.

$command

## Memory

Resident memory of the process. Of each run we keep the weights at each of its 41 evaluations, the C
program keeps one number. "The rest" has in it what tracing the step takes, however many runs there
are; the last line hasn't.

$memory

$large

## An eager step

Where the time of one learning step goes with `engine=eager`. Each part is without the others: the
draws of random numbers, which `env.step` and `restart` make, stand by themselves. The last line is
measured without the stopwatch of the others.

$eager

## What was tried

$by_hand
""")

_BEGIN, _END = "<!-- by hand: make bench keeps what stands from here … -->", "<!-- … to here -->"
_BY_HAND = re.compile(f"{re.escape(_BEGIN)}.*{re.escape(_END)}", re.DOTALL)
_PLACEHOLDER = f"{_BEGIN}\n\nTo be written.\n\n{_END}"


def write_page(path: Path, sections: Mapping[str, str]) -> None:
    """Write the page anew, with what is by hand in it as it was."""
    kept = _BY_HAND.search(path.read_text(encoding="utf-8")) if path.exists() else None
    by_hand = kept[0] if kept else _PLACEHOLDER
    path.write_text(_TEMPLATE.substitute(sections, by_hand=by_hand), encoding="utf-8")
