"""A loop of steps as one native program, made of the code that also runs eagerly."""

from collections.abc import Callable
from itertools import accumulate
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch._functorch.compile_utils import fx_graph_cse
from torch._higher_order_ops.while_loop import while_loop
from torch._inductor import config
from torch._inductor.exc import CppCompileError, InductorError, InvalidCxxCompiler
from torch.fx import GraphModule, Node
from torch.fx.experimental.proxy_tensor import make_fx

from fnnq_torchrl.config import ConfigError
from fnnq_torchrl.layout import runs_first, runs_last
from fnnq_torchrl.loops import Step

_OPTIONS: dict[str, str | int | bool | Callable[..., Any]] = {
    "cpp_wrapper": True,  # the loop itself in C++, which also lets other threads go on
    "cpp.threads": 1,  # within a slice of the runs: the threads take a slice each
    "unroll_reductions_threshold": 64,  # sums over rules and candidates, into loops over the runs
    # What is read again for every rule or candidate is computed once and kept in memory.
    "deterministic": True,
    "realize_reads_threshold": 1,
}
"""Of Inductor. A product and its sum stay two roundings: which pairs a compiler would join depends
on the loop that they are in, and so on the number of lanes, of which a run must know nothing.
"""

# Torch's cache of compiled graphs doesn't know yet that a loop is the same if its graphs are.
_CACHEABLE = dict.fromkeys(("while_loop", "torch.ops.higher_order.while_loop"), torch.__version__)


class CompiledLoop:
    """``steps`` times ``state = step(stays, state)``, in one native loop.

    The step is traced into one graph of tensor operations, gradients included; TensorDicts and
    modules are gone from it. Inductor makes a loop around it.

    Args:
        step: pure-tensor code; its Python runs once, when it is traced.
        stays: what the steps read and don't change, batch size ``[lanes]``.
        state: batch size ``[lanes]``. The loop is for such shapes only.
    """

    def __init__(self, step: Step, stays: TensorDictBase, state: TensorDictBase) -> None:
        body = _trace(step, stays, state)

        def loop(steps: Tensor, fixed: list[Tensor], carried: list[Tensor]) -> list[Tensor]:
            def unfinished(done: Tensor, *carried: Tensor) -> Tensor:
                return done < steps

            def one_step(done: Tensor, *carried: Tensor) -> tuple[Tensor, ...]:
                return done + 1, *body(*fixed, *carried)

            none = torch.zeros((), dtype=torch.int64)  # on the CPU: no device need be waited for
            _, *after = while_loop(unfinished, one_step, (none, *carried))  # type: ignore[no-untyped-call]
            return after

        # torch.compile keeps its results with the code, eight at most: each loop has its own.
        loop.__code__ = loop.__code__.replace()
        self._loop = torch.compile(loop, fullgraph=True, dynamic=False, options=_OPTIONS)
        with config.patch(unsafe_marked_cacheable_functions=_CACHEABLE):
            try:
                self(stays, state, 0)  # compiles
            except InductorError as error:
                if not isinstance(error.inner_exception, CppCompileError | InvalidCxxCompiler):
                    raise
                complaint = str(error.inner_exception).splitlines()[-1]
                raise ConfigError(
                    f"engine=compiled: the C++ compiler doesn't work; engine=eager takes none. "
                    f"It says: {complaint}"
                ) from error

    @torch.no_grad()
    def __call__(self, stays: TensorDictBase, state: TensorDictBase, steps: int) -> TensorDict:
        """The state so many steps later."""
        fixed, carried = _leaves(stays), _leaves(state)
        after = self._loop(torch.tensor(steps), [*fixed.values()], [*carried.values()])
        return _nested(dict(zip(carried, after, strict=True)), state)


def _trace(step: Step, stays: TensorDictBase, state: TensorDictBase) -> GraphModule:
    """The step as a graph from leaves to leaves, the runs last in each."""
    fixed, carried = _leaves(stays), _leaves(state)

    def flat(*tensors: Tensor) -> list[Tensor]:
        inputs = iter(tensors)
        before = [
            _nested({key: next(inputs) for key in leaves}, like)
            for leaves, like in ((fixed, stays), (carried, state))
        ]
        after = _leaves(step(*before))
        return [after[key] for key in carried]

    trace = make_fx(
        flat,
        decomposition_table={torch.ops.aten.cumsum.default: _cumsum},
        tracing_mode="fake",
        _allow_non_fake_inputs=True,
    )
    with torch.no_grad():
        graph = trace(*fixed.values(), *carried.values())
    return _without_repetitions(graph)


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
    """Inductor has none for CPUs; additions are fused with what is around them."""
    return torch.stack([*accumulate(tensor.to(dtype or tensor.dtype).unbind(dim))], dim)


def _leaves(nested: TensorDictBase) -> dict[str, Tensor]:
    """Copies of a TensorDict's tensors by their paths, in order, the runs last in memory too.

    Copies, because what a loop carries may share memory with nothing, from one step to the next.
    """
    flat = nested.flatten_keys("/")
    return {
        key: runs_last(flat[key]).clone(memory_format=torch.contiguous_format)
        for key in sorted(flat.keys())
    }


def _nested(leaves: dict[str, Tensor], like: TensorDictBase) -> TensorDict:
    first = {key: runs_first(leaf) for key, leaf in leaves.items()}
    return TensorDict(first, like.batch_size, device=like.device).unflatten_keys("/")
