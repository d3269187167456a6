"""Reading the ``.wandb`` files that wandb writes for offline runs."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from wandb.proto.wandb_internal_pb2 import Record

_HEADER, _BLOCK, _OF_RECORD = 7, 32768, 7
_FULL, _LAST = 1, 4


class WandbRun(NamedTuple):
    """One run in wandb, with its values decoded from JSON."""

    id: str
    sweep_id: str
    project: str
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
    """Return all runs below ``directory/wandb``."""
    return [read_wandb_run(path) for path in sorted(directory.glob("wandb/*run-*/*.wandb"))]


def read_wandb_run(path: Path) -> WandbRun:
    run, history, summary, files, exit_code = None, [], {}, set(), None
    for record in _records(path):
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
    about = run.run_id, run.sweep_id, run.project, run.run_group, run.job_type, run.display_name
    return WandbRun(*about, list(run.tags), config, history, summary, files, exit_code)


def _values(items: Any) -> dict[str, Any]:
    return {item.key or ".".join(item.nested_key): json.loads(item.value_json) for item in items}


def _records(path: Path) -> Iterator[Record]:
    """Yield the records of a LevelDB log whose file begins with a header of 7 bytes.

    https://github.com/google/leveldb/blob/main/doc/log_format.md
    """
    content = path.read_bytes()
    place, parts = _HEADER, b""
    while place + _OF_RECORD <= len(content):
        if _BLOCK - place % _BLOCK < _OF_RECORD:  # too little room in the block for a record
            place += _BLOCK - place % _BLOCK
            continue
        size = int.from_bytes(content[place + 4 : place + 6], "little")
        kind = content[place + 6]
        place += _OF_RECORD
        parts += content[place : place + size]
        place += size
        if kind in (_FULL, _LAST):
            yield Record.FromString(parts)
            parts = b""
