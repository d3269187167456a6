"""A loop of steps compiled by TorchInductor: for GPUs, and for operations such as sorting."""

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

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.engine.graphs import leaves, nested, trace
from fnnq_torchrl.engine.loops import MakeStep, Running
from fnnq_torchrl.engine.threads import subnormals_flushed

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

Run = Callable[[Tensor, list[Tensor], list[Tensor]], list[Tensor]]


class InductorLoop:
    """``steps`` times ``state = step(stays, state)``, in one loop around the step's graph.

    Args:
        make_step: pure-tensor code; its Python runs once, when it is traced.
        stays: what the steps read and don't change, batch size ``[lanes]``.
        state: batch size ``[lanes]``. The loop is for such shapes only.

    Raises:
        ConfigError: the C++ compiler fails.
    """

    any_lanes = False

    def __init__(self, make_step: MakeStep, stays: TensorDictBase, state: TensorDictBase) -> None:
        body = _without_repetitions(trace(make_step(len(state)), stays, state))

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
        self._run: Run = torch.compile(loop, fullgraph=True, dynamic=False, options=_OPTIONS)
        with config.patch(unsafe_marked_cacheable_functions=_CACHEABLE):
            try:
                self(stays, state).advance(0)  # compiles
            except InductorError as error:
                if not isinstance(error.inner_exception, CppCompileError | InvalidCxxCompiler):
                    raise
                complaint = str(error.inner_exception).splitlines()[-1]
                raise ConfigError(
                    f"engine=compiled: the C++ compiler doesn't work; engine=eager takes none. "
                    f"It says: {complaint}"
                ) from error

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
    """What policy, loss and gradient each compute, computed once."""
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
