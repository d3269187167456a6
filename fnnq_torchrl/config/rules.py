"""The schema of ``conf/rules/``, the knowledge before learning. This module needs no torch."""

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from envs.core.parameters import (
    ConfigError,
    OutOfRange,
    Parameters,
    flag,
    matching,
    number,
    or_null,
    texts,
)
from fnnq_torchrl.config.choices import config_directory

ANY = "*"
"""The text that stands for every label in the name of a rule."""

_PATH = r".{0,4000}\S"


@dataclass
class RulesConfig(Parameters):
    """The rules that learning starts from. conf/rules/none.yaml explains the keys."""

    prior: Any = or_null(matching(_PATH, "the path of a file of rules, or of a job's directory"))
    frozen: list[str] = texts(most=1_000)
    demonstrations: Any = or_null(matching(_PATH, "the path of a CSV file"))
    margin: float = number(above=0)
    count_firing: bool = flag()

    @property
    def used(self) -> bool:
        """True if a setting needs a value function with rules."""
        return bool(
            self.prior is not None
            or self.demonstrations is not None
            or self.frozen
            or self.count_firing
        )

    def files(self) -> dict[str, Path]:
        """Return the existing paths that ``prior`` and ``demonstrations`` name, by key.

        A bare file name is first looked up among the shipped files in ``conf/rules/``.

        Raises:
            ConfigError: if there is no such file.
        """
        named = {"prior": self.prior, "demonstrations": self.demonstrations}
        return {key: _find(f"rules.{key}", name) for key, name in named.items() if name is not None}

    def frozen_rules(self, labels: Sequence[Sequence[str]]) -> list[tuple[int | None, ...]]:
        """Return the rules that don't learn, by the indices of their labels.

        Args:
            labels: the names of the labels of each input and, last, of the action.

        Returns:
            For each entry of ``frozen``, a tuple with a label index for each variable. None stands
            for every label of the variable.

        Raises:
            OutOfRange: if an entry has an unknown label, or more labels than there are variables.
        """
        found: list[tuple[int | None, ...]] = []
        for entry in self.frozen:
            words = entry.split("/")
            if len(words) > len(labels):
                allowed = f"at most {len(labels)} labels joined by /, such as {_example(labels)}"
                raise OutOfRange("rules.frozen", entry, allowed)
            places: list[int | None] = [None] * len(labels)
            for i, (word, names) in enumerate(zip(words, labels, strict=False)):
                if word == ANY:
                    continue
                if word not in names:
                    near = difflib.get_close_matches(word, names, n=1)
                    meant = f"; did you mean {near[0]}?" if near else ""
                    words_for_all = ", ".join((*names, ANY))
                    allowed = (
                        f"a rule such as {_example(labels)}, with one of {words_for_all} "
                        f"instead of {word}{meant}"
                    )
                    raise OutOfRange("rules.frozen", entry, allowed)
                places[i] = [*names].index(word)
            found.append(tuple(places))
        return found


def _example(labels: Sequence[Sequence[str]]) -> str:
    return "/".join(names[0] for names in labels)


def _find(key: str, name: str) -> Path:
    shipped, path = config_directory() / "rules", Path(name)
    if path.name == name and (shipped / name).is_file():
        return shipped / name
    if not path.exists():
        known = sorted(each.name for each in shipped.iterdir() if each.suffix != ".yaml")
        raise ConfigError(f"{key}={name}: there is no such file; shipped files: {', '.join(known)}")
    return path
