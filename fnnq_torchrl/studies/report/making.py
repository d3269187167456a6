"""The part of the report on its making: commands, configuration, times, versions, machine."""

import os
import platform
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeGuard

from fnnq_torchrl.config.checking import flat
from fnnq_torchrl.files.settings import parse_settings
from fnnq_torchrl.studies.results.collect import Configuration, Results
from fnnq_torchrl.training.results import read_summary

_COMMANDS = 12
_LIBRARIES = "fnnq_torchrl", "torch", "torchrl", "tensordict", "hydra-core", "numpy"


@dataclass(frozen=True)
class Making:
    """The making of the results and of the page.

    Attributes:
        commands: the commands that train the jobs again.
        settings: the keys and values of the best configuration.
        times: what took how long, for each batch.
        versions: the versions of the libraries with which the page was made.
        machine: the machine on which the page was made.
    """

    commands: list[str]
    settings: list[tuple[str, str]]
    times: list[tuple[str, str]]
    versions: list[tuple[str, str]]
    machine: str


def making_of(results: Results, best: Configuration) -> Making:
    """Return the making of some results."""
    commands = [*dict.fromkeys(_commands(results))]
    more = [f"# … and {len(commands) - _COMMANDS:,} more"] if len(commands) > _COMMANDS else []
    settings = [(key, str(value)) for key, value in best.job.settings.items()]
    system = f"{platform.system()} {platform.machine()}, {os.cpu_count()} processors"
    return Making(
        commands[:_COMMANDS] + more,
        settings,
        _times(best),
        [("Python", platform.python_version()), *((name, version(name)) for name in _LIBRARIES)],
        system,
    )


def _commands(results: Results) -> Iterator[str]:
    """Yield for each job the command that trains it, or the sweep that it belongs to, again."""
    for configuration in results.configurations:
        for part in configuration.parts:
            yield command_of(part.job.directory)


def command_of(job: Path) -> str:
    """Return the command that trains a job, or the sweep that it belongs to, again."""
    train = "python -m fnnq_torchrl.train"
    again = f"{train} {shlex.quote(f'from={job}')}"
    settings = _read(job.parent / "multirun.yaml")
    sweep = settings is not None
    if settings is None:
        settings = _read(job / ".hydra" / "hydra.yaml")
    keys = flat(settings or {})
    words = keys.get("hydra.overrides.task")
    if not _are_words(words) or keys.get("hydra.job.config_name") not in (None, "config"):
        return again  # the job began from another one, or a file is missing
    return shlex.join([*train.split(), *words, *["-m"] * sweep])


def _read(path: Path) -> dict[str, Any] | None:
    try:
        return parse_settings(path.read_bytes())
    except OSError:
        return None


def _are_words(words: Any) -> TypeGuard[list[str]]:
    return isinstance(words, list) and all(isinstance(word, str) for word in words)


def _times(best: Configuration) -> list[tuple[str, str]]:
    summary = read_summary(best.job.directory / "summary.json")
    rate = summary["learning_steps_per_second"]
    rows: Sequence[tuple[str, str]] = [
        ("runs trained side by side", f"{summary['batch_runs']:,}"),
        ("learning", f"{summary['train_seconds']:.2f} s"),
        ("compiling", f"{summary['compile_seconds']:.2f} s"),
        ("testing", f"{summary['evaluate_seconds']:.2f} s"),
        ("learning steps a second", "unknown" if rate is None else f"{rate:,.0f}"),
    ]
    return [*rows]
