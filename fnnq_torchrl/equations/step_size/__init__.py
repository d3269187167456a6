"""Rules for the step size α, of a run or of each weight. The runs are the last dimension."""

from .autostep import Autostep, autostep
from .base import Numbers, State, Step, Stepped, StepSize, decayed
from .bounded import AlphaBound, ObGD, alpha_bound, obgd
from .idbd import IDBD, idbd
from .swift import Swift, swift
from .tidbd import TIDBD, AutoTIDBD, auto_tidbd, tidbd

__all__ = [
    "IDBD",
    "STEP_SIZES",
    "TIDBD",
    "AlphaBound",
    "AutoTIDBD",
    "Autostep",
    "Numbers",
    "ObGD",
    "State",
    "Step",
    "StepSize",
    "Stepped",
    "Swift",
    "alpha_bound",
    "auto_tidbd",
    "autostep",
    "decayed",
    "idbd",
    "make_step_size",
    "obgd",
    "swift",
    "tidbd",
]

STEP_SIZES: dict[str, type[StepSize]] = {
    "decay": StepSize,
    "constant": StepSize,  # with a decay of 1
    "obgd": ObGD,
    "alpha_bound": AlphaBound,
    "idbd": IDBD,
    "autostep": Autostep,
    "tidbd": TIDBD,
    "auto_tidbd": AutoTIDBD,
    "swift": Swift,
}
"""The step sizes by their names (:data:`fnnq_torchrl.equations.names.STEP_SIZES`)."""


def make_step_size(name: str) -> StepSize:
    """Return the step size with the given name.

    Raises:
        ValueError: if there is no such step size.
    """
    if name not in STEP_SIZES:
        *others, last = STEP_SIZES
        raise ValueError(f"step_size={name!r}: must be {', '.join(others)} or {last}")
    return STEP_SIZES[name]()
