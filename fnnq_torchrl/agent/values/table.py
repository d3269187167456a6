"""Q(s, a) as a look-up table, which the fuzzy network replaces (paper, section 2)."""

from torch import Tensor

from fnnq_torchrl.equations.membership import crisp

from .labels import LabelsValue


class TableValue(LabelsValue):
    """A table with a cell for every combination of the inputs' and the action's crisp labels.

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, log_degrees: Tensor) -> Tensor:
        return crisp(log_degrees)
