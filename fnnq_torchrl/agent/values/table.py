"""Q(s, a) as a look-up table (paper, section 2: what the fuzzy network stands in for)."""

from torch import Tensor

from fnnq_torchrl.equations.membership import crisp

from .labels import LabelsValue


class TableValue(LabelsValue):
    """A cell for every label of every input with every action label; labels are crisp.

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, log_degrees: Tensor) -> Tensor:
        return crisp(log_degrees)
