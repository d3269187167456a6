"""The size of a learning step under the two readings of step h.

While the ball rolls, the robot sees nearly the same for many steps. Suppose that it sees and does
exactly the same, (s, a), for long. With f = ∇Q(s, a) the decayed trace settles at

    γλe = f·γλ/(1 − γλ)            (gradient: each of the earlier steps added f)
    γλe = f/‖f‖²·γλ/(1 − γλ)       (output: each added f/‖f‖²)

and a greedy step, whose two errors are the same δ, moves Q(s, a) by f·αδ(γλe + f), which is δ times

    α‖f‖²/(1 − γλ)                 (gradient)
    α(‖f‖² + γλ/(1 − γλ))          (output)

In a table ‖f‖² = 1, and both are α/(1 − γλ). The target of a situation's last step doesn't move. A
last step beyond 1 overshoots its target, and one beyond 2 leaves Q farther off than it was. Rules
that overlap share the firing strength, so ‖f‖² is small. So under ``output`` most of the step comes
from the earlier pairs, not from the present one.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from fnnq_torchrl.equations.membership import firing_shares
from fnnq_torchrl.equations.membership_functions import rule_width

Labels = Sequence[Sequence[float]]


def squared_gradient(inputs: Sequence[tuple[Labels, Tensor]], width: str) -> Tensor:
    """‖f‖² of the fuzzy rule base, with f = σᵢ/Σσ: the product over its inputs, Πⱼ Σ(μ/Σμ)².

    Args:
        inputs: for each input, the action included, its labels [centre, second number] and the
            points at which to evaluate. The points' tensors broadcast.
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
    """The share of its error by which a step moves Q(s, a), after a long time at (s, a).

    Args:
        norm: ‖f‖².
        alpha: the step size α.
        decay: γλ, below 1; broadcasts with ``norm``.
        trace: the reading of step h, ``output`` or ``gradient``.

    Raises:
        ValueError: ``trace`` is neither.
    """
    if trace not in ("output", "gradient"):
        raise ValueError(f"trace={trace!r}: must be output or gradient")
    if trace == "gradient":
        return alpha * norm / (1 - decay)
    return alpha * (norm + decay / (1 - decay))
