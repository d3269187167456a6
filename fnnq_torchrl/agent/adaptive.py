"""Adaptive learning parameters of a batch of runs. Runs come first."""

from collections.abc import Mapping
from typing import Self

import torch
from torch import Tensor

from envs.core import streams
from envs.core.streams import Stream
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.meta_learning import Levels, MetaLearning, Rates
from fnnq_torchrl.equations.reward_means import Means


class Adaptive:
    """The learning parameters that a scheme changes while a batch of runs learns.

    The state has the entries of :class:`.Levels`, and the current ``temperature`` and ``gamma``,
    each ``[runs, 1]``, if the scheme changes them. The learner keeps the current ``alpha``.

    Args:
        scheme: the scheme.
    """

    def __init__(self, scheme: MetaLearning) -> None:
        self._scheme = scheme

    @classmethod
    def of(cls, config: Config) -> Self | None:
        """Make what a configuration names; None for ``adaptive=none``."""
        if config.adaptive == "none":
            return None
        beta, clock = config.adaptive_beta, config.adaptive_clock
        return cls(MetaLearning(config.adaptive_parameters, beta, clock))

    def told(self, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Return the entries of the state that an evaluation tells, each ``[runs, 1]``."""
        return {key: state[key] for key in ("temperature", "gamma", "bounded") if key in state}

    def start(self, run: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Return the state before the first step, from the runs' values in the configuration."""
        first = {name: run[name] for name in self._scheme.parameters}
        levels = self._scheme.start([per_run(value) for value in first.values()])
        return self._state(levels, {name: value.clone() for name, value in first.items()})

    def update(
        self,
        run: Mapping[str, Tensor],
        state: Mapping[str, Tensor],
        alpha: Tensor,
        reward: Tensor,
        ended: Tensor,
        steps: Tensor,
    ) -> tuple[dict[str, Tensor], Tensor]:
        """Return the state and α after a step's reward.

        Args:
            run: the values of the runs; those of the scheme are ``adaptive_rate``,
                ``adaptive_period``, ``adaptive_short`` and ``adaptive_long``.
            state: the state before the step.
            alpha: α before the step, ``[runs, 1]``.
            reward: the step's reward, ``[runs, 1]``.
            ended: whether a situation has ended with the step, bool ``[runs, 1]``.
            steps: the number of steps learned from before this one, int64 ``[runs, 1]``.
        """
        before = {"alpha": alpha, **state}
        levels = Levels(
            Means(per_run(state["short_mean"]), per_run(state["long_mean"])),
            runs_last(state["level"]),
            runs_last(state["perturbation"]),
            *(per_run(state[key]) for key in ("age", "earned", "bounded")),
        )
        keys = ("adaptive_rate", "adaptive_period", "adaptive_short", "adaptive_long")
        names, noise = self._scheme.parameters, _noise(run["seed"], steps, alpha.dtype)
        after, values = self._scheme.update(
            levels,
            [per_run(before[name]) for name in names],
            per_run(reward),
            per_run(ended),
            torch.stack([noise[name] for name in names]),
            Rates(*(per_run(run[key]) for key in keys)),
        )
        found = {name: value.unsqueeze(-1) for name, value in zip(names, values, strict=True)}
        return self._state(after, found), found.get("alpha", alpha)

    def _state(self, levels: Levels, values: Mapping[str, Tensor]) -> dict[str, Tensor]:
        one = {
            "short_mean": levels.means.short,
            "long_mean": levels.means.long,
            "age": levels.age,
            "earned": levels.earned,
            "bounded": levels.bounded,
        }
        return {
            **{key: value.unsqueeze(-1) for key, value in one.items()},
            "level": runs_first(levels.level),
            "perturbation": runs_first(levels.perturbation),
            **{name: value for name, value in values.items() if name != "alpha"},
        }


def _noise(seed: Tensor, steps: Tensor, dtype: torch.dtype) -> dict[str, Tensor]:
    """Return N(0, 1) for each parameter at a step, ``[runs]``."""
    episode = torch.full_like(seed, streams.LAST_EPISODE)
    words = streams.draw(seed, episode, steps, Stream.LEARNER)
    u, v, other_u, other_v = streams.uniform(per_run(words), dtype)
    return {
        "alpha": streams.box_muller(u, v),
        "temperature": streams.box_muller(u, v - 0.25),  # the pair's other number: the sine of v
        "gamma": streams.box_muller(other_u, other_v),
    }
