"""Reports on a run's rules as text, Markdown, CSV or JSON."""

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from math import prod
from typing import Any

from fnnq_torchrl.agent.rules import Controller, RuleBase, partition
from fnnq_torchrl.studies.reproduction.markdown import table
from fnnq_torchrl.studies.rules.reading import HARDLY, Reading

Grid = tuple[list[str], list[list[str]]]
"""A table: the head and the rows."""


def as_text(reading: Reading) -> str:
    """Return the whole report as aligned text for a terminal."""
    return "\n".join(_sections(reading, "{}", _aligned, "  {}"))


def as_markdown(reading: Reading) -> str:
    """Return the whole report in Markdown."""
    return "\n".join(_sections(reading, "## {}\n", lambda grid: table(*grid), "* {}"))


def as_csv(reading: Reading) -> str:
    """Return the report as one CSV table, whose column ``what`` tells the kinds of rows apart.

    ``rule``: a rule with its firing strength; ``best action``: a stretch of the first state input
    with the best action there; ``switch``: a place where it changes; both with the labels at which
    the other state inputs are held; ``distilled``: a rule of the distilled controller.
    """
    controller = reading.controller
    first, name = reading.chosen.rules.states[0].name, controller.action.name
    rows = [{"what": "rule"} | row for row in _rows(reading)]
    rows += [
        {
            "what": "best action",
            **each.others,
            "from": each.low,
            "to": each.high,
            name: each.action,
            "word": controller.word(each.action),
        }
        for each in controller.stretches
    ]
    rows += [{"what": "switch", **each.others, first: each.low} for each in controller.switches]
    rows += [
        {"what": "distilled"} | row | {"word": controller.word(row[name])}
        for row in controller.distilled.table()
    ]
    columns = dict.fromkeys(column for row in rows for column in row)
    text = io.StringIO()
    writer = csv.DictWriter(text, [*columns], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().rstrip("\n")


def as_json(reading: Reading) -> str:
    """Return the whole report as JSON."""
    controller = reading.controller
    content = {
        "run": str(reading.job.directory),
        "which": reading.chosen.words,
        "steps": reading.steps,
        "rules": _rows(reading),
        "controller": {
            "stretches": [vars(stretch) for stretch in controller.stretches],
            "switches": [stretch.low for stretch in controller.switches],
            "distilled": controller.distilled.table(),
            "largest_difference": controller.largest_difference,
            "mean_difference": controller.mean_difference,
        },
        "score": {
            "measure": reading.score_words,
            "full": reading.full_score,
            "distilled": reading.distilled_score,
        },
    }
    return json.dumps(content, indent=2)


FORMATS: dict[str, Callable[[Reading], str]] = {
    "text": as_text,
    "markdown": as_markdown,
    "csv": as_csv,
    "json": as_json,
}
"""The function for each value of ``format=``."""


def _rows(reading: Reading) -> list[dict[str, Any]]:
    """Return a row for each rule: its labels, consequent, spread and firing strengths."""
    rows = []
    for part, fired, spread in _parts(reading):
        columns: dict[str, list[float]] = {} if spread is None else {"spread": spread}
        columns["fired"] = fired
        learned = _while_learning(reading)
        if learned is not None:
            columns["fired_while_learning"] = learned
        for i, row in enumerate(part.table()):
            row |= {name: column[i] for name, column in columns.items()}
            rows.append(row | {"hardly_trained": (learned or fired)[i] < HARDLY})
    return rows


def _parts(reading: Reading) -> Iterator[tuple[RuleBase, list[float], list[float] | None]]:
    """Yield each part of the rules, with its rules' firing strengths and spreads."""
    spreads = reading.chosen.spread or (None,) * len(reading.fired)
    for part, fired, spread in zip(reading.chosen.parts, reading.fired, spreads, strict=True):
        yield part, fired.flatten().tolist(), None if spread is None else spread.flatten().tolist()


def _while_learning(reading: Reading) -> list[float] | None:
    """Return the rules' firing strengths while learning, if the job has counted them."""
    return None if reading.learned is None else reading.learned.flatten().tolist()


def _sections(
    reading: Reading, heading: str, grid: Callable[[Grid], str], item: str
) -> Iterator[str]:
    yield f"{reading.job.directory}, {reading.chosen.words}"
    yield ""
    if len(reading.chosen.parts) > 1:
        yield "Q is the sum of the rule bases below.\n"
    if reading.job.learns_labels:
        yield heading.format("The labels that this run has learned")
        yield grid(_learned_labels(reading))
    for part, fired, spread in _parts(reading):
        yield from _sections_of(part, fired, spread, reading, heading, grid, item)
    yield from _sections_of_controller(reading, heading, grid, item)


def _sections_of(
    rules: RuleBase,
    fired: Sequence[float],
    spread: Sequence[float] | None,
    reading: Reading,
    heading: str,
    grid: Callable[[Grid], str],
    item: str,
) -> Iterator[str]:
    """Yield the sections about a part of the rules."""
    names = " and ".join(variable.name for variable in rules.states)
    of = f" of {names}" if len(reading.chosen.parts) > 1 else ""
    yield heading.format(f"The consequents{of}" + (" and their spread" if spread else ""))
    numbers = [f"{value:.3f}" for value in rules.consequents.flatten().tolist()]
    if spread:
        numbers = [f"{value} ± {std:.3f}" for value, std in zip(numbers, spread, strict=True)]
    yield grid(_grid(rules, numbers))
    yield heading.format(
        f"How strongly each rule{of} fired, summed over the {reading.steps} steps of the test's "
        "replay"
    )
    learned = _while_learning(reading)
    if learned is not None:
        yield grid(_grid(rules, [f"{value:.1f}" for value in fired]))
        yield heading.format("How strongly each rule fired while learning, summed over its steps")
    trained = learned or fired
    yield grid(_grid(rules, [f"{value:.1f}{'*' if value < HARDLY else ''}" for value in trained]))
    if min(trained) < HARDLY:
        yield f"* less than {HARDLY:g}: hardly trained\n"
    yield heading.format(f"The rules{of}")
    for (labels, _), value, strength in zip(rules.rules(), numbers, trained, strict=True):
        mark = " (hardly trained)" if strength < HARDLY else ""
        sentence = f"if {rules.premise(labels)} then {rules.output} is {value}"
        yield item.format(f"{sentence}{mark}")
    yield ""


def _sections_of_controller(
    reading: Reading, heading: str, grid: Callable[[Grid], str], item: str
) -> Iterator[str]:
    """Yield the sections about the best action and the distilled controller."""
    controller = reading.controller
    yield heading.format("The controller: the best action")
    if len(reading.chosen.rules.states) == 1:
        yield grid(_stretches(controller, reading.chosen.rules.states[0].name))
        places = ", ".join(f"{each.low:+.4f}" for each in controller.switches) or "none"
        yield f"Switching points of {reading.chosen.rules.states[0].name}: {places}\n"
    else:
        yield from _slices(reading, item)
    yield heading.format("The distilled controller: one number for each state rule")
    for sentence in controller.sentences():
        yield item.format(sentence)
    yield (
        f"\nIts difference from the best action: {controller.mean_difference:.3f} in the mean, "
        f"{controller.largest_difference:.3f} at most."
    )
    yield (
        f"{reading.score_words.capitalize()}: {reading.full_score:g} by the best action, "
        f"{reading.distilled_score:g} by the distilled controller."
    )


def _stretches(controller: Controller, state: str) -> Grid:
    """Return a table of the best action over a single state input."""
    rows = [
        [
            f"{each.low:+.3f}",
            f"{each.high:+.3f}",
            _number(each.action),
            controller.word(each.action),
        ]
        for each in controller.stretches
    ]
    return [f"{state} from", "to", controller.action.name, ""], rows


def _slices(reading: Reading, item: str) -> Iterator[str]:
    """Yield lines on the best action over the first of several state inputs, in words.

    There is a line for each combination of the other inputs' labels.
    """
    controller = reading.controller
    first, *others = reading.chosen.rules.states
    if not controller.stretches:
        number = prod(len(other.labels) for other in others)
        yield (
            f"It isn't listed, since there would be {number:,} lines: one for each combination of "
            f"the labels of {', '.join(other.name for other in others)}.\n"
        )
        return
    yield f"{first.name} rises over its range; the other inputs stay at their labels' middles.\n"
    for labels, along in groupby(controller.stretches, key=lambda each: each.others):
        words = groupby(along, key=lambda each: controller.word(each.action))
        begins = [(word, next(same).low) for word, same in words]
        told = [begins[0][0], *(f"{word} from {low:+.3f}" for word, low in begins[1:])]
        held = ", ".join(f"{name} {label}" for name, label in labels.items())
        yield item.format(f"{held}: {', '.join(told)}")
    yield ""


def _learned_labels(reading: Reading) -> Grid:
    """Return a table of the labels' centres and widths, now and before learning."""
    config = reading.job.config
    before = [
        label for variable in partition(config.value, config.env) for label in variable.labels
    ]
    after = [
        (variable.name, label)
        for variable in reading.chosen.rules.inputs
        for label in variable.labels
    ]
    rows = [
        [name, label.name, *(f"{number:.4g}" for number in (*label.parameters, *old.parameters))]
        for (name, label), old in zip(after, before, strict=True)
    ]
    return ["", "label", "centre", "width", "centre before", "width before"], rows


def _grid(rules: RuleBase, cells: Sequence[str]) -> Grid:
    """Return a table of cells, one for each rule: rows are state labels, columns action labels."""
    columns = len(rules.action.labels)
    heads = [
        ", ".join(label.name for label in labels[:-1]) for labels, _ in [*rules.rules()][::columns]
    ]
    corner = f"{', '.join(variable.name for variable in rules.states)} \\ {rules.action.name}"
    rows = [[head, *cells[i * columns : (i + 1) * columns]] for i, head in enumerate(heads)]
    return [corner, *rules.action.names], rows


def _aligned(grid: Grid) -> str:
    """Return a table as aligned text: the first column to the left, the others to the right."""
    lines = [grid[0], *grid[1]]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "".join(
        "  "
        + "  ".join(
            cell.ljust(width) if i == 0 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        + "\n"
        for line in lines
    )


def _number(action: float) -> str:
    """Return a number with its sign; rounding errors around 0 become 0."""
    return f"{action + 0.0 if abs(action) > 1e-6 else 0.0:+.3g}"
