"""The page for playing with a controller: one HTML file that needs no other file and no network."""

import json
from dataclasses import asdict, replace
from html import escape
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import torch

from envs.robot.held_ball import HeldBall
from envs.robot.schemas import FollowBallConfig
from fnnq_torchrl.agent.rules import RuleBase, RulesError
from fnnq_torchrl.agent.rules.formats import WRITERS
from fnnq_torchrl.agent.values import FNNQValue, make_value_network
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.studies.play.program import write_program
from fnnq_torchrl.training.policies import best_seed, load_policy
from fnnq_torchrl.training.weights import load_checkpoint

_STARTS = 200
"""The number of starts of the ball; the page uses them in turn."""

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
            isn't one of ``task=follow``.
        Unsupported: if the job's value function can't be written out in JavaScript.
    """
    checkpoint = load_checkpoint(run / "checkpoint.pt")
    seed = best_seed(run) if seed is None else seed
    config = to_config(checkpoint.config, own=own)
    network = load_policy(run, seed, own=own).value_network
    world = config.env.tested
    if not isinstance(world, FollowBallConfig):
        raise ValueError(f"{run}: its world is {world.kind}; the page is for task=follow")
    program = write_program(world, network, seed)
    learned = {name: weight[0].flatten().tolist() for name, weight in network.named_parameters()}
    unlearned = make_value_network(config.value, network.candidates, 1)
    before = {
        name: weight[0].flatten().tolist()
        for name, weight in unlearned.start(torch.tensor([[seed]])).items()
    }
    data = {
        "world": asdict(world),
        "action": world.action_name,
        "candidates": network.candidates.tolist(),
        "leaves": program.leaves,
        "weights": {"before": before, "after": learned},
        "starts": _starts(world, seed, network.candidates.dtype),
    }
    if type(network) is FNNQValue:
        rules = RuleBase.from_network(network, config.value, config.env, run=0)
        data |= {"rules": _rules(rules), "files": _files(rules)}
    title = f"{run.absolute().name}, seed {seed}"
    text = _part("play.html")
    for name, part in {
        "title": escape(title),
        "style": _part("play.css"),
        "data": json.dumps(data).replace("<", "\\u003c"),
        "step": program.text.replace("export function", "function"),
        "script": f"{_part('robot.js', 'fnnq_torchrl.studies')}\n{_part('play.js')}",
    }.items():
        text = text.replace(f"@{name}@", part)
    return text


def _part(name: str, package: str = __package__) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")


def _starts(world: FollowBallConfig, seed: int, dtype: torch.dtype) -> list[dict[str, float]]:
    """Return the ball's state at the start of each of the run's first episodes."""
    env = HeldBall(world, [_STARTS], dtype=dtype)
    episode = torch.arange(_STARTS).unsqueeze(-1)
    start = env.start(torch.full_like(episode, seed), episode)
    keys = "ball_angle_rad", "ball_speed_radps", "ball_x_m", "ball_y_m", "held"
    rows = zip(*(start[key].squeeze(-1).tolist() for key in keys), strict=True)
    return [dict(zip(keys, row, strict=True)) for row in rows]


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
