"""Memberships, firing strengths and defuzzification; the runs are always the last dimension."""

from collections.abc import Callable, Sequence
from functools import reduce
from itertools import accumulate

import torch
from torch import Tensor

from fnnq_torchrl.equations.membership_functions import MEMBERSHIP_FUNCTIONS

Label = tuple[str, Sequence[Tensor]]
"""A membership function: a key of :data:`.MEMBERSHIP_FUNCTIONS`, and its parameters as scalars."""


def log_membership(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Return log μ(x) = −(x − c)²/(2σ²) for every Gaussian label of one input.

    Args:
        x: the input, ``[..., runs]``.
        centres: c, ``[labels]``, or ``[labels, runs]`` if each run has its own.
        inverse_widths: 1/σ, of the same shape; multiplying is faster than dividing.

    Returns:
        ``[labels, ..., runs]``.
    """
    labels, *runs = centres.shape
    per_label = (labels, *[1] * (x.ndim - len(runs)), *runs)
    return -0.5 * ((x - centres.view(per_label)) * inverse_widths.view(per_label)).square()


def log_degrees(x: Tensor, labels: Sequence[Label], elsewhere: str = "nearest") -> Tensor:
    """Return log μ(x) for every label of one input; the labels may be of any kinds.

    Args:
        x: the input, ``[...]``.
        labels: at least one.
        elsewhere: with ``nearest``, the label with the nearest support has degree 1 for an x at
            which no label fires; with ``zero``, none has.

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
    """Return Gaussian labels moved by unbounded parameters that keep their order and a least width.

        cᵢ₊₁ − cᵢ = (cᵢ₊₁⁰ − cᵢ⁰)·exp(gapᵢ),   mean of c = mean of c⁰ + (mean of σ⁰)·middle
        σᵢ = σᵢ⁰·(least + (1 − least)·exp(widthᵢ))

    Args:
        centres: c⁰, ``[labels]``.
        inverse_widths: 1/σ⁰, ``[labels]``.
        middle: the shift of all labels, ``[1, runs]``.
        widths: the change of each width, ``[labels, runs]``.
        least_width: ``least``, the least width as a share of σ⁰, in (0, 1].
        gaps: the change of each distance, ``[labels − 1, runs]``; None for a single label.

    Returns:
        The centres and the inverses of the widths, each ``[labels, runs]``.
    """
    steps = [] if gaps is None else (centres.diff().unsqueeze(-1) * gaps.exp()).unbind(0)
    places = torch.stack([*accumulate(steps, initial=torch.zeros_like(middle[0]))])
    centre = centres.mean() + inverse_widths.reciprocal().mean() * middle
    widened = least_width + (1 - least_width) * widths.exp()
    return centre + places - places.mean(0), inverse_widths.unsqueeze(-1) / widened


def normalised(log_degrees: Tensor) -> Tensor:
    """Return the normalised membership of one input in its labels, μᵢ(x) / Σμ(x).

    The rules combine every label of every input by the product t-norm. So the normalised firing
    strength of a rule is the product of its labels' shares: σᵢ/Σσ = Πⱼ μᵢⱼ(xⱼ)/Σμ(xⱼ) (paper,
    eq. 7, 8). The softmax of log μ avoids 0/0 far from every centre; the nearest label gets 1.

    Args:
        log_degrees: log μ(x), ``[labels, ..., runs]``, at least one of them above −∞.

    Returns:
        Shares of the same shape, which sum to 1 over the labels.
    """
    # Not torch.softmax: along the first dimension it splits even the smallest batch among threads,
    # which is slow. It also splits within vectors, so the last bit depends on the thread count.
    strength = torch.exp(log_degrees - log_degrees.amax(0))
    return strength * strength.sum(0).reciprocal()


def firing_shares(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Return the normalised memberships of one input in Gaussian labels.

    Arguments and shape of the result as in :func:`log_membership`; the shares sum to 1.
    """
    return normalised(log_membership(x, centres, inverse_widths))


def crisp(log_degrees: Tensor) -> Tensor:
    """Return 1 for the label with the highest membership and 0 for the others; ties share the 1.

    Arguments and result as in :func:`normalised`.
    """
    highest = (log_degrees == log_degrees.amax(0)).to(log_degrees.dtype)
    return highest / highest.sum(0)


def zero_where_silent(shares: Callable[[Tensor], Tensor], log_degrees: Tensor) -> Tensor:
    """Return the labels' shares, all 0 for inputs at which no label fires.

    Args:
        shares: the function from log degrees to shares, such as :func:`normalised`.
        log_degrees: log μ(x), ``[labels, ..., runs]``.
    """
    fires = log_degrees.amax(0) > -torch.inf
    return shares(log_degrees.where(fires, 0)) * fires


def combined(shares: Sequence[Tensor]) -> Tensor:
    """Return every state rule's normalised firing strength, the product of its labels' shares.

    Args:
        shares: for each state input, the shares of its labels, ``[labels, *batch, runs]``.

    Returns:
        ``[rules, *batch, runs]``; the last input's label changes fastest.
    """

    def joined(strengths: Tensor, share: Tensor) -> Tensor:
        return (strengths.unsqueeze(1) * share).flatten(0, 1)

    return reduce(joined, shares)


def defuzzify(consequents: Tensor, shares: Sequence[Tensor], action_shares: Tensor) -> Tensor:
    """Return Q(s, a) = Σᵢ wᵢσᵢ / Σσ, the weighted average of the consequents (paper, eq. 8).

    Summing over the labels of one input after another is far less work than one sum over all
    rules, and makes the order of the sums independent of the batch.

    Args:
        consequents: w, ``[labels of input 1, …, labels of input n, action labels, *bases, runs]``;
            ``bases`` is ``()`` for a single rule base.
        shares: for each state input, the shares of its labels, ``[labels, *batch, *bases, runs]``.
        action_shares: the shares of the action labels,
            ``[action labels, actions, *batch or 1s, *bases, runs or 1]``.

    Returns:
        Q of every action, ``[actions, *batch, *bases, runs]``.
    """
    batch = action_shares.ndim - 1 - (consequents.ndim - len(shares))
    rules = weighed(consequents, shares, batch)
    return (rules.unsqueeze(1) * action_shares).sum(0)


def weighed(consequents: Tensor, shares: Sequence[Tensor], batch: int) -> Tensor:
    """Return each action label's consequent in a state, weighted by the state labels' shares.

    Args:
        consequents, shares: as in :func:`defuzzify`.
        batch: the number of dimensions of the shares' batch.

    Returns:
        ``[action labels, *batch, *bases, runs]``.
    """
    labels, own = consequents.shape[: len(shares) + 1], consequents.shape[len(shares) + 1 :]
    rules = consequents.reshape(*labels, *[1] * batch, *own)
    for share in shares:
        labels_left = rules.ndim - share.ndim
        rules = (share.view(share.shape[0], *[1] * labels_left, *share.shape[1:]) * rules).sum(0)
    return rules


def weighted_minima(
    consequents: Tensor, log_degrees: Sequence[Tensor], action_log_degrees: Tensor
) -> Tensor:
    """Return Q(s, a) = Σ wᵢσᵢ / Σσ with the minimum t-norm, σᵢ = minⱼ μᵢⱼ(xⱼ), over all rules.

    Unlike with the product, the sum of the strengths doesn't factor. All strengths are divided by
    that of the strongest rule, which avoids 0/0 far from every centre. Q is 0 if no rule fires.

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
