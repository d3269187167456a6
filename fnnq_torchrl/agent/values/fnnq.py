"""Q(s, a) as a fuzzy neural network (paper, section 2)."""

from torch import Tensor

from fnnq_torchrl.equations.membership import firing_shares

from .labels import LabelsValue


class FNNQValue(LabelsValue):
    """A zero-order Takagi–Sugeno rule base: every label of every input with every action label.

    «If bearing is S₁ … and action is A₁ then the value is w₁₁.» Membership is Gaussian with fixed
    centres and widths, the t-norm is the product, the defuzzifier the weighted average. Only the
    consequents learn: singletons w, all zero at the start (paper, eq. 6–9).

    Arguments and errors: as :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
    """

    def shares(self, x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
        return firing_shares(x, centres, inverse_widths)
