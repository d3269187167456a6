"""A loop compiled by TorchInductor, for GPUs and for steps that the native compiler can't take."""

from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torch._functorch.compile_utils import fx_graph_cse
from torch._higher_order_ops.while_loop import while_loop
from torch._inductor import config
from torch._inductor.exc import CppCompileError, InductorError, InvalidCxxCompiler
from torch.fx import GraphModule, Node

from fnnq_torchrl.engine.graphs import leaves, nested, trace
from fnnq_torchrl.engine.loops import MakeStep, Running
from fnnq_torchrl.engine.native import CannotCompile
from fnnq_torchrl.engine.threads import subnormals_flushed

_OPTIONS: dict[str, str | int | bool | Callable[..., Any]] = {
    "cpp_wrapper": True,  # the loop in C++ too, so that it releases the GIL
    "cpp.threads": 1,  # our own worker threads each take a slice of the runs
    "unroll_reductions_threshold": 64,  # puts sums over rules in loops over the runs
    # A value that every rule or candidate reads is computed once and kept in memory.
    "deterministic": True,
    "realize_reads_threshold": 1,
}
"""Inductor's options. A multiplication and an addition stay two operations with two roundings.
Fusing them would depend on the loop and so on the number of lanes, which must not change a run.
"""

# Tells torch's cache that a while_loop may be cached: equal graphs make equal loops.
_CACHEABLE = dict.fromkeys(("while_loop", "torch.ops.higher_order.while_loop"), torch.__version__)

Run = Callable[[Tensor, list[Tensor], list[Tensor]], list[Tensor]]


class InductorLoop:
    """A compiled loop that repeats ``state = step(stays, state)``.

    Args:
        make_step: makes the step, pure tensor code whose Python is run once, to trace it.
        stays: an example of the tensors that steps read and don't change, batch size ``[lanes]``.
        state: an example of the state, batch size ``[lanes]``. The loop takes these shapes only.

    Raises:
        CannotCompile: if the C++ compiler fails, or its programs can't be written or loaded.
    """

    any_lanes = False

    def __init__(
        self,
        make_step: MakeStep,
        stays: TensorDictBase,
        state: TensorDictBase,
        recipe: str | None = None,
    ) -> None:
        body = _without_repetitions(trace(make_step(len(state)), stays, state))

        def loop(steps: Tensor, fixed: list[Tensor], carried: list[Tensor]) -> list[Tensor]:
            def unfinished(done: Tensor, *carried: Tensor) -> Tensor:
                return done < steps

            def one_step(done: Tensor, *carried: Tensor) -> tuple[Tensor, ...]:
                return done + 1, *body(*fixed, *carried)

            none = torch.zeros((), dtype=torch.int64)  # on the CPU: needs no device sync
            _, *after = while_loop(unfinished, one_step, (none, *carried))  # type: ignore[no-untyped-call]
            return after

        # torch.compile caches at most eight results per code object, so each loop gets its own.
        loop.__code__ = loop.__code__.replace()
        self._run: Run = torch.compile(loop, fullgraph=True, dynamic=False, options=_OPTIONS)
        with config.patch(unsafe_marked_cacheable_functions=_CACHEABLE):
            try:
                self(stays, state).advance(0)  # compiles
            except InductorError as error:
                inner = error.inner_exception
                if not isinstance(inner, CppCompileError | InvalidCxxCompiler | OSError):
                    raise
                complaint = str(inner).splitlines()[-1]
                raise CannotCompile(f"TorchInductor can't compile here: {complaint}") from error

    def __call__(self, stays: TensorDictBase, state: TensorDictBase) -> Running:
        return _Running(self._run, stays, state)


class _Running:
    def __init__(self, run: Run, stays: TensorDictBase, state: TensorDictBase) -> None:
        self._run = run
        self.stays, self.state = nested(leaves(stays), stays), nested(leaves(state), state)

    @torch.no_grad()
    def advance(self, steps: int) -> None:
        fixed, carried = leaves(self.stays), leaves(self.state)
        with subnormals_flushed():
            after = self._run(torch.tensor(steps), [*fixed.values()], [*carried.values()])
        self.state = nested(dict(zip(carried, after, strict=True)), self.state)


def _without_repetitions(graph: GraphModule) -> GraphModule:
    """Merge equal operations, such as those that policy, loss and gradient have in common."""
    if any(_writes_in_place(node) for node in graph.graph.nodes):
        return graph  # equal operations may then have different results
    first: dict[object, Node] = {}
    for constant in graph.graph.find_nodes(op="get_attr"):
        if (same := first.setdefault(constant.target, constant)) is not constant:
            constant.replace_all_uses_with(same)
    graph.graph = fx_graph_cse(graph.graph)
    graph.graph.eliminate_dead_code()
    graph.recompile()
    return graph


def _writes_in_place(node: Node) -> bool:
    schema = getattr(node.target, "_schema", None)
    return schema is not None and bool(schema.is_mutable)
