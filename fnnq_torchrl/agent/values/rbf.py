"""Q(s, a) as radial basis functions."""

from torch import Tensor

from fnnq_torchrl.equations.membership import log_membership

from .labels import LabelsValue


class RBFValue(LabelsValue):
    """The fuzzy network's Gaussians without its normalisation: Q(s, a) = Σ w·Πⱼ μⱼ(sⱼ)·μ(a).

    Far from every centre Q is 0, where the fuzzy network has the nearest label's consequent.

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
        return log_membership(x, centres, inverse_widths).exp()
