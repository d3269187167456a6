"""A step as one graph of tensor operations, and TensorDicts as flat tensors."""

from itertools import accumulate
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch._decomp import core_aten_decompositions, get_decompositions
from torch._functorch.compile_utils import fx_graph_cse
from torch.fx import GraphModule, Node
from torch.fx.experimental.proxy_tensor import make_fx

from fnnq_torchrl.layout import runs_first, runs_last
from fnnq_torchrl.loops import Step

_COMPOSITE = "_log_softmax _softmax addmm elu gelu hardtanh leaky_relu native_layer_norm softplus"


def trace(step: Step, stays: TensorDictBase, state: TensorDictBase) -> GraphModule:
    """The step as a graph from and to leaves, gradients included.

    TensorDicts and modules are gone from it. The step's Python runs once; where it would look at
    data, it is refused.

    Returns:
        Takes the leaves of what stays, then those of the state; returns the state's next ones.

    Raises:
        RuntimeError: the step's Python looks at data.
    """
    fixed, carried = leaves(stays), leaves(state)

    def flat(*values: Tensor) -> list[Tensor]:
        before = (
            nested(dict(zip(fixed, values, strict=False)), stays),
            nested(dict(zip(carried, values[len(fixed) :], strict=True)), state),
        )
        after = leaves(step(*before))
        return [after[key] for key in carried]

    composite = [getattr(torch.ops.aten, name) for name in _COMPOSITE.split()]
    decompositions: dict[Any, Any] = {**core_aten_decompositions()}
    decompositions |= get_decompositions(composite)
    decompositions[torch.ops.aten.cumsum.default] = _cumsum
    graph = make_fx(
        flat,
        decomposition_table=decompositions,
        tracing_mode="fake",
        _allow_non_fake_inputs=True,
    )
    with torch.no_grad():
        return _without_repetitions(graph(*fixed.values(), *carried.values()))


def _without_repetitions(graph: GraphModule) -> GraphModule:
    """What policy, loss and gradient each compute, computed once."""
    first: dict[object, Node] = {}
    for constant in graph.graph.find_nodes(op="get_attr"):
        if (same := first.setdefault(constant.target, constant)) is not constant:
            constant.replace_all_uses_with(same)
    graph.graph = fx_graph_cse(graph.graph)
    graph.graph.eliminate_dead_code()
    graph.recompile()
    return graph


def _cumsum(tensor: Tensor, dim: int, *, dtype: torch.dtype | None = None) -> Tensor:
    """Additions, which are fused with what is around them."""
    return torch.stack([*accumulate(tensor.to(dtype or tensor.dtype).unbind(dim))], dim)


def leaves(tree: TensorDictBase) -> dict[str, Tensor]:
    """Copies of a TensorDict's tensors by their paths, in order, the runs last in memory too.

    Copies, because what a loop carries may share memory with nothing, from one step to the next.
    """
    flat = tree.flatten_keys("/")
    return {
        key: runs_last(flat[key]).clone(memory_format=torch.contiguous_format)
        for key in sorted(flat.keys())
    }


def nested(leaves: dict[str, Tensor], like: TensorDictBase) -> TensorDict:
    """Leaves as a TensorDict with the runs first, of the batch size and device of another."""
    first = {key: runs_first(leaf) for key, leaf in leaves.items()}
    return TensorDict(first, like.batch_size, device=like.device).unflatten_keys("/")
