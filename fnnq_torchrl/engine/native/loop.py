"""A loop around a step, compiled to a native program of scalar operations."""

import ctypes
from collections.abc import Callable, Sequence
from typing import Any

import torch
from tensordict import TensorDictBase
from torch.fx import GraphModule

from fnnq_torchrl.engine.graphs import leaves, nested, trace
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import MakeStep, Running, Step

from .arrays import Array, inputs, large_sizes
from .build import build
from .executor import Executor
from .expressions import Expression, Expressions, Place, in_order
from .source import program
from .statements import Leaf

_MOST = 100_000
"""The most expressions in the steps of two runs; a C++ compiler takes two minutes for so many."""


class RunsMixed(ValueError):
    """A step in which a run's next state depends on other runs or on the run's lane."""


class NativeLoop:
    """A native loop that repeats ``state = step(stays, state)``, for any number of lanes.

    The step is traced for two runs. Both must compute the same function of their own state, and
    the program is that function. It takes one vector of lanes through all steps before it starts
    the next, so their state stays in registers and in the first-level cache. Lanes don't interact:
    a run's results are bit for bit the same in any batch.

    Args:
        make_step: makes the step, pure tensor code whose Python is run once, to trace it.
        stays: an example of the tensors that steps read and don't change.
        state: an example of the state.

    Raises:
        Unsupported: if the step has an operation without a translation, or too many operations.
        RunsMixed: if a run's next state depends on other runs or on the run's lane.
        ConfigError: if the C++ compiler fails.
    """

    any_lanes = True

    def __init__(self, make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> None:
        two = torch.arange(2) % len(state)
        self._run = build(source(make_step(2), stays[two], state[two]))
        self._like = _shapes(stays), _shapes(state)

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        """Return copies of a batch, ready to advance.

        Raises:
            ValueError: if keys, shapes or dtypes differ from the examples', or the number of lanes
                isn't a multiple of :data:`.lanes.LANES`, the same in both TensorDicts.
        """
        if (_shapes(stays), _shapes(state)) != self._like:
            raise ValueError(f"a program for {self._like} got {_shapes(stays), _shapes(state)}")
        if len(state) % LANES or len(stays) != len(state):
            raise ValueError(f"{len(state)} lanes: must be a multiple of {LANES}, in both")
        return _Running(self._run, stays, state)


class _Running:
    def __init__(
        self, run: Callable[..., Any], stays: TensorDictBase, state: TensorDictBase
    ) -> None:
        fixed, carried = leaves(stays), leaves(state)
        self._tensors = [*fixed.values(), *carried.values()]
        pointers = [leaf.data_ptr() for leaf in self._tensors]
        self._pointers = (ctypes.c_void_p * len(pointers))(*pointers)
        self._run, self._lanes = run, len(state)
        # These are views of the leaves, so the program and the caller see each other's changes.
        # They are locked, since the program wouldn't see an entry that replaces a leaf.
        self.stays, self.state = nested(fixed, stays).lock_(), nested(carried, state).lock_()

    def advance(self, steps: int) -> None:
        self._run(self._lanes, steps, self._pointers)


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
    """Return what one run computes in a step, as scalar expressions.

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
    # The step is run on two runs and again with them swapped: a run's result must be the same.
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


def _shapes(tree: TensorDictBase) -> dict[str, tuple[Any, ...]]:
    """Return the shapes, without the batch dimension, and the dtypes of a TensorDict's tensors."""
    flat = tree.flatten_keys("/")
    return {key: (*flat[key].shape[1:], flat[key].dtype) for key in sorted(flat.keys())}
