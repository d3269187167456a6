"""Membership and normalised firing strengths. The runs are always the last dimension."""

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import accumulate

import torch
from torch import Tensor

from fnnq_torchrl.equations.membership_functions import MEMBERSHIP_FUNCTIONS

Label = tuple[str, Sequence[Tensor]]
"""A kind of membership function, of :data:`.MEMBERSHIP_FUNCTIONS`, and its parameters, scalars."""


def log_membership(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Log μ(x) = −(x − c)²/(2σ²), for every Gaussian label of one input.

    Args:
        x: the input, ``[..., runs]``.
        centres: c, ``[labels]`` or, where each run has its own, ``[labels, runs]``.
        inverse_widths: 1/σ, of the same shape; a product is faster than a quotient.

    Returns:
        ``[labels, ..., runs]``.
    """
    labels, *runs = centres.shape
    per_label = (labels, *[1] * (x.ndim - len(runs)), *runs)
    return -0.5 * ((x - centres.view(per_label)) * inverse_widths.view(per_label)).square()


def log_degrees(x: Tensor, labels: Sequence[Label], elsewhere: str = "nearest") -> Tensor:
    """Log μ(x), for every label of one input, of whatever kinds.

    Args:
        x: the input, ``[...]``.
        labels: at least one.
        elsewhere: with ``nearest``, the label whose support is nearest has degree 1 where none
            fires.

    Returns:
        ``[labels, ...]``; −∞ where a label doesn't fire.
    """
    of = [(MEMBERSHIP_FUNCTIONS[kind], parameters) for kind, parameters in labels]
    degrees = torch.stack([function.log_degree(x, *parameters) for function, parameters in of])
    if elsewhere == "zero" or not all(function.compact for function, _ in of):
        return degrees
    outside = [torch.maximum(first - x, x - last) for _, (first, *_, last) in of]
    numbers = torch.arange(len(labels), device=x.device).view(-1, *[1] * x.ndim)
    chosen = (degrees == -torch.inf).all(0) & (numbers == torch.stack(outside).argmin(0))
    return degrees.where(~chosen, 0)


def moved_labels(
    centres: Tensor,
    inverse_widths: Tensor,
    *,
    middle: Tensor,
    widths: Tensor,
    least_width: float,
    gaps: Tensor | None = None,
) -> tuple[Tensor, Tensor]:
    """Gaussian labels moved from where they were, in their order and none too narrow.

        cᵢ₊₁ − cᵢ = (cᵢ₊₁⁰ − cᵢ⁰)·exp(gapᵢ),   mean of c = mean of c⁰ + (mean of σ⁰)·middle
        σᵢ = σᵢ⁰·(least + (1 − least)·exp(widthᵢ))

    Args:
        centres: c⁰, ``[labels]``.
        inverse_widths: 1/σ⁰, ``[labels]``.
        middle: ``[1, runs]``.
        widths: ``[labels, runs]``.
        least_width: the least share of its σ⁰ that a width has, in (0, 1].
        gaps: ``[labels − 1, runs]``; None of a single label.

    Returns:
        The centres and the inverses of the widths, each ``[labels, runs]``.
    """
    steps = [] if gaps is None else (centres.diff().unsqueeze(-1) * gaps.exp()).unbind(0)
    places = torch.stack([*accumulate(steps, initial=torch.zeros_like(middle[0]))])
    centre = centres.mean() + inverse_widths.reciprocal().mean() * middle
    widened = least_width + (1 - least_width) * widths.exp()
    return centre + places - places.mean(0), inverse_widths.unsqueeze(-1) / widened


def normalised(log_degrees: Tensor) -> Tensor:
    """One input's share in the rules' normalised firing strengths: μᵢ(x) / Σμ(x).

    With every label of every input combined by the product t-norm, the strengths' sum factors, and
    so do the normalised strengths: σᵢ/Σσ = Πⱼ μᵢⱼ(xⱼ)/Σμ(xⱼ) (paper, eq. 7, 8). A softmax of the
    logarithms, so far from every centre it is the nearest label's and never 0/0.

    Args:
        log_degrees: log μ(x), ``[labels, ..., runs]``, one of them above −∞.

    Returns:
        Of the same shape; the labels' shares sum to one.
    """
    # Not torch.softmax: over the first dimension it shares even the smallest batch between threads,
    # which is slow, and cuts it amid vectors, so that the last bit depends on how many threads.
    strength = torch.exp(log_degrees - log_degrees.amax(0))
    return strength * strength.sum(0).reciprocal()


def firing_shares(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """The normalised memberships of Gaussian labels.

    Args and result: as :func:`log_membership`; the labels' shares sum to one.
    """
    return normalised(log_membership(x, centres, inverse_widths))


def crisp(log_degrees: Tensor) -> Tensor:
    """All of a number to the label of its highest membership; on a border, half to either.

    Args and result: as :func:`normalised`.
    """
    highest = (log_degrees == log_degrees.amax(0)).to(log_degrees.dtype)
    return highest / highest.sum(0)


def zero_where_silent(shares: Callable[[Tensor], Tensor], log_degrees: Tensor) -> Tensor:
    """The labels' shares, all of them 0 where no label fires.

    Args:
        shares: as :func:`normalised`.
        log_degrees: log μ(x), ``[labels, ..., runs]``.
    """
    fires = log_degrees.amax(0) > -torch.inf
    return shares(log_degrees.where(fires, 0)) * fires


def defuzzify(consequents: Tensor, shares: Sequence[Tensor], action_shares: Tensor) -> Tensor:
    """Q(s, a) = Σᵢ wᵢσᵢ / Σσ, the weighted average of the consequents (paper, eq. 8).

    Sums over one input's labels after the other: with few labels that's far less work than over
    all rules, and the order of summation does not depend on the batch.

    Args:
        consequents: w, ``[labels of input 1, …, labels of input n, action labels, *bases, runs]``;
            there may be several rule bases, or, with ``bases = ()``, a single one.
        shares: for each state input, its labels' shares ``[labels, *batch, *bases, runs]``.
        action_shares: ``[action labels, actions, *batch or 1s, *bases, runs or 1]``.

    Returns:
        Q of every action, ``[actions, *batch, *bases, runs]``.
    """
    labels, own = consequents.shape[: len(shares) + 1], consequents.shape[len(shares) + 1 :]
    batch = action_shares.ndim - 2 - len(own)
    rules = consequents.reshape(*labels, *[1] * batch, *own)
    for share in shares:
        labels_left = rules.ndim - share.ndim
        rules = (share.view(share.shape[0], *[1] * labels_left, *share.shape[1:]) * rules).sum(0)
    return (rules.unsqueeze(1) * action_shares).sum(0)


def weighted_minima(
    consequents: Tensor, log_degrees: Sequence[Tensor], action_log_degrees: Tensor
) -> Tensor:
    """Q(s, a) = Σ wᵢσᵢ / Σσ with the minimum t-norm, σᵢ = minⱼ μᵢⱼ(xⱼ), over all rules.

    The strengths' sum doesn't factor, as it does with the product. All strengths are taken relative
    to that of the strongest rule, so far from every centre nothing is 0/0. Q is 0 where no rule
    fires.

    Args:
        consequents: w, ``[labels of input 1, …, labels of input n, action labels, runs]``.
        log_degrees: for each state input, its labels' log μ, ``[labels, *batch, runs]``.
        action_log_degrees: ``[action labels, actions, *batch or 1s, runs or 1]``.

    Returns:
        Q of every action, ``[actions, *batch, runs]``.
    """
    logs = [*(log.unsqueeze(1) for log in log_degrees), action_log_degrees]
    # The strongest rule is as strong as the weakest of the inputs' highest memberships.
    peak = reduce(torch.minimum, [log.amax(0) for log in logs])
    peak = peak.where(peak > -torch.inf, 0)
    first, *others = [(log - peak).clamp(max=0).exp() for log in logs]
    strengths = reduce(lambda rule, of: rule.unsqueeze(-of.ndim).minimum(of), others, first)
    *labels, runs = consequents.shape
    weights = consequents.reshape(*labels, *[1] * (peak.ndim - 1), runs)
    rules = [*range(len(labels))]
    total = strengths.sum(rules)
    return (strengths * weights).sum(rules) / total.where(total > 0, 1)
