"""Gaussian membership and normalised firing strengths. The runs are always the last dimension."""

import math
from collections.abc import Sequence

import torch
from torch import Tensor


def log_membership(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """Log μ(x) = −(x − c)²/(2σ²), for every label of one input.

    Args:
        x: the input, ``[..., runs]``.
        centres: c, ``[labels]``.
        inverse_widths: 1/σ, ``[labels]``; a product is faster than a quotient.

    Returns:
        ``[labels, ..., runs]``.
    """
    per_label = (-1, *[1] * x.ndim)
    return -0.5 * ((x - centres.view(per_label)) * inverse_widths.view(per_label)).square()


def firing_shares(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """One input's share in the rules' normalised firing strengths: μᵢ(x) / Σμ(x).

    With every label of every input combined by the product t-norm, the strengths' sum factors, and
    so do the normalised strengths: σᵢ/Σσ = Πⱼ μᵢⱼ(xⱼ)/Σμ(xⱼ) (paper, eq. 7, 8). A softmax of the
    logarithms, so far from every centre it is the nearest label's and never 0/0.

    Args and result: as :func:`log_membership`; the labels' shares sum to one.
    """
    # Not torch.softmax: over the first dimension it shares even the smallest batch between threads,
    # which is slow, and cuts it amid vectors, so that the last bit depends on how many threads.
    strength = log_membership(x, centres, inverse_widths)
    strength = torch.exp(strength - strength.amax(0))
    return strength * strength.sum(0).reciprocal()


def crisp_shares(x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
    """All of a number to the label of its highest membership; on a border, half to either.

    Args and result: as :func:`log_membership`; the labels' shares sum to one.
    """
    strength = log_membership(x, centres, inverse_widths)
    highest = (strength == strength.amax(0)).to(x.dtype)
    return highest / highest.sum(0)


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
    """σ from the paper's second number, read as the ``sigma`` itself or as a ``variance`` σ²."""
    return math.sqrt(width) if reading == "variance" else width
