"""The configuration of a job: a typed and range-checked schema without values.

``conf/`` holds every value with its unit and source. This module imports neither torch nor Hydra,
so that errors are reported before those libraries are loaded.
"""

import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any

from envs.core.parameters import (
    ConfigError,
    OutOfRange,
    Parameters,
    check,
    flag,
    matching,
    number,
    one_of,
    or_null,
    parameters,
    rounded_misfits,
    some_of,
    whole,
    whole_or_rows,
)
from envs.core.registry import is_own, kinds_in_words
from envs.core.world import WorldConfig
from envs.schemas import SCHEMAS as WORLDS
from fnnq_torchrl.config.loggers import LoggerConfig
from fnnq_torchrl.config.rules import RulesConfig
from fnnq_torchrl.config.values import SCHEMAS as VALUES
from fnnq_torchrl.config.values import FuzzyConfig, LabelsConfig, ValueConfig
from fnnq_torchrl.equations.names import (
    ADAPTIVE,
    ADAPTIVE_PARAMETERS,
    BETAS,
    CLOCKS,
    EXPLORATIONS,
    PER_WEIGHT,
    STEP_SIZES,
    TRACES,
    VARIANTS,
)

__all__ = [
    "PER_RUN",
    "ActionConfig",
    "CheckpointConfig",
    "Config",
    "ConfigError",
    "EvaluationConfig",
    "MachineConfig",
    "OutOfRange",
]

PER_RUN = (
    "seed",
    "lam",
    "alpha",
    "alpha_decay",
    "kappa",
    "meta_step_size",
    "tau",
    "eta",
    "eta_min",
    "eta_decay",
    "gamma",
    "epsilon",
    "epsilon_final",
    "epsilon_over",
    "temperature",
    "noise_std",
    "adaptive_rate",
    "adaptive_period",
    "adaptive_short",
    "adaptive_long",
)
"""The keys whose values may differ from run to run within one batch; all others are shared."""


LARGEST = {"float32": (2 - 2**-23) * 2.0**127, "float64": sys.float_info.max}
"""The largest number of each ``machine.dtype``."""


def _one_of_or_own(*choices: str) -> Any:
    """Declare a field for one of the given words, or for a class of the user's."""
    return matching("|".join((*choices, r"[\w.]+:\w+")), kinds_in_words(choices))


def _to_float32(number: float) -> float:
    try:
        return float(struct.unpack("f", struct.pack("f", number))[0])
    except OverflowError:
        return inf


@dataclass
class ActionConfig(Parameters):
    """The number of candidate actions in a range; None for all actions of a fixed set."""

    candidates: Any = or_null(whole(2))


@dataclass
class MachineConfig(Parameters):
    """The device and the precision of the computation."""

    device: str = matching(r"cpu|cuda(:[0-9]+)?", "cpu, cuda or cuda:N")
    dtype: str = one_of("float32", "float64")


@dataclass
class EvaluationConfig(Parameters):
    """The interval between tests, and their fixed starts or number of random starts.

    Without tests (``situations`` is 0), the scores are those of the situations learned from.
    """

    every: Any = or_null(whole(1))
    situations: Any = whole_or_rows(0, "start")

    @property
    def fixed(self) -> list[list[float]] | None:
        """The fixed starts, or None if all starts are random."""
        return self.situations if isinstance(self.situations, list) else None

    @property
    def tests(self) -> int:
        """The number of situations in a test."""
        fixed = self.fixed
        return int(self.situations) if fixed is None else len(fixed)


@dataclass
class CheckpointConfig(Parameters):
    """The interval between checkpoints, and whether to save the weights of all evaluations."""

    every_s: float = number(above=0)
    snapshots: bool = flag()


@dataclass(kw_only=True)
class Config(Parameters):
    """The configuration of one job: a batch of runs. The constructor checks all values."""

    lam: float = number(0, 1)
    seed: int = whole(0)
    num_seeds: int = whole(1)
    step_size: str = _one_of_or_own(*STEP_SIZES)
    alpha: float = number(0)
    alpha_decay: float = number(above=0, high=1)
    kappa: float = number(above=1)
    # These have defaults for jobs from before these keys existed; no rule of theirs uses them.
    meta_step_size: float = number(0, default=0.01)
    tau: float = number(above=0, default=1e4)
    eta: float = number(above=0, default=0.1)
    eta_min: float = number(above=0, default=1e-10)
    eta_decay: float = number(above=0, high=1, default=0.999)
    gamma: float = number(0, 1)
    exploration: str = _one_of_or_own(*EXPLORATIONS)
    epsilon: float = number(0, 1)
    epsilon_final: Any = or_null(number(0, 1), default=None)
    epsilon_over: float = number(above=0, default=1.0)
    temperature: float = number(above=0)
    noise_std: float = number(0)
    adaptive: str = one_of(*ADAPTIVE, default="none")  # defaults: of jobs from before these keys
    adaptive_parameters: list[str] = some_of(
        *ADAPTIVE_PARAMETERS, default_factory=lambda: [*ADAPTIVE_PARAMETERS]
    )
    adaptive_beta: str = one_of(*BETAS, default="exponential")
    adaptive_clock: str = one_of(*CLOCKS, default="steps")
    adaptive_rate: float = number(0, default=0.2)
    adaptive_period: float = number(1, default=100.0)
    adaptive_short: float = number(1, default=100.0)
    adaptive_long: float = number(1, default=100.0)
    variant: str = one_of(*VARIANTS)
    trace: str = _one_of_or_own(*TRACES)
    window: int = whole(1)
    scale_rewards: bool = flag(default=False)
    diverged_beyond: float = number(above=1)
    engine: str = one_of("auto", "eager", "compiled")
    situations: int = whole(1)
    resume: str = one_of("auto", "never")

    env: Any = parameters(WORLDS)
    value: Any = parameters(VALUES)
    action: ActionConfig
    evaluation: EvaluationConfig
    machine: MachineConfig
    checkpoint: CheckpointConfig
    rules: RulesConfig | None = None  # None in jobs from before this key existed
    logger: LoggerConfig = field(default_factory=LoggerConfig)  # no logger chosen

    def __post_init__(self) -> None:
        if isinstance(self.value, ValueConfig) and isinstance(self.env, WorldConfig):
            self.value = self.value.in_world(self.env)
        if isinstance(self.evaluation, EvaluationConfig) and self.evaluation.every is None:
            self.evaluation = replace(self.evaluation, every=self.situations)
        check(self)

    def of_run(self, key: str) -> float:
        """Return the value of a key of `PER_RUN`; ``epsilon_final`` defaults to ``epsilon``."""
        value = getattr(self, key)
        return float(self.epsilon if value is None else value)

    @property
    def largest_value(self) -> float:
        """The largest |Q| of a run that hasn't diverged.

        It is infinite if ``env.returns`` is None or rewards are scaled.
        """
        returns = None if self.scale_rewards else self.env.returns
        return inf if returns is None else self.diverged_beyond * max(map(abs, returns))

    @property
    def best_score(self) -> int | None:
        """The highest possible score of a test that counts successes; None for other measures."""
        if self.env.tested.measure != "successes":
            return None
        return self.evaluation.tests or int(self.evaluation.every)

    def contradictions(self) -> Iterator[OutOfRange]:
        """Yield an error for each value that conflicts with another."""
        yield from self._misfits_of_the_step_size()
        every = self.evaluation.every
        if self.situations % every:
            multiple = f"a whole multiple of evaluation.every={every}"
            yield OutOfRange("situations", self.situations, multiple)
        if self.seed + self.num_seeds > 2**63:
            highest = f"at most {2**63 - self.num_seeds}, so that the last seed fits in 63 bits"
            yield OutOfRange("seed", self.seed, highest)
        yield from self._misfits_of_the_learner()
        for misfit in self.value.misfits(self.env):
            if self._has_prior and misfit.value is None and misfit.key in ("inputs", "action"):
                continue  # the prior's file brings labels
            yield OutOfRange(f"value.{misfit.key}", misfit.value, misfit.allowed)
        yield from self._misfits_in_the_dtype()
        yield from self._misfits_of_the_rules()
        yield from self._misfits_of_the_world()

    def _misfits_of_the_step_size(self) -> Iterator[OutOfRange]:
        """Yield an error for each choice with which the rule for the step size doesn't work."""
        rule = self.step_size
        if rule in ("constant", *PER_WEIGHT) and self.alpha_decay != 1:
            yield OutOfRange("alpha_decay", self.alpha_decay, f"1 with step_size={rule}")
        if rule not in PER_WEIGHT:
            return
        if self.alpha == 0:
            yield OutOfRange("alpha", self.alpha, f"above 0 with step_size={rule}")
        if isinstance(self.value, FuzzyConfig) and self.value.learn_memberships:
            yield OutOfRange("value.learn_memberships", True, f"false with step_size={rule}")
        elif not self.value.is_linear:
            *others, last = (kind for kind, schema in VALUES.items() if schema.linear)
            linear = f"{', '.join(others)} or {last}, whose Q is linear in its weights"
            yield OutOfRange("value.kind", self.value.kind, f"{linear}, with step_size={rule}")
        if self.rules is not None and self.rules.frozen:
            yield OutOfRange("rules.frozen", self.rules.frozen, f"[] with step_size={rule}")
        if rule == "swift":
            for key, value in (("variant", "sarsa"), ("trace", "dutch")):
                if getattr(self, key) != value:
                    yield OutOfRange(key, getattr(self, key), f"{value} with step_size=swift")
            if self.eta_min > self.eta:
                yield OutOfRange("eta_min", self.eta_min, f"at most eta={self.eta}")

    def _misfits_of_the_learner(self) -> Iterator[OutOfRange]:
        """Yield an error for a trace or a variant that doesn't fit the other choices."""
        if self.trace == "dutch" and self.variant != "sarsa":
            yield OutOfRange("variant", self.variant, "sarsa with trace=dutch")
        suits_dutch = self.step_size in ("decay", "constant", "swift") or is_own(self.step_size)
        if self.trace == "dutch" and not suits_dutch:
            allowed = "decay, constant or swift with trace=dutch"
            yield OutOfRange("step_size", self.step_size, allowed)
        if self.trace == "dutch" and self.rules is not None and self.rules.frozen:
            yield OutOfRange("rules.frozen", self.rules.frozen, "[] with trace=dutch")
        yield from self._misfits_of_the_adaptive()
        kind = self.value.kind
        clears = "table", "tiles", "tiles_sum"
        if self.trace == "clearing" and kind not in clears and not is_own(kind):
            yield OutOfRange("value.kind", kind, "table, tiles or tiles_sum with trace=clearing")
        if self.value.rules_choose:
            yield from self._misfits_of_choosing_rules()
        if self.variant == "expected_sarsa" and self.exploration == "noise":
            allowed = "epsilon_greedy or boltzmann with variant=expected_sarsa"
            yield OutOfRange("exploration", self.exploration, allowed)
        if self.exploration == "noise" and getattr(self.value, "outputs", "one") == "each":
            allowed = "epsilon_greedy or boltzmann with value.outputs=each"
            yield OutOfRange("exploration", self.exploration, allowed)

    def _misfits_of_the_adaptive(self) -> Iterator[OutOfRange]:
        """Yield an error for a parameter that the adaptive scheme can't change as it is."""
        for key in self.adaptive_parameters if self.adaptive != "none" else ():
            if_changed = f"with adaptive={self.adaptive} and {key} among adaptive_parameters"
            if key == "temperature" and self.exploration != "boltzmann":
                yield OutOfRange("exploration", self.exploration, f"boltzmann {if_changed}")
            if key == "alpha" and self.step_size not in ("constant", "obgd"):
                yield OutOfRange("step_size", self.step_size, f"constant or obgd {if_changed}")
            if key == "alpha" and self.alpha_decay != 1:
                yield OutOfRange("alpha_decay", self.alpha_decay, f"1 {if_changed}")
            value = getattr(self, key)
            if key != "temperature" and not 0 < value < 1:
                yield OutOfRange(key, value, f"a number in (0, 1), without 0 and 1, {if_changed}")

    def _misfits_of_choosing_rules(self) -> Iterator[OutOfRange]:
        """Yield an error for each choice that needs a single action, not one of each rule."""
        kind, world = self.value.kind, self.env
        if "sarsa" in self.variant:
            allowed = f"peng, watkins or naive with value={kind}"
            yield OutOfRange("variant", self.variant, allowed)
        if self.exploration == "noise":
            allowed = f"epsilon_greedy or boltzmann with value={kind}"
            yield OutOfRange("exploration", self.exploration, allowed)
        if isinstance(world.actions, int) and not world.graded:
            allowed = f"another: {world.kind} takes no action between two of its fixed set"
            yield OutOfRange("value.kind", kind, allowed)

    @property
    def _has_prior(self) -> bool:
        return self.rules is not None and self.rules.prior is not None

    @property
    def counts_firing(self) -> bool:
        """True if a job sums the rules' firing strengths while it learns."""
        return self.rules is not None and self.rules.count_firing

    @property
    def frozen_rules(self) -> list[tuple[int | None, ...]]:
        """The rules that don't learn, as :meth:`.RulesConfig.frozen_rules` returns them."""
        value = self.value
        if self.rules is None or not self.rules.frozen or not isinstance(value, LabelsConfig):
            return []
        if value.inputs is None or value.action is None:  # checked once labels are found
            return []
        labels = {**value.inputs, self.env.action_name: value.action}
        return self.rules.frozen_rules(
            [value.names_of(name, len(pairs)) for name, pairs in labels.items()]
        )

    def _misfits_in_the_dtype(self) -> Iterator[OutOfRange]:
        """Yield an error for each number that is too large or too small for ``machine.dtype``."""
        dtype = self.machine.dtype
        round_to, largest = float if dtype == "float64" else _to_float32, LARGEST[dtype]
        for prefix, group in (("", self), ("env.", self.env), ("value.", self.value)):
            for misfit in rounded_misfits(group, round_to):
                words = f"{misfit.allowed}, also when rounded to {dtype}"
                yield OutOfRange(prefix + misfit.key, misfit.value, words)
        for misfit in self.value.overflows(self.env, largest):
            words = f"{misfit.allowed}, so that log μ fits in {dtype}"
            yield OutOfRange(f"value.{misfit.key}", misfit.value, words)

    def _misfits_of_the_rules(self) -> Iterator[OutOfRange]:
        """Yield an error for rule settings without rules, or for unknown frozen rules."""
        if self.rules is not None and self.rules.used and self.value.kind != "fnnq":
            allowed = "fnnq, the kind with rules, if rules.… is given"
            yield OutOfRange("value.kind", self.value.kind, allowed)
            return
        if self._has_prior:  # its labels may have other names; checked when its file is read
            return
        try:
            _ = self.frozen_rules
        except OutOfRange as misfit:
            yield misfit

    def _misfits_of_the_world(self) -> Iterator[OutOfRange]:
        """Yield an error for each action setting or start that the world doesn't have."""
        candidates, actions = self.action.candidates, self.env.actions
        if isinstance(actions, int) and candidates is not None:
            allowed = f"null, for all {actions} actions of {self.env.kind}"
            yield OutOfRange("action.candidates", candidates, allowed)
        if not isinstance(actions, int) and candidates is None:
            allowed = f"a number, as action=even sets: {self.env.kind} has a range of actions"
            yield OutOfRange("action.candidates", candidates, allowed)
        if isinstance(actions, int) and self.exploration == "noise":
            allowed = f"epsilon_greedy or boltzmann: {self.env.kind} has a fixed set of actions"
            yield OutOfRange("exploration", self.exploration, allowed)
        fixed, values = self.evaluation.fixed, self.env.start_values
        if fixed is not None and any(len(start) != len(values) for start in fixed):
            allowed = f"a list of starts [{', '.join(values)}], or a whole number of random starts"
            if not values:
                allowed = f"the number of random starts: {self.env.kind} has no fixed starts"
            yield OutOfRange("evaluation.situations", self.evaluation.situations, allowed)
