"""The page of the configuration: every file of conf/, with the ranges of its keys.

The files' comments explain the keys; the schemas (:mod:`fnnq_torchrl.config`) give the ranges.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import yaml
from sphinx.application import Sphinx

from envs.core.parameters import allowed
from envs.schemas import SCHEMAS as WORLDS
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.config.values import SCHEMAS as VALUES

ROOT = Path(__file__).parents[2]
ROWS = 10  # the lines of a table that are shown


def anchor(path: str) -> str:
    """Return the anchor of the heading that names a file or directory, as in ``conf/env``."""
    return re.sub(r"[^\w-]", "", path.lower())


def sections() -> Iterator[str]:
    """Yield the page's sections in Markdown, one for each file of ``conf/`` that holds values."""
    conf = ROOT / "conf"
    ranges = allowed(Config)
    del ranges["env"], ranges["value"]
    yield f"## conf/config.yaml\n\n{_shown(conf / 'config.yaml')}\n\n{_table(ranges)}\n"
    for folder in sorted(path for path in conf.rglob("*") if path.is_dir()):
        files = sorted(path for path in folder.iterdir() if path.is_file())
        name = folder.relative_to(ROOT)
        if files:
            yield f"## {name}\n"
        for file in files:
            yield f"### {file.relative_to(ROOT)}\n\n{_shown(file)}\n\n{_table(_ranges(file))}\n"


def _shown(file: Path) -> str:
    options = {".yaml": ":language: yaml", ".csv": f":lines: 1-{ROWS}"}.get(file.suffix, "")
    return f"```{{literalinclude}} ../{file.relative_to(ROOT)}\n{options}\n```"


def _ranges(file: Path) -> dict[str, str]:
    """Return the ranges of the keys of a world or of a value function, by the file's kind."""
    if file.suffix != ".yaml":
        return {}
    values = yaml.safe_load(file.read_text(encoding="utf-8")) or {}
    values = values.get("value", values) if file.parent.name == "value" else values
    kind = values.get("kind")
    if file.parent.name == "env" and kind in WORLDS:
        return allowed(WORLDS[kind], "env.")
    if file.parent.name == "value" and kind in VALUES:
        return allowed(VALUES[kind], "value.")
    return {}


def _table(ranges: Mapping[str, str]) -> str:
    if not ranges:
        return ""
    rows = (f"| `{key}` | {words.replace('|', '&#124;')} |" for key, words in ranges.items())
    return "\n".join(["| key | allowed |", "| --- | --- |", *rows])


def _append(app: Sphinx, page: str, source: list[str]) -> None:
    if page == "configuration":
        source[0] += "\n" + "\n".join(sections())


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the generated page."""
    app.connect("source-read", _append)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
