"""The page for playing with a controller: one HTML file that needs no other file and no network."""

import json
from dataclasses import replace
from html import escape
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import torch

from fnnq_torchrl.agent.rules import RuleBase, RulesError
from fnnq_torchrl.agent.rules.formats import WRITERS
from fnnq_torchrl.agent.values import FNNQValue, make_value_network
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.engine.native.errors import Unsupported
from fnnq_torchrl.studies.play.program import write_program
from fnnq_torchrl.studies.play.scene import WORDS, scene_of
from fnnq_torchrl.training.policies import best_seed, load_policy
from fnnq_torchrl.training.weights import load_checkpoint

_DOWNLOADS = {
    ".txt": "as sentences, from which learning can start: rules.prior=rules.txt",
    ".fll": "for FuzzyLite",
    ".c": "as C for a robot; it needs rules.h",
    ".h": "the header of rules.c",
}


def make_page(run: Path, seed: int | None = None, *, own: bool = False) -> str:
    """Return the HTML text of the page for one run of a finished job.

    Args:
        run: the job's directory.
        seed: the seed of the run; by default that of the job's best run.
        own: whether to import the user's classes that the configuration names.

    Raises:
        OSError: if a file can't be read.
        ValueError: if the job's files are damaged, the job has no run with this seed, or its world
            or its value function can't be written out in JavaScript. The message is one line.
    """
    checkpoint = load_checkpoint(run / "checkpoint.pt")
    seed = best_seed(run) if seed is None else seed
    config = to_config(checkpoint.config, own=own)
    network = load_policy(run, seed, own=own).value_network
    world = config.env.tested
    instead = f"to see what it has learned: python -m fnnq_torchrl.watch run={run}"
    if world.kind not in WORDS:
        played = "follow, follow_obstacles and wander"
        raise ValueError(f"{run}: its world is {world.kind}; the page plays {played}; {instead}")
    try:
        program = write_program(world, network, seed)
    except Unsupported as error:
        raise ValueError(f"{run}: can't be written in JavaScript ({error}); {instead}") from error
    words = WORDS[world.kind]
    learned = {name: weight[0].flatten().tolist() for name, weight in network.named_parameters()}
    unlearned = make_value_network(config.value, network.candidates, 1)
    before = {
        name: weight[0].flatten().tolist()
        for name, weight in unlearned.start(torch.tensor([[seed]])).items()
    }
    data = {
        "scene": scene_of(world, seed, network.candidates.dtype),
        "time_step_s": world.time_step_s,
        "ends": [words.failure, words.success],
        "inputs": [*network.in_keys],
        "action": world.action_name,
        "candidates": network.candidates.tolist(),
        "leaves": program.leaves,
        "weights": {"before": before, "after": learned},
    }
    if type(network) is FNNQValue:
        rules = RuleBase.from_network(network, config.value, config.env, run=0)
        data |= {"rules": _rules(rules), "files": _files(rules)}
    title = f"{run.absolute().name}, seed {seed}"
    text = _part("play.html")
    for name, part in {
        "title": escape(title),
        "heading": words.heading,
        "drag": words.drag,
        "style": _part("play.css"),
        "data": json.dumps(data).replace("<", "\\u003c"),
        "step": program.text.replace("export function", "function"),
        "script": f"{_part('robot.js', 'fnnq_torchrl.studies')}\n{_part('play.js')}",
    }.items():
        text = text.replace(f"@{name}@", part)
    return text


def _part(name: str, package: str = __package__) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")


def _rules(rules: RuleBase) -> dict[str, Any]:
    """Return the headings of the table of rules and the sentence of each rule.

    The table has a row for each combination of the first inputs' labels, and a column for each
    label of the last input.
    """
    words = [[label.name for label in variable.labels] for variable in rules.inputs]
    premises = [rules.premise(labels) for labels, _ in rules.rules()]
    names = [variable.name for variable in rules.inputs]
    return {
        "corner": f"{', '.join(names[:-1])} / {names[-1]}",
        "rows": [", ".join(row) for row in product(*words[:-1])],
        "columns": words[-1],
        "sentences": [f"if {premise} then {rules.output} is" for premise in premises],
    }


def _files(rules: RuleBase) -> list[dict[str, str]]:
    """Return the files that the page offers, with ``@n@`` in place of the number of rule n.

    Each file is written with numbers that occur nowhere else in it. These numbers are then replaced
    by the placeholders.
    """
    count = rules.consequents.numel()
    marks = [f"{2**20 + n}.5" for n in range(count)]
    numbers = torch.tensor([*map(float, marks)], dtype=torch.float64)
    marked = replace(rules, consequents=numbers.view_as(rules.consequents))
    written: dict[str, bytes] = {}
    for ending in (".txt", ".fll", ".c"):
        try:
            written |= WRITERS[ending].write(marked, rules.candidates, "rules", False)
        except RulesError:  # a format that can't express these rules
            continue
    found = []
    for ending, title in _DOWNLOADS.items():
        if ending in written:
            text = written[ending].decode()
            text = text.replace(f"{marks[0]} {marks[-1]}", "@low@ @high@")
            for number, mark in enumerate(marks):
                text = text.replace(mark, f"@{number}@")
            found.append({"name": f"rules{ending}", "title": title, "text": text})
    return found
