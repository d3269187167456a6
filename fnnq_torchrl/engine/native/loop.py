"""A loop of steps as a native program of scalar operations."""

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
from .source import Leaf, program

_MOST = 40_000
"""Expressions of two runs' steps, a family as one: for more, a compiler takes minutes."""


class RunsMixed(ValueError):
    """A step in which one run's next state isn't a function of that run's own state alone."""


class NativeLoop:
    """``steps`` times ``state = step(stays, state)``, in one native loop, for any number of lanes.

    The step is traced for two runs and written out, large tensors in loops. Each run must do the
    same with its own numbers and know nothing of the other. What one does is the program. It takes
    a vector of lanes through all their steps before it turns to the next, so that their states stay
    in registers and in the first-level cache; lanes never meet, and one computes what it would
    compute alone, bit for bit.

    Args:
        make_step: pure-tensor code; its Python runs once, when it is traced.
        stays: what the steps read and don't change.
        state: what they change.

    Raises:
        Unsupported: the step has an operation that isn't known here, or too many.
        RunsMixed: a run's next state depends on other runs, or on which lane it is.
        ConfigError: the C++ compiler fails.
    """

    any_lanes = True

    def __init__(self, make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> None:
        two = torch.arange(2) % len(state)
        self._run = build(source(make_step(2), stays[two], state[two]))
        self._like = _shapes(stays), _shapes(state)

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        """Take lanes in hand.

        Raises:
            ValueError: they aren't like those that the program is for, or too few or too many.
        """
        if (_shapes(stays), _shapes(state)) != self._like:
            raise ValueError(f"a program for {self._like} got {_shapes(stays), _shapes(state)}")
        if len(state) % LANES or len(stays) != len(state):
            raise ValueError(f"{len(state)} lanes: must be a multiple of {LANES}, and all there")
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
        # Views: what the program does to the leaves is seen in the state, and the other way round.
        # Locked, since an entry that is replaced would not be the program's any more.
        self.stays, self.state = nested(fixed, stays).lock_(), nested(carried, state).lock_()

    def advance(self, steps: int) -> None:
        self._run(self._lanes, steps, self._pointers)


def source(step: Step, stays: TensorDictBase, state: TensorDictBase) -> str:
    """The program's text.

    Args:
        step: for two runs.
        stays, state: of two runs.

    Raises:
        Unsupported: the step has an operation that isn't known here, or too many.
        RunsMixed: a run's next state depends on other runs, or on which lane it is.
    """
    graph = trace(step, stays, state)
    fixed, carried = leaves(stays), leaves(state)
    tensors = [*fixed.values(), *carried.values()]
    make = Expressions(_MOST, large_sizes(tensor.shape[:-1] for tensor in tensors))
    # Of two runs, and of the same two the other way round: each must find the same in its lane.
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
    return program(
        [
            Leaf(tensor.dtype, tensor[..., 0].numel(), change)
            for tensor, change in zip(tensors, changes, strict=True)
        ],
        [*fixed, *carried].index("over") if "over" in carried else None,
    )


def _write_out(graph: GraphModule, given: Sequence[Array], make: Expressions) -> list[Array]:
    return [*Executor(graph, make).run(*given)]


def _swapped(array: Array) -> Array:
    return Array(array.make, array.values[..., ::-1], array.axes)


def _lane(array: Array, lane: int) -> Array:
    return Array(array.make, array.values[..., lane], array.axes[:-1])


def _check_alone(name: str, one: Sequence[Expression], other: Sequence[Expression]) -> None:
    if any(value.op == "input" and value.args[2] for value in in_order(one)):
        raise RunsMixed(f"{name}: a run's next one depends on other runs")
    if any(a is not b for a, b in zip(one, other, strict=True)):
        raise RunsMixed(f"{name}: the step isn't the same for every run")


def _shapes(tree: TensorDictBase) -> dict[str, tuple[Any, ...]]:
    """What a lane has: its leaves' shapes and dtypes."""
    flat = tree.flatten_keys("/")
    return {key: (*flat[key].shape[1:], flat[key].dtype) for key in sorted(flat.keys())}
