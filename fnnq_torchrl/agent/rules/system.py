"""Zero-order Takagi–Sugeno systems, the content of every file of rules."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product
from math import inf, prod
from typing import Any

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.errors import RulesError, choices, shown
from fnnq_torchrl.agent.rules.partition import Label, Variable, repeated
from fnnq_torchrl.equations.membership_functions import ELSEWHERE, T_NORMS

MOST_RULES = 2**16
"""The most rules of a system; their number is the product of the inputs' numbers of labels."""


@dataclass(frozen=True, eq=False)
class FuzzySystem:
    """A fuzzy system with a rule for every combination of labels, one label per input.

    The output is Σ wᵢσᵢ/Σσ, the weighted average of the consequents by the rules' firing strengths
    (paper, eq. 7, 8), computed in double precision.

    Attributes:
        inputs: at least one variable.
        output: the output's name.
        consequents: w, float64 ``[labels of input 1, …, labels of the last]``.
        t_norm: the t-norm that combines the labels' degrees, a key of :data:`.T_NORMS`.
        elsewhere: the label that fires for a number outside of all labels: the ``nearest``, or none
            (``zero``).

    Raises:
        RulesError: on creation, if there are no inputs, a name is repeated, a setting is unknown,
            there are too many rules, or the consequents' shape is wrong or one isn't finite.
    """

    inputs: tuple[Variable, ...]
    output: str
    consequents: Tensor
    t_norm: str = "product"
    elsewhere: str = "nearest"

    def __post_init__(self) -> None:
        if not self.inputs:
            raise RulesError("a rule base needs an input")
        if twice := repeated([*(variable.name for variable in self.inputs), self.output]):
            raise RulesError(f"two variables have the name {shown(twice)}")
        for name, known in ((self.t_norm, T_NORMS), (self.elsewhere, ELSEWHERE)):
            if name not in known:
                raise RulesError(f"{shown(name)}: {choices(name, known)}")
        check_size(self.shape)
        if tuple(self.consequents.shape) != self.shape:
            raise RulesError(
                f"the consequents must be {[*self.shape]}, not {[*self.consequents.shape]}"
            )
        if not self.consequents.isfinite().all():
            raise RulesError("a consequent is no finite number")
        object.__setattr__(self, "consequents", self.consequents.detach().to("cpu", torch.float64))

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of labels of each input."""
        return tuple(len(variable.labels) for variable in self.inputs)

    def firing(self, points: Tensor) -> Tensor:
        """Return the rules' normalised firing strengths σᵢ/Σσ. They sum to 1, or 0 if none fires.

        Args:
            points: one number for each input, ``[*points, inputs]``.

        Returns:
            ``[*points, labels of input 1, …, labels of the last]``, float64.
        """
        strengths = self.strengths(points.to(torch.float64))
        total = strengths.sum([*range(points.ndim - 1, strengths.ndim)], keepdim=True)
        return strengths / total.where(total > 0, 1)

    def evaluate(self, points: Tensor) -> Tensor:
        """Return the output.

        Args:
            points: one number for each input, ``[*points, inputs]``.

        Returns:
            ``[*points]``, float64; 0 where no rule fires.
        """
        return (self.firing(points) * self.consequents).flatten(points.ndim - 1).sum(-1)

    def strengths(self, points: Tensor) -> Tensor:
        """Return firing strengths scaled by a factor for each point, so the highest is near 1.

        Arguments and result as in :meth:`firing`, but in the precision of the points.
        """
        logs = [
            variable.log_degrees(points[..., i], self.elsewhere).movedim(0, -1)
            for i, variable in enumerate(self.inputs)
        ]
        peaks = [log.amax(-1, keepdim=True) for log in logs]
        if self.t_norm == "minimum":  # the strongest rule has the lowest of the peaks
            peaks = [reduce(torch.minimum, peaks)] * len(peaks)
        degrees = [
            (log - peak.where(peak > -inf, 0)).exp() for log, peak in zip(logs, peaks, strict=True)
        ]
        combine, axes = T_NORMS[self.t_norm].combine, len(degrees)
        spread_out = [
            degree.reshape(
                *degree.shape[:-1], *(degree.shape[-1] if j == i else 1 for j in range(axes))
            )
            for i, degree in enumerate(degrees)
        ]
        return reduce(combine, spread_out).expand(*points.shape[:-1], *self.shape)

    def rules(self) -> Iterator[tuple[tuple[Label, ...], float]]:
        """Yield each rule as its labels, one per input, and its consequent.

        The last input's label changes fastest, as in the consequents' memory.
        """
        every = product(*(variable.labels for variable in self.inputs))
        return zip(every, self.consequents.flatten().tolist(), strict=True)

    def table(self) -> list[dict[str, Any]]:
        """Return a row for each rule: each input's label by its name, and the output's number."""
        names = [variable.name for variable in self.inputs]
        return [
            dict(zip(names, (label.name for label in labels), strict=True)) | {self.output: value}
            for labels, value in self.rules()
        ]

    def sentences(self) -> list[str]:
        """Return the rules as sentences, with consequents in full precision."""
        return [
            f"if {self.premise(labels)} then {self.output} is {value!r}"
            for labels, value in self.rules()
        ]

    def premise(self, labels: Sequence[Label]) -> str:
        """Return a premise such as ``bearing is left and steer is hard_left``.

        Args:
            labels: a label of each input, or of the first inputs only.
        """
        pairs = zip(self.inputs, labels, strict=False)
        return " and ".join(f"{variable.name} is {label.name}" for variable, label in pairs)

    def same_partition(self, inputs: Sequence[Variable]) -> bool:
        """Return whether the inputs have the same names and labels; ranges may differ."""
        return [(each.name, each.labels) for each in self.inputs] == [
            (each.name, each.labels) for each in inputs
        ]

    def refuse_gaps(self, ending: str, able: str) -> None:
        """Refuse a format that can't express the output where no label fires.

        Args:
            ending: the format's ending.
            able: the setting with which the format can express it; empty if there is none.

        Raises:
            RulesError: if an input has gaps between its labels.
        """
        for variable in self.inputs:
            for low, high in variable.gaps():
                where = f"{low:g}" if low == high else f"{low:g} to {high:g}"
                others = ".c, .onnx, .pt2, .json and .txt can"
                raise RulesError(
                    f"{ending} can't say what fires at {variable.name} {where}, where no label "
                    f"does: wider labels are needed{f', or {able}' if able else ''}; {others}"
                )

    def __str__(self) -> str:
        return "\n".join(
            f"if {self.premise(labels)} then {self.output} is {value:.3g}"
            for labels, value in self.rules()
        )

    def _repr_markdown_(self) -> str:
        """Return the rules as a Markdown table, for notebooks."""
        rows = (
            [*(label.name for label in labels), f"{value:.3g}"] for labels, value in self.rules()
        )
        head = [*(variable.name for variable in self.inputs), self.output]
        return "".join(f"| {' | '.join(row)} |\n" for row in (head, ["---"] * len(head), *rows))


def check_size(shape: Sequence[int]) -> None:
    """Check the number of rules.

    Args:
        shape: the number of labels of each input.

    Raises:
        RulesError: if there would be more than :data:`MOST_RULES` rules.
    """
    if prod(shape) > MOST_RULES:
        counts = " × ".join(map(str, shape))
        raise RulesError(f"{shown(counts)} rules: at most {MOST_RULES:,} are read")


def fit_names(system: FuzzySystem) -> FuzzySystem:
    """Rename variables and labels by :func:`fit_words`, so that every format accepts them."""
    inputs = fit_inputs(system.inputs)
    output = fit_words([*(variable.name for variable in inputs), system.output])[-1]
    return FuzzySystem(inputs, output, system.consequents, system.t_norm, system.elsewhere)


def fit_inputs(variables: Sequence[Variable]) -> tuple[Variable, ...]:
    """Rename variables and their labels by :func:`fit_words`."""
    names = fit_words([variable.name for variable in variables])
    return tuple(
        Variable(
            name,
            tuple(
                Label(word, label.kind, label.parameters)
                for word, label in zip(fit_words(variable.names), variable.labels, strict=True)
            ),
            variable.low,
            variable.high,
        )
        for name, variable in zip(names, variables, strict=True)
    )


_KEYWORDS = {
    *("if", "then", "is", "and", "or", "not", "with"),
    *("any", "extremely", "seldom", "somewhat", "very"),  # FuzzyLite's hedges
    # FuzzyLite's functions, since its C++ library mistakes a term of that name for the function
    *("abs", "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "ceil", "cos", "cosh"),
    *("eq", "exp", "fabs", "floor", "fmod", "ge", "gt", "le", "log", "log10", "log1p", "lt"),
    *("max", "min", "neq", "pi", "pow", "round", "sin", "sinh", "sqrt", "tan", "tanh"),
    *("input", "action", "label", "output", "candidates", "t_norm", "elsewhere"),
}


def fit_words(names: Sequence[str]) -> list[str]:
    """Turn names into words of ASCII letters, digits and _ that differ even if case is ignored.

    Such words stay as they are, except for keywords of the formats.
    """
    taken: set[str] = set()
    fitted = []
    for name in names:
        word = re.sub(r"[^A-Za-z0-9]+", "_", name)[:64].strip("_") if not _is_word(name) else name
        if not word or word[0].isdigit() or word.lower() in _KEYWORDS:
            word = f"_{word}"
        free, number = word, 2
        while free.lower() in taken:
            free, number = f"{word}_{number}", number + 1
        taken.add(free.lower())
        fitted.append(free)
    return fitted


def _is_word(name: str) -> bool:
    return re.fullmatch("[A-Za-z_][A-Za-z0-9_]{0,63}", name) is not None


def observed(variables: Sequence[Variable], observation: Mapping[str, float]) -> Tensor:
    """Return an observation as a tensor, in the order of the variables.

    Args:
        variables: the variables.
        observation: a number for each variable by name.

    Returns:
        ``[variables]``, float64.

    Raises:
        RulesError: if a variable is missing or a name is unknown.
    """
    names = [variable.name for variable in variables]
    for name in observation:
        if name not in names:
            raise RulesError(f"{shown(name)}: {choices(name, names)}")
    if missing := [name for name in names if name not in observation]:
        raise RulesError(f"{missing[0]} is missing; the rules are about {' and '.join(names)}")
    return torch.tensor([observation[name] for name in names], dtype=torch.float64)
