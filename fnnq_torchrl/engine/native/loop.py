"""A loop around a step, compiled to a native program of scalar operations."""

import ctypes
from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDictBase

from fnnq_torchrl.engine.graphs import leaves, nested
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.loops import MakeStep, Running

from .known import program


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
        recipe: see :class:`.loops.MakeLoop`. A step with a known recipe isn't traced.

    Raises:
        Unsupported: if the step has an operation without a translation, or too many operations.
        RunsMixed: if a run's next state depends on other runs or on the run's lane.
        ConfigError: if the C++ compiler fails.
    """

    any_lanes = True

    def __init__(
        self,
        make_step: MakeStep,
        stays: TensorDictBase,
        state: TensorDictBase,
        recipe: str | None = None,
    ) -> None:
        def text() -> str:
            from .translation import source  # here, since a known program needs no compiler

            two = torch.arange(2) % len(state)
            return source(make_step(2), stays[two], state[two])

        self._like = _shapes(stays), _shapes(state)
        self._run = program(recipe and f"{recipe}\n{self._like}", text)

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


def _shapes(tree: TensorDictBase) -> dict[str, tuple[Any, ...]]:
    """Return the shapes, without the batch dimension, and the dtypes of a TensorDict's tensors."""
    flat = tree.flatten_keys("/")
    return {key: (*flat[key].shape[1:], flat[key].dtype) for key in sorted(flat.keys())}
