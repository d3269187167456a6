"""What the ``.wandb`` file of an offline run holds."""

import json
from pathlib import Path
from typing import Any, NamedTuple

from wandb.proto.wandb_internal_pb2 import Record

from fnnq_torchrl.training.loggers.wandb_file import records


class WandbRun(NamedTuple):
    """One run, with the values of JSON."""

    group: str
    job_type: str
    name: str
    tags: list[str]
    config: dict[str, Any]
    history: list[dict[str, Any]]
    summary: dict[str, Any]
    files: set[str]
    exit_code: int | None


def read_wandb_runs(directory: Path) -> list[WandbRun]:
    """All runs below ``directory/wandb``."""
    return [read_wandb_run(path) for path in sorted(directory.glob("wandb/*run-*/*.wandb"))]


def read_wandb_run(path: Path) -> WandbRun:
    run, history, summary, files, exit_code = None, [], {}, set(), None
    for record in map(Record.FromString, records(path)):
        kind = record.WhichOneof("record_type")
        if kind == "run":
            run = record.run
        elif kind == "history":
            history.append(_values(record.history.item))
        elif kind == "summary":
            summary |= _values(record.summary.update)
        elif kind == "files":
            files |= {file.path for file in record.files.files}
        elif kind == "exit":
            exit_code = record.exit.exit_code
    config = _values(run.config.update)
    config.pop("_wandb", None)
    names = run.run_group, run.job_type, run.display_name, list(run.tags)
    return WandbRun(*names, config, history, summary, files, exit_code)


def _values(items: Any) -> dict[str, Any]:
    return {item.key or ".".join(item.nested_key): json.loads(item.value_json) for item in items}
