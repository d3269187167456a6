"""What the two readings of step h do to the size of a learning step.

While the ball rolls, the robot sees nearly the same for many steps, so let it see and do the same,
(s, a), for long. With f = ∇Q(s, a) the decayed trace settles at

    γλe = f·γλ/(1 − γλ)            (gradient: each of the earlier steps added f)
    γλe = f/‖f‖²·γλ/(1 − γλ)       (output: each added f/‖f‖²)

and a greedy step, whose two errors are the same δ, moves Q(s, a) by f·αδ(γλe + f), which is δ times

    α‖f‖²/(1 − γλ)                 (gradient)
    α(‖f‖² + γλ/(1 − γλ))          (output)

In a table ‖f‖² = 1 and both are α/(1 − γλ). At an end, whose target stays where it is, a step
beyond 1 overshoots it, and one beyond 2 leaves Q farther off than it was. Rules that overlap share
the firing strength, so ‖f‖² is small: the earlier pairs, not the present one, make the step under
``output``.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from fnnq_torchrl.equations.membership import firing_shares, rule_width

Labels = Sequence[Sequence[float]]


def squared_gradient(inputs: Sequence[tuple[Labels, Tensor]], width: str) -> Tensor:
    """‖f‖² of the fuzzy rule base, f = σᵢ/Σσ: the product of the inputs' own, Πⱼ Σ(μ/Σμ)².

    Args:
        inputs: the labels [centre, second number] of each input, the action's among them, and
            where to look, tensors that broadcast.
        width: whether the labels' second number is a ``sigma`` or a ``variance``.
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
    """The part of its error by which a step moves Q(s, a), after long at (s, a).

    Args:
        norm: ‖f‖².
        alpha: α.
        decay: γλ, below 1; broadcasts with ``norm``.
        trace: ``output`` or ``gradient``.

    Raises:
        ValueError: it is neither.
    """
    if trace not in ("output", "gradient"):
        raise ValueError(f"trace={trace!r}: must be output or gradient")
    if trace == "gradient":
        return alpha * norm / (1 - decay)
    return alpha * (norm + decay / (1 - decay))
