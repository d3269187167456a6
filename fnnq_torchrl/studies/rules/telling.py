"""Reports on a run's rules as text, Markdown, CSV or JSON."""

import csv
import io
import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import torch

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
    """Return the rules as CSV, a row for each rule with its firing strength."""
    rows = _rows(reading)
    text = io.StringIO()
    writer = csv.DictWriter(text, [*rows[0]], lineterminator="\n")
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
            "switches": controller.switches,
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
    rows = reading.chosen.rules.table()
    fired = reading.fired.flatten().tolist()
    learned = None if reading.learned is None else reading.learned.flatten().tolist()
    spread = reading.chosen.spread
    for i, row in enumerate(rows):
        if spread is not None:
            row["spread"] = float(spread.flatten()[i])
        row["fired"] = fired[i]
        row["hardly_trained"] = fired[i] < HARDLY
        if learned is not None:
            row["fired_while_learning"] = learned[i]
    return rows


def _sections(
    reading: Reading, heading: str, grid: Callable[[Grid], str], item: str
) -> Iterator[str]:
    rules, controller, action = reading.chosen.rules, reading.controller, reading.controller.action
    spread = reading.chosen.spread
    yield f"{reading.job.directory}, {reading.chosen.words}"
    yield ""
    yield heading.format("The consequents" + (" and their spread" if spread is not None else ""))
    numbers = [f"{value:.3f}" for value in rules.consequents.flatten().tolist()]
    if spread is not None:
        spreads = spread.flatten().tolist()
        numbers = [f"{value} ± {std:.3f}" for value, std in zip(numbers, spreads, strict=True)]
    yield grid(_grid(reading, numbers))
    yield heading.format(
        f"How strongly each rule fired, summed over the {reading.steps} steps of the test's replay"
    )
    fired = reading.fired.flatten().tolist()
    yield grid(_grid(reading, [f"{value:.1f}{'*' if value < HARDLY else ''}" for value in fired]))
    if reading.hardly_trained.any():
        yield f"* less than {HARDLY:g}: hardly trained\n"
    if reading.learned is not None:
        yield heading.format("How strongly each rule fired while learning, summed over its steps")
        learned = reading.learned.flatten().tolist()
        yield grid(_grid(reading, [f"{value:.1f}" for value in learned]))
    yield heading.format("The rules")
    for (labels, _), value, strength in zip(rules.rules(), numbers, fired, strict=True):
        mark = " (hardly trained)" if strength < HARDLY else ""
        sentence = f"if {rules.premise(labels)} then {rules.output} is {value}"
        yield item.format(f"{sentence}{mark}")
    yield ""
    yield heading.format("The controller: the best action")
    if controller.stretches:
        [state] = rules.states
        rows = [
            [
                f"{each.low:+.3f}",
                f"{each.high:+.3f}",
                _number(each.action),
                controller.word(each.action),
            ]
            for each in controller.stretches
        ]
        yield grid(([f"{state.name} from", "to", action.name, ""], rows))
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


def _grid(reading: Reading, cells: Sequence[str]) -> Grid:
    """Return a table of cells, one for each rule: rows are state labels, columns action labels."""
    rules = reading.chosen.rules
    columns = len(rules.action.labels)
    heads = [
        ", ".join(variable.labels[i].name for variable, i in zip(rules.states, places, strict=True))
        for places in torch.cartesian_prod(
            *(torch.arange(len(variable.labels)) for variable in rules.states)
        )
        .reshape(-1, len(rules.states))
        .tolist()
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
