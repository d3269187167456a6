"""The trace, the exploration and the step size of a configuration, built in or the user's."""

import difflib
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import torch
from torch import Tensor

from envs.core.parameters import ConfigError
from envs.core.registry import class_of, is_own
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.policy import ExploringPolicy, policy_class
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import PER_RUN, Config
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import STEP_SIZES, Step, Stepped, StepSize
from fnnq_torchrl.equations.traces import TRACES, Correction, Trace

Result = TypeVar("Result")


def make_rule(config: Config) -> Rule:
    """Return the variant of Q(λ) with its trace.

    Raises:
        ConfigError: if the user's class can't be imported, isn't a :class:`.Trace`, or doesn't suit
            the variant.
    """
    kind = class_of("trace", config.trace, TRACES, Trace)
    try:
        return Rule(config.variant, kind.of(config.window))
    except ValueError as error:
        raise ConfigError(f"trace={config.trace}: {error}") from error


def make_step_size(config: Config) -> StepSize:
    """Return the rule for the step size.

    Raises:
        ConfigError: if the user's class can't be imported or isn't a :class:`.StepSize`.
    """
    kind = class_of("step_size", config.step_size, STEP_SIZES, StepSize)
    if not is_own(config.step_size):
        return kind()
    return _tried(f"step_size={config.step_size}", kind)


def check_own(config: Config) -> None:
    """Try the user's trace, exploration and step size on a few numbers, those that there are.

    Raises:
        ConfigError: if a class isn't what it must be, its code fails, or it returns another shape
            or dtype than it must. One line.
    """
    if is_own(config.trace):
        _check_trace(config)
    if is_own(config.step_size):
        _check_step_size(config)
    if is_own(config.exploration):
        _check_exploration(config)


def _example(config: Config, rule: Rule) -> Step:
    """Return a step of two runs with three weights each."""
    dtype: torch.dtype = getattr(torch, config.machine.dtype)
    gradient = torch.tensor([[0, 1], [2, -1], [0.5, 0]], dtype=dtype)
    per_run = torch.tensor([0.5, -0.25], dtype=dtype)
    credit = rule.credit(
        per_run,
        per_run.flip(0),
        decay=per_run.square(),
        greedy=torch.ones_like(per_run) if rule.variant.cuts else None,
        goes_on=torch.ones_like(per_run),
        of_all=[gradient] if rule.trace.clears else None,
        correction=Correction(per_run.abs(), per_run) if rule.trace.corrects else None,
    )
    traces = [rule.trace.start(torch.zeros_like(gradient))]
    return Step(rule.trace, traces, [gradient], credit, lambda: [gradient])


def _check_trace(config: Config) -> None:
    key = f"trace={config.trace}"
    rule = make_rule(config)
    step = _tried(f"{key}: its start", lambda: _example(config, rule))
    [[before], [gradient]] = step.traces, step.gradients
    credited = _tried(f"{key}: its update", lambda: [tuple(pair) for pair in step.credited()])
    if [len(pair) for pair in credited] != [2]:
        raise ConfigError(f"{key}: its update must return a pair for each tensor of weights")
    [(direction, after)] = credited
    _check_like(f"{key}: its update: the direction", direction, [gradient])
    _check_like(f"{key}: its update: the trace", after, [before])


def _check_step_size(config: Config) -> None:
    key = f"step_size={config.step_size}"
    rule, step = make_step_size(config), _example(config, make_rule(config))
    [gradient] = step.gradients
    alpha = gradient[0].abs()
    for number in rule.numbers:
        _check_key(f"{key}: numbers has {number}", number)
    numbers = {number: alpha + config.of_run(number) for number in rule.numbers}
    start = _tried(
        f"{key}: its start",
        lambda: {name: [*kept] for name, kept in dict(rule.start(alpha, [gradient])).items()},
    )
    for name, kept in start.items():
        _check_like(f"{key}: its start: {name}", kept, [[gradient]])
    _, sizes, after, state = _tried(
        f"{key}: its update", lambda: Stepped(*rule.update(alpha, numbers, start, step))
    )
    _check_like(f"{key}: its update: sizes", [*sizes], [[alpha], [gradient]])
    _check_like(f"{key}: its update: alpha", after, [alpha])
    if {*state} != {*start}:
        raise ConfigError(f"{key}: its update must return a state with {sorted(start)}")
    for name, [*kept] in state.items():
        _check_like(f"{key}: its update: {name}", kept, [[gradient]])


def _check_exploration(config: Config) -> None:
    key = f"exploration={config.exploration}"
    kind = policy_class(config.exploration)
    _check_key(f"{key}: amount_name", getattr(kind, "amount_name", "missing"))
    if config.variant == "expected_sarsa" and kind.probabilities is ExploringPolicy.probabilities:
        raise ConfigError(f"{key}: must have probabilities with variant=expected_sarsa")
    candidates = make_candidates(config, getattr(torch, config.machine.dtype))
    network = make_value_network(config.value, candidates, runs=2)
    amount = torch.full((2,), config.of_run(kind.amount_name), dtype=candidates.dtype)
    policy = _tried(key, lambda: kind(network, amount.unsqueeze(-1)))
    values = torch.arange(2.0 * len(candidates)).to(candidates).view(-1, 2)
    chosen = _tried(
        f"{key}: its choose", lambda: policy.choose(values, amount, torch.full_like(amount, 0.5))
    )
    _check_like(f"{key}: its choose: the action", chosen, [amount])
    if isinstance(config.env.actions, int) and not torch.isin(chosen, candidates).all():
        raise ConfigError(f"{key}: its choose must return some of the candidates")


def _check_key(words: str, name: str) -> None:
    """Refuse a number that no run has."""
    if name not in PER_RUN:
        near = difflib.get_close_matches(name, PER_RUN, n=1)
        meant = f"; did you mean {near[0]}?" if near else f"; there is {', '.join(PER_RUN)}"
        raise ConfigError(f"{words}: the runs have no such number{meant}")


def _tried(words: str, work: Callable[[], Result]) -> Result:
    """Return the result of the user's code, or raise its error as one line."""
    try:
        return work()
    except Exception as error:  # the user's code may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ConfigError(f"{words} fails: {reason}") from error


def _check_like(words: str, found: Any, wanted: Sequence[Tensor | list[Tensor]]) -> None:
    """Refuse a result that has the form of none of the given tensors or lists of tensors."""
    forms = [_form(each) for each in wanted]
    if _form(found) not in forms:
        raise ConfigError(f"{words} is {_form(found)}; it must be {' or '.join(forms)}")


def _form(found: Any) -> str:
    if isinstance(found, list):
        return f"[{', '.join(map(_form, found))}]"
    if isinstance(found, Tensor):
        return f"{str(found.dtype).removeprefix('torch.')} {list(found.shape)}"
    return type(found).__name__
