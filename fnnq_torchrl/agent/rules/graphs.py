"""Export rules as computation graphs for torch (``.pt2``) and ONNX (``.onnx``).

The graph of Q takes ``state`` ``[batch, states]`` and ``action`` ``[batch, 1]`` and returns
``value`` ``[batch]``. The graph of the greedy choice, or of any other system, takes ``state`` only.
"""

import io
import logging
import re
import warnings
from collections.abc import Sequence, Set
from importlib.util import find_spec
from itertools import chain

import torch
from torch import Tensor, nn

from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.system import FuzzySystem
from fnnq_torchrl.config.extras import installing

Files = dict[str, bytes]


class Output(nn.Module):
    """A fuzzy system as a module, which computes in the precision of its inputs.

    Args:
        system: the fuzzy system.
        dtype: the dtype of its consequents.
    """

    consequents: Tensor

    def __init__(self, system: FuzzySystem, dtype: torch.dtype) -> None:
        super().__init__()
        self._system = system
        self.register_buffer("consequents", system.consequents.flatten().to(dtype))

    def forward(self, state: Tensor) -> Tensor:
        """Return the output ``[*batch]`` for a state ``[*batch, inputs]``."""
        strengths = self._system.strengths(state).flatten(state.ndim - 1)
        total = strengths.sum(-1)
        weighted = (strengths * self.consequents).sum(-1)
        return weighted / total.where(total > 0, 1)


class Value(Output):
    """Q of an action in a state."""

    def forward(self, state: Tensor, action: Tensor) -> Tensor:  # type: ignore[override]
        """Return Q ``[*batch]`` for a state ``[*batch, states]`` and an action ``[*batch, 1]``."""
        return super().forward(torch.cat([state, action], dim=-1))


class Greedy(nn.Module):
    """The greedy choice among candidates; the first if several are equally good.

    Args:
        value: the module of Q.
        candidates: the candidate actions, ``[candidates]``.
    """

    candidates: Tensor

    def __init__(self, value: Value, candidates: Tensor) -> None:
        super().__init__()
        self._value = value
        self.register_buffer("candidates", candidates)

    def forward(self, state: Tensor) -> Tensor:
        """Return the greedy action ``[batch]`` for a state ``[batch, states]``."""
        actions = self.candidates.view(1, -1, 1).expand(state.shape[0], -1, -1)
        values = self._value(state.unsqueeze(1).expand(-1, actions.shape[1], -1), actions)
        return self.candidates[values.argmax(-1)]


def write_pt2(system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool) -> Files:
    """Return a file for :func:`torch.export.load`; arguments as in :func:`.c_source.write`."""
    return _pt2(*_of_output(system, candidates, floats))


def write_pt2_of_greedy(
    system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool
) -> Files:
    """Return a ``.pt2`` file of the greedy choice; arguments as in :func:`.c_source.write`."""
    return _pt2(*_of_greedy(system, candidates, floats))


def write_onnx(system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool) -> Files:
    """Return an ONNX file of a system; arguments as in :func:`.c_source.write`."""
    return _onnx(*_of_output(system, candidates, floats))


def write_onnx_of_greedy(
    system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool
) -> Files:
    """Return an ONNX file of the greedy choice; arguments as in :func:`.c_source.write`."""
    return _onnx(*_of_greedy(system, candidates, floats))


_Graph = tuple[nn.Module, dict[str, Tensor], str]
"""A module, example inputs to trace it with, and the name of its output."""


def _of_output(system: FuzzySystem, candidates: Sequence[float], floats: bool) -> _Graph:
    dtype = torch.float32 if floats else torch.float64
    states = len(system.inputs) - bool(candidates)
    inputs = {"state": torch.zeros(2, states, dtype=dtype)}
    if not candidates:
        return Output(system, dtype), inputs, system.output
    return Value(system, dtype), inputs | {"action": torch.zeros(2, 1, dtype=dtype)}, "value"


def _of_greedy(system: FuzzySystem, candidates: Sequence[float], floats: bool) -> _Graph:
    value, inputs, _ = _of_output(system, candidates, floats)
    assert isinstance(value, Value)
    numbers = torch.tensor(candidates, dtype=inputs["state"].dtype)
    return Greedy(value, numbers), {"state": inputs["state"]}, system.inputs[-1].name


def free_name(name: str, taken: Set[str]) -> str:
    """Return a name of ASCII letters, digits and _ that is like the given one, and not taken."""
    word = re.sub("[^A-Za-z0-9_]+", "_", name).strip("_") or "output"
    free, number = word, 2
    while free in taken:
        free, number = f"{word}_{number}", number + 1
    return free


def _export(module: nn.Module, inputs: dict[str, Tensor]) -> torch.export.ExportedProgram:
    batch = torch.export.Dim("batch")
    shapes = {name: {0: batch} for name in inputs}
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torch 2.13 still uses what it has deprecated itself
        return torch.export.export(module.eval(), (), inputs, dynamic_shapes=shapes)


def _pt2(module: nn.Module, inputs: dict[str, Tensor], output: str) -> Files:
    data = io.BytesIO()
    program = _export(module, inputs)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.export.save(program, data)
    return {".pt2": data.getvalue()}


def _onnx(module: nn.Module, inputs: dict[str, Tensor], output: str) -> Files:
    if find_spec("onnx") is None or find_spec("onnxscript") is None:
        raise RulesError(f".onnx needs further libraries; {installing('onnx')}")
    exported = _export(module, inputs)
    log = logging.getLogger("torch.onnx")
    level = log.level
    log.setLevel(logging.ERROR)  # it warns that torchvision isn't installed
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            program = torch.onnx.export(
                exported,
                kwargs=inputs,
                input_names=[*inputs],
                dynamo=True,
                verbose=False,
            )
    finally:
        log.setLevel(level)
    assert program is not None  # which it is with dynamo
    graph = program.model.graph
    values = chain(graph.inputs, graph.initializers.values(), *(node.outputs for node in graph))
    graph.outputs[0].name = free_name(output, {str(value.name) for value in values})
    return {".onnx": program.model_proto.SerializeToString()}
