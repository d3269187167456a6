"""The choices of each configuration group, which are the YAML files in ``conf/``."""

from functools import cache
from pathlib import Path
from typing import Any

import yaml


def config_directory() -> Path:
    """Return the installed package's ``conf`` if it exists, else ``conf`` in the checkout."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "conf"
    return installed if installed.is_dir() else package.parent / "conf"


def choices_of(group: str) -> list[str]:
    """Return the sorted names of a group's YAML files; an unknown group has none.

    Files whose names begin with an underscore are parts of others and are left out.
    """
    return sorted(path.stem for path in (config_directory() / group).glob("[!_]*.yaml"))


@cache
def shipped_labels() -> list[dict[str, Any]]:
    """Return the contents of the files in ``conf/value/labels``, one for each task."""
    folder = config_directory() / "value" / "labels"
    return [yaml.safe_load(path.read_text(encoding="utf-8")) for path in folder.glob("*.yaml")]
