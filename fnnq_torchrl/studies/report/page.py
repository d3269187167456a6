"""The report's page: one HTML file that needs no other file and no network."""

import base64
import hashlib
import json
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from fnnq_torchrl.launch.streams import one_line
from fnnq_torchrl.studies.report import courses, drives, learned, making, scores
from fnnq_torchrl.studies.report.charts import libraries
from fnnq_torchrl.studies.results.collect import Configuration, Results
from fnnq_torchrl.training.pictures.style import count_words
from fnnq_torchrl.training.results import best_run

_UNFIT = OSError, ValueError, TypeError, LookupError, ArithmeticError, RuntimeError
"""The errors that a damaged file, or one that doesn't fit the others, leads to."""

Made = TypeVar("Made")


@dataclass
class _Reasons:
    """The reasons why parts of the page are missing, by part."""

    of: dict[str, str] = field(default_factory=dict)

    def attempt(self, part: str, make: Callable[[], Made]) -> Made | None:
        """Return what a function makes, or None after noting why it can't be made."""
        try:
            return make()
        except _UNFIT as error:
            self.of[part] = one_line(error)
            return None


def make_report(directory: Path, results: Results, *, own: bool = False) -> str:
    """Return the HTML text of the report.

    Args:
        directory: the directory of the job, the sweep or the experiment.
        results: the results of all its jobs.
        own: True to import the user's own classes that configurations name.

    Raises:
        ConfigError: if the extra ``report`` isn't installed.
    """
    library = libraries()
    kinds = scores.scores_of(results)
    best, reasons = kinds[0].best, _Reasons()
    of_best, seed = _best_run(best)
    config = best.job.config
    chosen = reasons.attempt("rules", lambda: learned.rules_of(of_best, seed, config, own=own))
    controller = words = None
    if chosen is not None:
        controller = reasons.attempt("controller", chosen.rules.controller)
    if chosen is not None and controller is not None:
        words = learned.words_of(controller, chosen.rules.states[0].name)
    charts = {
        "surface": reasons.attempt(
            "surface",
            lambda: [learned.surface(of_best, seed, config, chosen, controller, own=own)],
        ),
        "weights": reasons.attempt("weights", lambda: courses.weight_charts(of_best, seed, chosen)),
        "parameters": reasons.attempt(
            "parameters", lambda: courses.parameter_charts(results, kinds[0].ordered)
        ),
        "memberships": [*learned.membership_charts(chosen.rules)] if chosen else [],
    }
    replay = reasons.attempt(
        "replay", lambda: drives.drives_of(of_best, seed, config, chosen, own=own)
    )
    listed = [chart for kind in kinds for chart in kind.charts]
    listed += [chart for of_part in charts.values() for chart in of_part or []]
    script = "\n".join(
        [
            _part("robot.js", "fnnq_torchrl.studies"),
            *map(_part, ("shapes.js", "replay.js", "report.js")),
        ]
    )
    return _template().render(
        title=directory.absolute().name,
        runs=count_words([sum(each.evaluations.runs for each in results.configurations)]),
        jobs=_count(sum(len(each.parts) for each in results.configurations), "job"),
        again=shlex.join(["python", "-m", "fnnq_torchrl.report", f"run={directory}"]),
        results=results,
        kinds=kinds,
        best=best,
        label=results.label(best),
        job=of_best.name,
        seed=seed,
        grids=[*learned.grids(chosen)] if chosen else [],
        controller=words,
        charts=charts,
        number={id(chart): place for place, chart in enumerate(listed)},
        replay=replay,
        reasons=reasons.of,
        making=reasons.attempt("making", lambda: making.making_of(results, best)),
        style=Markup(_part("report.css")),
        data=_json({"charts": [chart.spec for chart in listed], "replay": replay}),
        library=Markup(library),
        script=Markup(script),
        allowed=f"{_digest(library)} {_digest(script)}",
    )


def _best_run(configuration: Configuration) -> tuple[Path, int]:
    """Return the job's directory and the seed of a configuration's run with the best score."""
    evaluations = configuration.evaluations
    seed = int(evaluations.seed[best_run(evaluations)])
    part = next(part for part in configuration.parts if seed in part.seeds)
    return part.job.directory, seed


def _count(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'s' * (number != 1)}"


def _template() -> Any:
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["id"] = id
    environment.globals["count"] = _count
    return environment.from_string(_part("report.html"))


def _part(name: str, package: str = __package__) -> str:
    return files(package).joinpath(name).read_text(encoding="utf-8")


def _json(data: Any) -> Markup:
    """Return data as JSON in which nothing ends the script element around it."""
    return Markup(json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"))


def _digest(script: str) -> str:
    """Return the source expression by which the page's policy allows a script."""
    digest = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"
