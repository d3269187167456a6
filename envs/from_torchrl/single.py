"""A single TorchRL environment: its spaces, and its steps."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, Categorical, OneHot, TensorSpec
from torchrl.envs import EnvBase
from torchrl.envs.utils import step_mdp

from envs.core.parameters import ConfigError
from envs.core.registry import imported_class
from envs.core.world import Range
from envs.singles.schemas import WARM_UP, Spaces, is_finite, range_of, usual_ranges
from envs.singles.world import Moment, Single

_MOST = 1_000
"""The most numbers of an observation; pictures have more."""


def make(kind: str, arguments: Mapping[str, Any]) -> EnvBase:
    """Make the environment that a kind names.

    Args:
        kind: ``torchrl:module:Class``; a function that makes an environment will do, too.
        arguments: the arguments of the class.

    Raises:
        ConfigError: if there is no such class, or it can't be made with these arguments. The
            message is one line.
    """
    made = imported_class("env.kind", kind)
    try:
        env = made(**arguments)
    except Exception as error:  # the class may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ConfigError(f"env.kind={kind}: {reason}; env.arguments has its arguments") from error
    if not isinstance(env, EnvBase):
        raise ConfigError(f"env.kind={kind}: must make an environment of TorchRL's EnvBase")
    if env.batch_size:
        wanted = f"must have no batch size, not {[*env.batch_size]}"
        raise ConfigError(f"env.kind={kind}: {wanted}, since each run has an environment")
    return env


@cache
def spaces_of(kind: str, arguments: tuple[tuple[str, Any], ...]) -> Spaces:
    """Return the observations and actions that an environment's specs define.

    Args:
        kind: ``torchrl:module:Class``.
        arguments: the arguments of the class and their names.

    Raises:
        ConfigError: as :func:`make`; or if its observations or its action aren't supported.
    """
    env = make(kind, dict(arguments))
    spans: dict[str, Range] = {}
    for key in _seen(env):
        lows, highs = _ends(env.observation_spec[key])
        for name, low, high in zip(_names(key, len(lows)), lows, highs, strict=True):
            spans[name] = range_of(low, high)
    if not spans:
        raise ConfigError(f"env.kind={kind}: has no observation of at most {_MOST:,} numbers")
    spec = env.full_action_spec.get("action", None)
    actions = None if len([*env.full_action_spec.keys(True, True)]) > 1 else _actions(spec)
    if actions is None:
        line = "its only action must be Categorical, OneHot or one bounded number, not"
        raise ConfigError(f"env.kind={kind}: {line} {' '.join(str(spec).split())}")
    if env.reward_spec.shape.numel() != 1:
        raise ConfigError(f"env.kind={kind}: its reward must be one number")
    single = TorchRLSingle(env)
    return Spaces(spans, usual_ranges(spans, single.random_play()), actions)


class TorchRLSingle(Single):
    """A TorchRL environment. It has torch's global random numbers to itself."""

    def __init__(self, env: EnvBase) -> None:
        self._env = env
        self._keys = _seen(env)
        self._state: TensorDictBase = TensorDict()
        self._generator = torch.get_rng_state()

    def reset(self, seed: int) -> Sequence[float]:
        with self._own_random_numbers():
            torch.manual_seed(seed)
            self._env.set_seed(seed % 2**31)  # some environments take no larger seeds
            self._state = self._env.reset()
        return self._row(self._state)

    def step(self, action: float) -> Moment:
        with self._own_random_numbers():
            return self._taken(self._given(action))

    def random_play(self) -> Iterator[Sequence[float]]:
        """Yield the observations of random play."""
        yield self.reset(0)
        for _ in range(WARM_UP):
            with self._own_random_numbers():
                moment = self._taken(self._env.action_spec.rand())
                yield moment.seen
                if moment.terminated or moment.truncated:
                    self._state = self._env.reset()
                    yield self._row(self._state)

    def _taken(self, action: Tensor) -> Moment:
        stepped = self._env.step(self._state.set("action", action))
        after = stepped["next"]
        self._state = step_mdp(stepped)
        truncated = after.get("truncated", None)
        cut = truncated is not None and bool(truncated.any())
        ended = bool(after.get("terminated", after["done"]).any())
        return Moment(self._row(after), float(after["reward"]), ended, cut)

    def _given(self, action: float) -> Tensor:
        spec = self._env.action_spec
        if isinstance(spec, OneHot):
            chosen = torch.arange(spec.shape[-1]) == int(action)
            return chosen.view(spec.shape).to(spec.dtype)
        return torch.full(spec.shape, action, dtype=spec.dtype, device=spec.device)

    def _row(self, state: TensorDictBase) -> Sequence[float]:
        numbers: list[float] = []
        for key in self._keys:
            numbers += state[key].flatten().tolist()
        return numbers

    @contextmanager
    def _own_random_numbers(self) -> Iterator[None]:
        """Keep this environment's draws from torch's global generator apart from all others."""
        others = torch.get_rng_state()
        torch.set_rng_state(self._generator)
        try:
            yield
        finally:
            self._generator = torch.get_rng_state()
            torch.set_rng_state(others)


def _seen(env: EnvBase) -> list[str]:
    """Return the keys of the observations: those at the top level, but for pictures."""
    specs = env.observation_spec
    return [
        key
        for key in specs
        if isinstance(specs[key], TensorSpec)
        and not hasattr(specs[key], "keys")
        and specs[key].dtype.is_floating_point | (specs[key].dtype in (torch.int64, torch.int32))
        and 1 <= specs[key].shape.numel() <= _MOST
    ]


def _names(key: str, count: int) -> list[str]:
    return [key] if count == 1 else [f"{key}_{i}" for i in range(count)]


def _ends(spec: TensorSpec) -> tuple[list[float], list[float]]:
    """Return the lowest and the highest value of each number of an observation."""
    numbers = spec.shape.numel()
    if isinstance(spec, OneHot):
        return [0.0] * numbers, [1.0] * numbers
    if isinstance(spec, Categorical):
        return [0.0] * numbers, [float(spec.space.n - 1)] * numbers
    if isinstance(spec, Bounded):
        low, high = (end.expand(spec.shape).flatten().tolist() for end in spec.space)
        return low, high
    return [-float("inf")] * numbers, [float("inf")] * numbers


def _actions(spec: TensorSpec | None) -> Range | int | None:
    """Return the range of the action or the number of actions, None if it isn't supported."""
    if isinstance(spec, OneHot) or (isinstance(spec, Categorical) and spec.shape.numel() == 1):
        return int(spec.space.n)
    if isinstance(spec, Bounded) and spec.shape.numel() == 1:
        low, high = _ends(spec)
        span = range_of(low[0], high[0])
        return span if is_finite(span) else None
    return None
