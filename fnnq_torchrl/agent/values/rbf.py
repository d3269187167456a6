"""Q(s, a) as a sum of radial basis functions."""

from torch import Tensor

from fnnq_torchrl.equations.membership import log_membership

from .labels import LabelsValue


class RBFValue(LabelsValue):
    """Gaussian radial basis functions, not normalised: Q(s, a) = Σ w·Πⱼ μⱼ(sⱼ)·μ(a).

    Far from every centre Q is 0. The fuzzy network instead has the nearest rule's consequent there.

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
        return log_membership(x, centres, inverse_widths).exp()
