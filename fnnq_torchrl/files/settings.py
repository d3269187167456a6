"""YAML files of settings, read as plain data. This module needs no torch."""

from typing import Any

import yaml


class _Loader(yaml.SafeLoader):
    """A loader that refuses aliases, by which a few lines can stand for gigabytes."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("an alias")
        return super().compose_node(parent, index)


def parse_settings(text: bytes) -> dict[str, Any] | None:
    """Return the mapping in a YAML file as plain data; None if it is damaged or not a mapping."""
    try:
        plain = yaml.load(text, _Loader)  # noqa: S506  # a SafeLoader
    except Exception:  # the parser fails in many ways
        return None
    return plain if isinstance(plain, dict) else None
