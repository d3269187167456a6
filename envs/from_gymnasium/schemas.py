"""The parameters of a world made from a Gymnasium environment, and that environment's spaces."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from envs.core.parameters import ConfigError, check, matching
from envs.core.world import Range, WorldConfig

if TYPE_CHECKING:
    import gymnasium

_WARM_UP = 2_000
"""The number of random steps by which the range of an observation without limits is measured."""

_ENDLESS = 1e30
"""Limits of at least this size count as infinite; some spaces have float32's largest number."""


class Spaces(NamedTuple):
    """The observations and actions that an environment's spaces define.

    Attributes:
        observations: the range of each number of an observation.
        usual: ``observations``, with ranges measured in random play in place of infinite ranges.
        actions: the range of the action, or the number of actions.
        first_action: the number of the first action of a fixed set.
    """

    observations: list[Range]
    usual: list[Range]
    actions: Range | int
    first_action: int


@dataclass
class GymnasiumConfig(WorldConfig):
    """The parameters of ``gymnasium``, any environment of Gymnasium's registry.

    Observations are called ``x0``, ``x1`` and so on.
    """

    id: str = matching(r"[\w.:/-]{1,200}", "the name of an environment, such as CartPole-v1")

    measure: ClassVar = "return"
    compiles: ClassVar = False

    @property
    def spaces(self) -> Spaces:
        """The observations and actions that the environment's spaces define.

        Raises:
            ConfigError: if there is no such environment, or its spaces aren't supported.
        """
        check(self, "env.")
        return spaces_of(self.id)

    @property
    def observations(self) -> Mapping[str, Range]:
        """The range of each number of an observation."""
        return {f"x{i}": span for i, span in enumerate(self.spaces.observations)}

    @property
    def usual(self) -> Mapping[str, Range]:
        """The range of each number of an observation, measured in 2,000 steps if infinite."""
        return {f"x{i}": span for i, span in enumerate(self.spaces.usual)}

    @property
    def actions(self) -> Range | int:
        """The range of the action, or the number of actions."""
        return self.spaces.actions


def make(name: str, **settings: Any) -> "gymnasium.Env[Any, Any]":
    """Make an environment of Gymnasium's registry.

    Raises:
        ConfigError: if the environment can't be made. The message is one line.
    """
    try:
        import gymnasium
    except ImportError as error:
        line = "needs Gymnasium: pip install gymnasium"
        raise ConfigError(f"env.id={name}: {line}") from error
    try:
        return gymnasium.make(name, **settings)
    except Exception as error:  # a missing library, an unknown name, or an error of the environment
        reason = " ".join(str(error).split())
        raise ConfigError(f"env.id={name}: {reason}") from error


@cache
def spaces_of(name: str) -> Spaces:
    """Return the observations and actions that an environment's spaces define.

    Raises:
        ConfigError: if there is no such environment, or its spaces aren't supported.
    """
    from gymnasium.spaces import Box, Discrete

    env = make(name)
    seen, acts = env.observation_space, env.action_space
    if isinstance(seen, Discrete):
        spans = [(float(seen.start), float(seen.start + seen.n - 1))]
    elif isinstance(seen, Box) and len(seen.shape) == 1:
        ends = zip(seen.low.tolist(), seen.high.tolist(), strict=True)
        spans = [(_end(low), _end(high)) for low, high in ends]
    else:
        raise ConfigError(f"env.id={name}: its observations must be a row of numbers, not {seen}")
    first = 0
    actions: Range | int | None = None
    if isinstance(acts, Discrete):
        first, actions = int(acts.start), int(acts.n)
    elif isinstance(acts, Box) and acts.shape == (1,):
        low, high = _end(acts.low.item()), _end(acts.high.item())
        actions = (low, high) if low > -inf and high < inf else None
    if actions is None:
        raise ConfigError(
            f"env.id={name}: its action must be Discrete or one bounded number, not {acts}"
        )
    usual = spans if all(-inf < low and high < inf for low, high in spans) else _usual(env, spans)
    return Spaces(spans, usual, actions, first)


def _usual(env: "gymnasium.Env[Any, Any]", spans: list[Range]) -> list[Range]:
    """Return the ranges, with ranges measured in random play in place of infinite ranges."""
    env.action_space.seed(0)
    rows = [env.reset(seed=0)[0]]
    for _ in range(_WARM_UP):
        row, _, terminated, truncated, _ = env.step(env.action_space.sample())
        rows.append(row)
        if terminated or truncated:
            rows.append(env.reset()[0])
    lows, highs = np.min(rows, axis=0).tolist(), np.max(rows, axis=0).tolist()
    return [
        span if -inf < span[0] and span[1] < inf else (low, high if high > low else low + 1.0)
        for span, low, high in zip(spans, lows, highs, strict=True)
    ]


def _end(limit: float) -> float:
    return float(limit) if abs(limit) < _ENDLESS else inf * (1 if limit > 0 else -1)
