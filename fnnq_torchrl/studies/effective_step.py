"""The size of a learning step under the two readings of step h of the paper's Table 1.

Step h adds the present pair (s, a) to the trace e. With f = ∇Q(s, a) it adds f under the reading
``gradient``, and f/‖f‖² under ``output``.

While the ball rolls, the robot sees nearly the same for many steps. Suppose that every step is at
the same pair (s, a). Then the decayed trace settles at

    γλe = f·γλ/(1 − γλ)            (gradient)
    γλe = f/‖f‖²·γλ/(1 − γλ)       (output)

The two errors of a greedy step are equal. With an error δ the step moves Q(s, a) by
f·αδ(γλe + f). This is δ times the *effective step size*:

    α‖f‖²/(1 − γλ)                 (gradient)
    α(‖f‖² + γλ/(1 − γλ))          (output)

In a table ‖f‖² = 1, and both are α/(1 − γλ). In the last step of a situation the target of Q is
fixed: an effective step size above 1 overshoots it, and one above 2 leaves Q farther from it than
before. Rules that overlap share the firing strength, so ‖f‖² is small. Then under ``output`` most
of the step comes from the earlier pairs, not from the present one.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from fnnq_torchrl.equations.membership import firing_shares
from fnnq_torchrl.equations.membership_functions import rule_width

Labels = Sequence[Sequence[float]]


def squared_gradient(inputs: Sequence[tuple[Labels, Tensor]], width: str) -> Tensor:
    """The squared norm ‖f‖² of the fuzzy rule base's gradient, the firing shares f = σᵢ/Σσ.

    It is a product over the inputs j: ‖f‖² = Πⱼ Σ(μ/Σμ)², summed over the labels of input j.

    Args:
        inputs: for each input, the action included, its labels [centre, second number] and the
            points at which to evaluate ‖f‖². The points' tensors broadcast.
        width: the meaning of the labels' second number, ``sigma`` or ``variance``.

    Returns:
        ‖f‖² at the points, in their broadcast shape.
    """
    factors = []
    for labels, x in inputs:
        centres = x.new_tensor([centre for centre, _ in labels])
        inverse_widths = x.new_tensor([1 / rule_width(second, width) for _, second in labels])
        factors.append(firing_shares(x, centres, inverse_widths).square().sum(0))
    product = torch.ones_like(factors[0])
    for factor in factors:
        product = product * factor
    return product


def effective_step(norm: Tensor, alpha: float, decay: Tensor, trace: str) -> Tensor:
    """The effective step size: the share of the error by which a step moves Q(s, a).

    The trace has settled: all earlier steps were at (s, a) too.

    Args:
        norm: the squared norm ‖f‖² of the gradient at (s, a).
        alpha: the step size α.
        decay: the decay γλ of the trace, below 1; broadcasts with ``norm``.
        trace: the reading of step h, ``output`` or ``gradient``.

    Raises:
        ValueError: if ``trace`` is neither of the two.
    """
    if trace not in ("output", "gradient"):
        raise ValueError(f"trace={trace!r}: must be output or gradient")
    if trace == "gradient":
        return alpha * norm / (1 - decay)
    return alpha * (norm + decay / (1 - decay))
