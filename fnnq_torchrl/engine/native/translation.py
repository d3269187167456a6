"""Translate a step into scalar expressions, and the expressions into a C++ program."""

from collections.abc import Sequence

from tensordict import TensorDictBase
from torch.fx import GraphModule

from fnnq_torchrl.engine.graphs import leaves, trace
from fnnq_torchrl.engine.loops import Step

from .arrays import Array, inputs, large_sizes
from .errors import RunsMixed
from .executor import Executor
from .expressions import Expression, Expressions, Place, in_order
from .source import program
from .statements import Leaf

_MOST = 100_000
"""The largest number of expressions in the steps of two runs; compiling so many takes 2 minutes."""


def source(step: Step, stays: TensorDictBase, state: TensorDictBase) -> str:
    """Return the C++ program of a step.

    Args:
        step: the step for two runs.
        stays, state: examples of its inputs, batch size ``[2]``.

    Raises:
        Unsupported, RunsMixed: as in :func:`written_out`.
    """
    fixed, carried = [*leaves(stays)], [*leaves(state)]
    over = len(fixed) + carried.index("over") if "over" in carried else None
    return program(written_out(step, stays, state), over)


def written_out(step: Step, stays: TensorDictBase, state: TensorDictBase) -> list[Leaf]:
    """Return the computation of one run's step as scalar expressions.

    Args:
        step: the step for two runs.
        stays, state: examples of its inputs, batch size ``[2]``.

    Returns:
        The leaves of ``stays`` and then those of ``state`` (:func:`.graphs.leaves`), with their new
        values.

    Raises:
        Unsupported: if the step has an operation without a translation, or too many operations.
        RunsMixed: if a run's next state depends on other runs or on the run's lane.
    """
    graph = trace(step, stays, state)
    fixed, carried = leaves(stays), leaves(state)
    tensors = [*fixed.values(), *carried.values()]
    make = Expressions(_MOST, large_sizes(tensor.shape[:-1] for tensor in tensors))
    # The step is evaluated on two runs, and again on the two runs in swapped order. A run's result
    # must be the same both times.
    given = [inputs(tensor, make, number) for number, tensor in enumerate(tensors)]
    outputs = _write_out(graph, given, make)
    swapped = _write_out(graph, [_swapped(array) for array in given], make)
    changes: list[list[tuple[Place, Expression]]] = [[] for _ in tensors]
    for number, (name, here, there) in enumerate(zip(carried, outputs, swapped, strict=True)):
        one, other = ([*_lane(array, lane).elements()] for array, lane in ((here, 0), (there, 1)))
        _check_alone(name, [value for _, value in one], [value for _, value in other])
        leaf = len(fixed) + number
        for place, value in one:
            if value is not make.input(leaf, place, 0, value.dtype):
                changes[leaf].append((place, value))
    return [
        Leaf(tensor.dtype, tensor[..., 0].numel(), change)
        for tensor, change in zip(tensors, changes, strict=True)
    ]


def _write_out(graph: GraphModule, given: Sequence[Array], make: Expressions) -> list[Array]:
    return [*Executor(graph, make).run(*given)]


def _swapped(array: Array) -> Array:
    return Array(array.make, array.values[..., ::-1], array.axes)


def _lane(array: Array, lane: int) -> Array:
    return Array(array.make, array.values[..., lane], array.axes[:-1])


def _check_alone(name: str, one: Sequence[Expression], other: Sequence[Expression]) -> None:
    if any(value.op == "input" and value.args[2] for value in in_order(one)):
        raise RunsMixed(f"{name}: a run's next value depends on other runs")
    if any(a is not b for a, b in zip(one, other, strict=True)):
        raise RunsMixed(f"{name}: the step isn't the same for every run")
