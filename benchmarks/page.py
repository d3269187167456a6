"""Write docs/performance.md from templates with figures; keep its section written by hand."""

import re
from collections.abc import Mapping
from pathlib import Path
from string import Template

_TEMPLATE = Template("""\
# Performance

`make bench` measures these figures and writes this page, but for "What was tried".
Measured on $machine. $gpu

Except for worlds, all figures are medians of $repetitions repetitions, with the fastest and the
slowest. The programs took turns, on a machine shared with other users.

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

The same of $network_runs runs with α = 0.02, each value function beside a program in C for it
alone. Two layers learn from 20 situations, the others from 200. The first compiling is tracing the
step, writing it out and gcc's own time.

$networks

## Mountain Car

The same of Sarsa(0.9) with replacing traces, α = 1/16 and 8 tilings, each run for 50 situations, as
in figure 12.10 of Sutton & Barto's book (`+experiment=sutton_barto_12_10`).

$mountain_car

* *C, dense* changes all 1,944 weights and traces in each step. *C, lazy* changes those of the tiles
  that a step visits, and all of them every 32 steps (below, "Lazy traces").
* *JAX* is `jit(scan(vmap))` with dense traces, from a script of its own.

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
keeps one number of each run. "The rest" is what learning adds. The last line compares two peaks,
so it counts what is made for each run before learning, too.

$memory

$large

## An eager step

The time of the parts of one learning step with `engine=eager`. No part includes another: the random
numbers that the world and `restart` draw have their own line. The last line is measured without
the stopwatch that measures the parts.

$eager

$worlds

## What was tried

$by_hand
""")

_WORLDS = Template("""\
## Worlds

`make bench-worlds` measures these figures and writes this section, on $machine.
Repetitions: $repetitions; the figures are the medians.

Thousands of world steps a second, with random actions and without learning. A world step moves the
robot and the balls, reads all sensors and, in our worlds, starts the next situation where one has
ended.

$worlds

$single

* *VMAS* ($vmas, eager torch on the CPU) has the same robot, obstacles and moving balls, and a lidar
  with as many rays as our robot has sonars. A ray is a line; our sonar reads the nearest point of a
  whole cone.
* *IR-SIM* ($irsim) runs one world at a time, here without a display, with the same lidar.
* *ours* is the native loop, on as many threads as training uses. It computes whole vectors of eight
  worlds, or sixteen with AVX-512, so eight worlds take as long as one.

Thousands of learning steps a second of `task=follow_obstacles`, with its 160 rules; compiling isn't
counted.

$learning
""")

_BY_HAND = "by hand: make bench keeps what stands from here …"
_OF_WORLDS = "worlds: make bench-worlds writes what stands from here …"
_END = "<!-- … to here -->"


def write_page(path: Path, sections: Mapping[str, str]) -> None:
    """Write the page, but keep its section on worlds and the section written by hand.

    Args:
        path: the file to write.
        sections: the texts of the template's other fields, by name.
    """
    kept = {"by_hand": _kept(path, _BY_HAND), "worlds": _kept(path, _OF_WORLDS)}
    path.write_text(_TEMPLATE.substitute(sections, **kept), encoding="utf-8")


def write_worlds(path: Path, sections: Mapping[str, str]) -> None:
    """Write the section on worlds of an existing page, and leave the rest as it is.

    Args:
        path: the page.
        sections: the texts of the section's fields, by name.
    """
    page, before = path.read_text(encoding="utf-8"), _kept(path, _OF_WORLDS)
    after = _marked(_OF_WORLDS, _WORLDS.substitute(sections).strip())
    path.write_text(page.replace(before, after), encoding="utf-8")


def _kept(path: Path, name: str) -> str:
    """Return a marked section of a page; a placeholder if there is none."""
    page = path.read_text(encoding="utf-8") if path.exists() else ""
    found = re.search(f"{re.escape(f'<!-- {name} -->')}.*?{re.escape(_END)}", page, re.DOTALL)
    return found[0] if found else _marked(name, "To be written.")


def _marked(name: str, text: str) -> str:
    return f"<!-- {name} -->\n\n{text}\n\n{_END}"
