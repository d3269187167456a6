"""The parameters of a world made from a TorchRL environment, without torch."""

from dataclasses import dataclass
from typing import Any

from envs.core.parameters import check, plain
from envs.singles.schemas import SinglesConfig, Spaces


@dataclass
class TorchRLConfig(SinglesConfig):
    """The parameters of ``torchrl:module:Class``, any environment of TorchRL's kind.

    Observations are called as in the environment. Those of several numbers are numbered, as in
    ``observation_0``.
    """

    arguments: dict[str, Any] = plain(default_factory=dict)

    @property
    def spaces(self) -> Spaces:
        check(self, "env.")
        from envs.from_torchrl.single import spaces_of  # loads torch

        return spaces_of(self.kind, tuple(sorted(self.arguments.items())))
