"""Q(s, a) as radial basis functions."""

from torch import Tensor

from .labels import LabelsValue


class RBFValue(LabelsValue):
    """The fuzzy network's labels without its normalisation: Q(s, a) = Σ w·Πⱼ μⱼ(sⱼ)·μ(a).

    Far from every Gaussian's centre Q is 0, where the fuzzy network has the nearest label's
    consequent.

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, log_degrees: Tensor) -> Tensor:
        return log_degrees.exp()
