"""Rule bases of any kind, for hypothesis, and the paper's."""

from functools import cache
from math import inf

import torch
from hypothesis import strategies as st

from fnnq_torchrl.agent.rules import FuzzySystem, Label, RuleBase, Variable, partition
from fnnq_torchrl.equations.membership_functions import (
    ELSEWHERE,
    MEMBERSHIP_FUNCTIONS,
    T_NORMS,
)

from .compositions import config_of

numbers = st.floats(-5, 5).map(lambda x: x + 0.0)
widths = st.floats(0.01, 5)


@cache
def paper() -> RuleBase:
    """The paper's labels with any consequents."""
    config = config_of()
    consequents = torch.randn(5, 4, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    return RuleBase(partition(config.value, config.env), "value", consequents)


@st.composite
def labels(draw: st.DrawFn, name: str) -> Label:
    kind = draw(st.sampled_from(sorted(MEMBERSHIP_FUNCTIONS)))
    function = MEMBERSHIP_FUNCTIONS[kind]
    if function.compact:
        count = len(function.parameters)
        parameters = sorted(draw(st.lists(numbers, min_size=count, max_size=count, unique=True)))
    else:
        parameters = [
            draw(widths if name in function.positive else numbers) for name in function.parameters
        ]
        if kind == "gaussian_two_sided":
            parameters[0], parameters[2] = sorted((parameters[0], parameters[2]))
    return Label(name, kind, tuple(parameters))


@st.composite
def variables(draw: st.DrawFn, name: str) -> Variable:
    count = draw(st.integers(1, 3))
    low, high = sorted(draw(st.lists(numbers, min_size=2, max_size=2, unique=True)))
    low, high = draw(st.sampled_from([(low, high), (low, high), (-inf, high), (low, inf)]))
    return Variable(name, tuple(draw(labels(f"l{i}")) for i in range(count)), low, high)


@st.composite
def systems(draw: st.DrawFn) -> FuzzySystem:
    count = draw(st.integers(2, 3))
    inputs = tuple(draw(variables(f"x{i}")) for i in range(count))
    shape = [len(variable.labels) for variable in inputs]
    size = torch.Size(shape).numel()
    values = draw(st.lists(st.floats(-1e6, 1e6), min_size=size, max_size=size))
    consequents = torch.tensor(values, dtype=torch.float64).reshape(shape)
    t_norm, elsewhere = (draw(st.sampled_from(sorted(of))) for of in (T_NORMS, ELSEWHERE))
    return FuzzySystem(inputs, "q", consequents, t_norm, elsewhere)
