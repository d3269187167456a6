"""Trace a step into one graph of tensor operations, and flatten TensorDicts into tensors.

A leaf is one tensor of a flattened TensorDict.
"""

from functools import cache
from itertools import accumulate
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch._decomp import core_aten_decompositions, get_decompositions
from torch.fx import GraphModule
from torch.fx.experimental.proxy_tensor import make_fx

from fnnq_torchrl.engine.loops import Step
from fnnq_torchrl.equations.layout import runs_first, runs_last

_COMPOSITE = "_log_softmax _softmax addmm elu gelu hardtanh leaky_relu native_layer_norm softplus"


def trace(step: Step, stays: TensorDictBase, state: TensorDictBase) -> GraphModule:
    """Trace a step, gradients included, into a graph whose inputs and outputs are plain tensors.

    The graph contains no TensorDicts and no modules. The step's Python code runs once, on fake
    tensors, so it must not branch on their data.

    Args:
        step: the function to trace.
        stays: an example of the tensors that steps read and don't change.
        state: an example of the tensors that a step replaces.

    Returns:
        A graph that takes the leaves of ``stays`` and then those of ``state``, and returns the
        leaves of the next state.

    Raises:
        RuntimeError: if the step's Python code branches on data.
        ValueError: if the next state differs from ``state`` in its keys, shapes or dtypes.
    """
    fixed, carried = leaves(stays), leaves(state)

    def flat(*values: Tensor) -> list[Tensor]:
        before = (
            nested(dict(zip(fixed, values, strict=False)), stays),
            nested(dict(zip(carried, values[len(fixed) :], strict=True)), state),
        )
        after = leaves(step(*before))
        _check_alike(carried, after)
        return [after[key] for key in carried]

    graph = make_fx(
        flat,
        decomposition_table=_decompositions(),
        tracing_mode="fake",
        _allow_non_fake_inputs=True,
    )
    with torch.no_grad():
        return graph(*fixed.values(), *carried.values())


@cache
def _decompositions() -> dict[Any, Any]:
    """Return the decompositions of operations by which the graph has only core operations."""
    composite = [getattr(torch.ops.aten, name) for name in _COMPOSITE.split()]
    decompositions: dict[Any, Any] = {**core_aten_decompositions()}
    decompositions |= get_decompositions(composite)
    decompositions[torch.ops.aten.cumsum.default] = _cumsum
    return decompositions


def _check_alike(before: dict[str, Tensor], after: dict[str, Tensor]) -> None:
    if before.keys() != after.keys():
        raise ValueError(f"a step from {[*before]} to {[*after]}: must have the same entries")
    for key, old in before.items():
        new = after[key]
        if (old.shape, old.dtype) != (new.shape, new.dtype):
            raise ValueError(
                f"{key}: a step from {old.dtype} {list(old.shape)} to {new.dtype} "
                f"{list(new.shape)}, with the runs last: must be alike"
            )
    over = before.get("over")
    if over is not None and (over.dtype is not torch.bool or over.shape[:-1] != (1,)):
        raise ValueError(f"over: {over.dtype} {list(over.shape)}: must be bool [lanes, 1]")


def _cumsum(tensor: Tensor, dim: int, *, dtype: torch.dtype | None = None) -> Tensor:
    """The cumulative sum as single additions, which fuse with neighbouring operations."""
    whole = not (tensor.is_floating_point() or tensor.is_complex())
    dtype = dtype or (torch.int64 if whole else tensor.dtype)
    return torch.stack([*accumulate(tensor.to(dtype).unbind(dim))], dim)


def leaves(tree: TensorDictBase) -> dict[str, Tensor]:
    """Return contiguous copies of a TensorDict's tensors, with the runs as the last dimension.

    They are copies because the tensors that a loop carries from step to step must not share memory.

    Returns:
        The tensors by path (``"a/b"``), sorted by path.
    """
    flat = tree.flatten_keys("/")
    return {
        key: runs_last(flat[key]).clone(memory_format=torch.contiguous_format)
        for key in sorted(flat.keys())
    }


def nested(leaves: dict[str, Tensor], like: TensorDictBase) -> TensorDict:
    """Return leaves as a TensorDict with the runs first; the inverse of :func:`leaves`.

    Args:
        leaves: the tensors by path, with the runs as the last dimension.
        like: the TensorDict that gives the batch size and the device.
    """
    first = {key: runs_first(leaf) for key, leaf in leaves.items()}
    return TensorDict(first, like.batch_size, device=like.device).unflatten_keys("/")
