"""Rules as graphs, for robots that run torch or ONNX: ``.pt2`` and ``.onnx``.

Of Q, a graph from ``state`` ``[batch, states]`` and ``action`` ``[batch, 1]`` to ``value``
``[batch]``; of the greedy choice, or of any other system, from ``state`` alone.
"""

import io
import logging
import warnings
from collections.abc import Sequence
from importlib.util import find_spec

import torch
from torch import Tensor, nn

from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.system import FuzzySystem

Files = dict[str, bytes]


class Output(nn.Module):
    """A system as a module, which computes in the precision of its inputs.

    Args:
        system: which.
        dtype: of its consequents.
    """

    consequents: Tensor

    def __init__(self, system: FuzzySystem, dtype: torch.dtype) -> None:
        super().__init__()
        self._system = system
        self.register_buffer("consequents", system.consequents.flatten().to(dtype))

    def forward(self, state: Tensor) -> Tensor:
        """The output: ``[*batch]`` of ``[*batch, inputs]``."""
        strengths = self._system.strengths(state).flatten(state.ndim - 1)
        total = strengths.sum(-1)
        weighted = (strengths * self.consequents).sum(-1)
        return weighted / total.where(total > 0, 1)


class Value(Output):
    """Q of an action in a state."""

    def forward(self, state: Tensor, action: Tensor) -> Tensor:  # type: ignore[override]
        """Q: ``[*batch]`` of ``[*batch, states]`` and ``[*batch, 1]``."""
        return super().forward(torch.cat([state, action], dim=-1))


class Greedy(nn.Module):
    """The best of the candidates, the first of several.

    Args:
        value: Q.
        candidates: ``[candidates]``.
    """

    candidates: Tensor

    def __init__(self, value: Value, candidates: Tensor) -> None:
        super().__init__()
        self._value = value
        self.register_buffer("candidates", candidates)

    def forward(self, state: Tensor) -> Tensor:
        """The action: ``[batch]`` of ``[batch, states]``."""
        actions = self.candidates.view(1, -1, 1).expand(state.shape[0], -1, -1)
        values = self._value(state.unsqueeze(1).expand(-1, actions.shape[1], -1), actions)
        return self.candidates[values.argmax(-1)]


def write_pt2(system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool) -> Files:
    """The file of a system for :func:`torch.export.load`; arguments as :func:`.c_source.write`."""
    return _pt2(*_of_output(system, candidates, floats))


def write_pt2_of_greedy(
    system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool
) -> Files:
    """The same of the greedy choice."""
    return _pt2(*_of_greedy(system, candidates, floats))


def write_onnx(system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool) -> Files:
    """The ONNX file of a system; arguments as :func:`.c_source.write`."""
    return _onnx(*_of_output(system, candidates, floats))


def write_onnx_of_greedy(
    system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool
) -> Files:
    """The same of the greedy choice."""
    return _onnx(*_of_greedy(system, candidates, floats))


_Graph = tuple[nn.Module, dict[str, Tensor], str]
"""A module, inputs to trace it with, and its output's name."""


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
        raise RulesError(".onnx needs a library more: pip install 'fnnq_torchrl[onnx]'")
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
                output_names=[output],
                dynamo=True,
                verbose=False,
            )
    finally:
        log.setLevel(level)
    assert program is not None  # which it is with dynamo
    return {".onnx": program.model_proto.SerializeToString()}
