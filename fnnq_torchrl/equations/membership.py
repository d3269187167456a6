"""Gaussian membership and normalised firing strengths. The runs are always the last dimension."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor


def log_membership(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Return log μ(x) = −(x − c)²/(2σ²) for every label of one input.

    Args:
        x: the input, ``[..., runs]``.
        centres: c, ``[labels]``.
        inverse_widths: 1/σ, ``[labels]``; multiplying is faster than dividing.

    Returns:
        ``[labels, ..., runs]``.
    """
    per_label = (-1, *[1] * x.ndim)
    return -0.5 * ((x - centres.view(per_label)) * inverse_widths.view(per_label)).square()


def firing_shares(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Return the normalised membership of one input in its labels, μᵢ(x) / Σμ(x).

    The rules combine every label of every input by the product t-norm. So the normalised firing
    strength of a rule is the product of its labels' shares: σᵢ/Σσ = Πⱼ μᵢⱼ(xⱼ)/Σμ(xⱼ) (paper,
    eq. 7, 8). The softmax of log μ avoids 0/0 far from every centre; the nearest label gets 1.

    Args and result: as :func:`log_membership`; the shares of all labels sum to 1.
    """
    # Not torch.softmax: along the first dimension it splits even the smallest batch among threads,
    # which is slow. It also splits within vectors, so the last bit depends on the thread count.
    strength = log_membership(x, centres, inverse_widths)
    strength = torch.exp(strength - strength.amax(0))
    return strength * strength.sum(0).reciprocal()


def crisp_shares(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Return 1 for the label with the highest membership and 0 for the others; ties share the 1.

    Args and result: as :func:`log_membership`; the shares of all labels sum to 1.
    """
    strength = log_membership(x, centres, inverse_widths)
    highest = (strength == strength.amax(0)).to(x.dtype)
    return highest / highest.sum(0)


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
    """The consequents of each action label in a state, Σ over the states' labels of w times shares.

    Args:
        consequents, shares: as of :func:`defuzzify`.
        batch: how many dimensions the shares' batch has.

    Returns:
        ``[action labels, *batch, *bases, runs]``.
    """
    labels, own = consequents.shape[: len(shares) + 1], consequents.shape[len(shares) + 1 :]
    rules = consequents.reshape(*labels, *[1] * batch, *own)
    for share in shares:
        labels_left = rules.ndim - share.ndim
        rules = (share.view(share.shape[0], *[1] * labels_left, *share.shape[1:]) * rules).sum(0)
    return rules


def rule_width(width: float, reading: str) -> float:
    """Return σ from a label's second number, which is σ (``sigma``) or σ² (``variance``)."""
    return math.sqrt(width) if reading == "variance" else width
