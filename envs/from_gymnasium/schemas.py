"""The parameters of a world made from a Gymnasium environment, and that environment's spaces."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from envs.core.parameters import ConfigError, check, matching, or_null, whole
from envs.core.world import Range
from envs.singles.schemas import WARM_UP, SinglesConfig, Spaces, is_finite, range_of, usual_ranges

if TYPE_CHECKING:
    import gymnasium


_LONG = 1_000
"""The time limit, in steps, of an environment for which the registry has none."""


@dataclass
class GymnasiumConfig(SinglesConfig):
    """The parameters of ``gymnasium``, any environment of Gymnasium's registry.

    Observations are called ``x0``, ``x1`` and so on. A ``time_limit_steps`` of None becomes the
    registry's limit.
    """

    id: str = matching(r"[\w.:/-]{1,200}", "the name of an environment, such as CartPole-v1")
    time_limit_steps: Any = or_null(whole(1))

    def __post_init__(self) -> None:
        if self.time_limit_steps is None:
            check(self, "env.")
            self.time_limit_steps = _limit_of(self.id)

    @property
    def spaces(self) -> Spaces:
        check(self, "env.")
        return spaces_of(self.id)


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
def _limit_of(name: str) -> int:
    """Return the largest number of steps that the registry allows an episode, or 1,000.

    Raises:
        ConfigError: if there is no such environment.
    """
    spec = make(name).spec
    limit = None if spec is None else spec.max_episode_steps
    return _LONG if limit is None else limit


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
        spans = [range_of(low, high) for low, high in ends]
    else:
        raise ConfigError(f"env.id={name}: its observations must be a row of numbers, not {seen}")
    actions: Range | int | None = None
    if isinstance(acts, Discrete):
        actions = int(acts.n)
    elif isinstance(acts, Box) and acts.shape == (1,):
        span = range_of(acts.low.item(), acts.high.item())
        actions = span if is_finite(span) else None
    if actions is None:
        raise ConfigError(
            f"env.id={name}: its action must be Discrete or one bounded number, not {acts}"
        )
    named = {f"x{i}": span for i, span in enumerate(spans)}
    return Spaces(named, usual_ranges(named, _random_play(env)), actions)


def _random_play(env: "gymnasium.Env[Any, Any]") -> Iterator[Sequence[float]]:
    env.action_space.seed(0)
    yield np.ravel(env.reset(seed=0)[0]).tolist()
    for _ in range(WARM_UP):
        row, _, terminated, truncated, _ = env.step(env.action_space.sample())
        yield np.ravel(row).tolist()
        if terminated or truncated:
            yield np.ravel(env.reset()[0]).tolist()
