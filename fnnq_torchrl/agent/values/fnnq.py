"""Q(s, a) as a fuzzy neural network (paper, section 2)."""

from torch import Tensor

from fnnq_torchrl.equations.membership import firing_shares

from .labels import LabelsValue


class FNNQValue(LabelsValue):
    """A zero-order Takagi–Sugeno rule base, with a rule for every combination of labels.

    «If bearing is S₁ … and action is A₁ then the value is w₁₁.» Membership is Gaussian with fixed
    centres and widths, the t-norm is the product, and the defuzzifier is the weighted average. Only
    the consequents w learn; they are singletons and start at zero (paper, eq. 6–9).

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
        return firing_shares(x, centres, inverse_widths)
