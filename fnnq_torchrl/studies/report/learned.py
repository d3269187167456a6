"""The part of the report on what a run has learned: its rules, its controller and Q."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules import Controller, RuleBase
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.studies.report.charts import COLOURS, Chart, Line, Missing, line_chart, number_of
from fnnq_torchrl.studies.rules.job import KINDS, Chosen, choose, read_job
from fnnq_torchrl.training.policies import load_policy

_ACROSS, _UP = 61, 41
_POINTS = 161
_OVERLAP = 1.1
"""Cells overlap a little; otherwise the page would show through between them."""


@dataclass(frozen=True)
class Grid:
    """A table of rules.

    Attributes:
        title: the title; empty if there is a single table.
        corner: the names of the inputs.
        columns: the labels of the action.
        rows: for each combination of state labels its words, and for each action label the number
            of the rule, its sentence and its consequent.
    """

    title: str
    corner: str
    columns: list[str]
    rows: list[tuple[str, list[tuple[int, str, str]]]]


@dataclass(frozen=True)
class Words:
    """A controller in words.

    Attributes:
        head: the head of the table of stretches.
        stretches: the rows: from, to, action, word; empty for several state inputs.
        sentences: the rules of the distilled controller.
        difference: the distance of the distilled controller from the best action, in a sentence.
    """

    head: list[str]
    stretches: list[list[str]]
    sentences: list[str]
    difference: str


def rules_of(directory: Path, seed: int, config: Config, *, own: bool) -> Chosen:
    """Return the rules of a run.

    Raises:
        OSError, ValueError: if the job's files can't be read, or are damaged.
        Missing: if the value function has no rules.
    """
    if config.value.kind not in KINDS:
        *others, last = KINDS
        known = f"{', '.join(others)} and {last}"
        raise Missing(f"value={config.value.kind} has no rules; {known} have.")
    return choose(read_job(directory, own=own), str(seed))


def grids(chosen: Chosen) -> Iterator[Grid]:
    """Yield a table for each part of a run's rules; the rules are numbered through all parts."""
    number = 0
    for part in chosen.parts:
        names = ", ".join(variable.name for variable in part.states)
        columns, rows = [*part.action.names], dict[str, list[tuple[int, str, str]]]()
        for labels, value in part.rules():
            words = ", ".join(label.name for label in labels[:-1])
            sentence = f"if {part.premise(labels)} then {part.output} is {value:.3f}"
            rows.setdefault(words, []).append((number, sentence, f"{value:.3f}"))
            number += 1
        title = f"The part of {names}" if len(chosen.parts) > 1 else ""
        yield Grid(title, f"{names} / {part.action.name}", columns, [*rows.items()])


def words_of(found: Controller, state: str) -> Words:
    """Return a controller in words.

    Args:
        found: the controller.
        state: the name of the first state input.
    """
    return Words(
        [f"{state} from", "to", found.action.name, "in words"],
        [
            [
                f"{each.low:+.3f}",
                f"{each.high:+.3f}",
                f"{each.action:+.3g}",
                found.word(each.action),
            ]
            for each in found.stretches
        ],
        found.sentences(),
        f"It differs from the best action by {found.mean_difference:.3f} in the mean and "
        f"{found.largest_difference:.3f} at most, over the whole range of states.",
    )


def membership_charts(rules: RuleBase) -> Iterator[Chart]:
    """Yield a chart of the labels of each variable."""
    for variable in rules.inputs:
        x = torch.linspace(*variable.span(), _POINTS, dtype=torch.float64)
        degrees = variable.log_degrees(x).exp()
        lines = [
            Line(label.name, x.numpy(), degree.numpy())
            for label, degree in zip(variable.labels, degrees, strict=True)
        ]
        yield line_chart(
            lines[:COLOURS],
            variable.name,
            "degree of membership",
            title=f"The labels of {variable.name}",
            alt=f"The degree of membership of each label of {variable.name}.",
            bounds=(0, 1),
        )


@torch.no_grad()
def surface(
    directory: Path,
    seed: int,
    config: Config,
    chosen: Chosen | None,
    controller: Controller | None,
    *,
    own: bool,
) -> Chart:
    """Return a chart of Q over an input and the action, with the greedy action as a line.

    Args:
        directory: the job's directory.
        seed: the run's seed.
        config: the job's configuration.
        chosen: the run's rules, if it has any.
        controller: their controller, whose distilled form is a dashed line.
        own: True to import the user's own classes.

    Raises:
        OSError, ValueError: if the job's files can't be read, or are damaged.
        Missing: if an input has no bounds.
    """
    network = load_policy(directory, seed, own=own).value_network
    ranges = [_range(name, config, chosen) for name in network.in_keys]
    states = _states(ranges)
    values = _action_values(network, states)
    x, actions = states[:, 0], network.candidates.double()
    half_x = float(x[1] - x[0]) / 2
    half_a = float((actions.max() - actions.min()) / max(1, len(actions) - 1)) / 2 or 0.5
    cells = [
        {
            "x": number_of(at - half_x),
            "x2": number_of(at + _OVERLAP * half_x),
            "y": number_of(action - half_a),
            "y2": number_of(action + _OVERLAP * half_a),
            "q": number_of(values[i, j]),
        }
        for i, at in enumerate(x.tolist())
        for j, action in enumerate(actions.tolist())
        if j % max(1, len(actions) // _UP) == 0
    ]
    if any(cell["q"] is None for cell in cells):
        raise Missing("Q is not a finite number everywhere; the run has diverged.")
    first, action = network.in_keys[0], config.env.action_name
    lines = [
        {"x": number_of(at), "y": number_of(best), "line": "greedy"}
        for at, best in zip(x.tolist(), actions[values.argmax(-1)].tolist(), strict=True)
    ]
    note = "White: the greedy action"
    if controller is not None:
        smooth = controller.distilled.evaluate(states)
        lines += [
            {"x": number_of(at), "y": number_of(best), "line": "distilled"}
            for at, best in zip(x.tolist(), smooth.tolist(), strict=True)
        ]
        note += "; dashed: the distilled controller"
    if fixed := [f"{name} = {state:g}" for name, state in _fixed(network, states)]:
        note += f"; where {', '.join(fixed)}"
    return Chart(
        f"Q over {first} and {action}",
        _surface_spec(cells, lines, first, action),
        f"Q of each {first} and {action}; the greedy action is a line.",
        note=f"{note}.",
    )


def _range(name: str, config: Config, chosen: Chosen | None) -> tuple[float, float]:
    """Return the range of an input: that of its labels, or else of the world."""
    if chosen is not None:
        spans = {variable.name: variable.span() for variable in chosen.rules.states}
        low, high = spans[name]
    else:
        low, high = config.env.observations[name]
    if not (isfinite(low) and isfinite(high)):
        raise Missing(f"The input {name} has no bounds, between which Q could be drawn.")
    return low, high


def _states(ranges: list[tuple[float, float]]) -> Tensor:
    """Return states along the first input, the others in their middles, ``[points, inputs]``."""
    columns = [torch.linspace(*ranges[0], _ACROSS, dtype=torch.float64)]
    columns += [torch.full_like(columns[0], (low + high) / 2) for low, high in ranges[1:]]
    return torch.stack(columns, dim=-1)


def _fixed(network: ValueNetwork, states: Tensor) -> list[tuple[str, float]]:
    return [*zip(network.in_keys[1:], states[0, 1:].tolist(), strict=True)]


def _action_values(network: ValueNetwork, states: Tensor) -> Tensor:
    """Return Q of a single run, ``[points, candidates]``, float64."""
    seen = states.to(network.candidates.dtype).T.reshape(states.shape[1], 1, -1, 1)
    return network(*seen)[0].double()


def _surface_spec(
    cells: list[dict[str, Any]], lines: list[dict[str, Any]], x: str, action: str
) -> dict[str, Any]:
    colour = {
        "field": "q",
        "type": "quantitative",
        "title": "Q",
        "scale": {"scheme": "viridis", "zero": False},
        "legend": {"gradientLength": 220},
    }
    nice = {"zero": False, "nice": False}
    across = {"field": "x", "type": "quantitative", "title": x, "scale": nice}
    up = {"field": "y", "type": "quantitative", "title": action, "scale": nice}
    q = {"field": "q", "type": "quantitative", "title": "Q", "format": ".3f"}
    dashes = {"domain": ["greedy", "distilled"], "range": [[1, 0], [6, 4]]}
    dash = {"field": "line", "type": "nominal", "legend": None, "scale": dashes}
    return {
        "height": 280,
        "layer": [
            {
                "data": {"values": cells},
                "mark": {"type": "rect", "aria": False},
                "encoding": {
                    "x": across,
                    "x2": {"field": "x2"},
                    "y": up,
                    "y2": {"field": "y2"},
                    "color": colour,
                    "tooltip": [
                        {"field": "x", "type": "quantitative", "title": x, "format": ".2f"},
                        {"field": "y", "type": "quantitative", "title": action, "format": ".2f"},
                        q,
                    ],
                },
            },
            {
                "data": {"values": lines},
                "mark": {"type": "line", "color": "white", "strokeWidth": 2, "aria": False},
                "encoding": {"x": across, "y": up, "strokeDash": dash},
            },
        ],
    }
