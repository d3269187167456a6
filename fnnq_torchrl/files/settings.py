"""YAML files of settings, read as plain data. This module needs no torch."""

from typing import Any

import yaml

_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # libyaml is seven times as fast
_DEEPEST = 20


def parse_settings(text: bytes) -> dict[str, Any] | None:
    """Return the mapping in a YAML file as plain data.

    None if the file is damaged, isn't a mapping, nests deeper than any settings do, or has aliases,
    by which a few lines can stand for gigabytes.
    """
    depth = 0
    try:
        for event in yaml.parse(text, _Loader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > _DEEPEST or isinstance(event, yaml.AliasEvent):
                return None
        plain = yaml.load(text, _Loader)  # noqa: S506  # a SafeLoader
    except Exception:  # the parser fails in many ways
        return None
    return plain if isinstance(plain, dict) else None
