"""An interpreter that runs a traced step on arrays of scalar expressions.

This removes views and broadcasts, and merges equal expressions. A large dimension stays one
expression, which becomes a loop (:mod:`.arrays`). It knows the core ATen operations that a step is
likely to have; tracing has decomposed composite ones (:mod:`fnnq_torchrl.engine.graphs`).
"""

from typing import Any

from torch.fx import GraphModule, Interpreter, Node

from . import elementwise, reductions, shapes
from .arrays import Array, constants
from .call import Call
from .errors import Unsupported
from .expressions import Expressions

_OPERATIONS = elementwise.OPERATIONS | reductions.OPERATIONS | shapes.OPERATIONS


class Executor(Interpreter):
    """Executes a graph of core ATen operations on arrays of expressions.

    Args:
        graph: a graph whose nodes have the fake tensor of their result in ``meta["val"]``.
        make: the factory of expressions.
    """

    def __init__(self, graph: GraphModule, make: Expressions) -> None:
        super().__init__(graph)
        self.make = make

    def run_node(self, n: Node) -> Any:
        return self._call(n) if n.op == "call_function" else super().run_node(n)

    def get_attr(self, target: Any, args: Any, kwargs: Any) -> Array:
        return constants(super().get_attr(target, args, kwargs), self.make, target)

    def _call(self, node: Node) -> Any:
        packet = getattr(node.target, "overloadpacket", node.target)
        if packet not in _OPERATIONS:
            raise Unsupported(f"no translation for {node.target}")
        args, kwargs = self.fetch_args_kwargs_from_env(node)
        like = node.meta["val"]
        call = Call(
            self.make,
            packet,
            args=[arg.meta["val"] if isinstance(arg, Node) else arg for arg in node.args],
            result=like[0] if isinstance(like, tuple | list) else like,
        )
        try:
            result = _OPERATIONS[packet](call, *args, **kwargs)
            _check(result, like)
        except (ArithmeticError, LookupError, TypeError, ValueError) as error:
            raise Unsupported(f"no translation for {node.target} as it is called here") from error
        return result


def _check(result: Any, like: Any) -> None:
    """Check a result's shape and dtype against those of torch.

    Raises:
        ValueError: if they differ.
    """
    if isinstance(like, tuple | list):
        for one, like_one in zip(result, like, strict=True):
            _check(one, like_one)
    elif result.shape != tuple(like.shape) or any(
        value.dtype is not like.dtype for value in result.values.flat
    ):
        raise ValueError(f"{result.shape} for {like}")
