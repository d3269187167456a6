"""A traced step, carried out on arrays of scalar expressions: the step is written out.

Views and broadcasts are gone then, and what is computed twice is found. Large dimensions stay one
expression each, to become loops (:mod:`.arrays`). The operations are those of
the core ATen set that a step is likely to have; composite ones come decomposed
(:mod:`fnnq_torchrl.engine.graphs`).
"""

from typing import Any

from torch.fx import GraphModule, Interpreter, Node

from . import elementwise, reductions, shapes
from .arrays import Array, constants
from .call import Call
from .expressions import Expressions, Unsupported

_OPERATIONS = elementwise.OPERATIONS | reductions.OPERATIONS | shapes.OPERATIONS


class Executor(Interpreter):
    """Executes a graph of core ATen operations on arrays of expressions.

    Args:
        graph: one whose nodes know what their results are like.
        make: makes the expressions.
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
    """Hold a result to the shape and the dtype that torch has for it.

    Raises:
        ValueError: it has others.
    """
    if isinstance(like, tuple | list):
        for one, like_one in zip(result, like, strict=True):
            _check(one, like_one)
    elif result.shape != tuple(like.shape) or any(
        value.dtype is not like.dtype for value in result.values.flat
    ):
        raise ValueError(f"{result.shape} for {like}")
