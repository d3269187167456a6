"""Q(s, a) as a sum of radial basis functions."""

from torch import Tensor

from .labels import LabelsValue


class RBFValue(LabelsValue):
    """The labels as radial basis functions, not normalised: Q(s, a) = Σ w·Πⱼ μⱼ(sⱼ)·μ(a).

    Far from every centre Q is 0. The fuzzy network instead has the nearest rule's consequent there.

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, log_degrees: Tensor) -> Tensor:
        return log_degrees.exp()
