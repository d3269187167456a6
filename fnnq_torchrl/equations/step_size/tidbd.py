"""TIDBD and AutoTIDBD: IDBD and Autostep for temporal differences. The runs come last.

Source: A. Kearney, V. Veeriah, J. B. Travnik, P. M. Pilarski, R. S. Sutton, "Learning feature
relevance through step size adaptation in temporal-difference learning", arXiv 1903.03252, 2019.

Their learner steps along δz with the accumulating trace z = γλz + φ(s). Here Δw stands for δz,
which it is in all variants with one error; Peng's Q(λ) has two. The error whose square the step
sizes descend is δ′, that of the present pair.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from .autostep import normalised
from .base import Numbers, State, Step, Stepped, StepSize, filled, mean, total
from .idbd import IDBD


class TIDBD(IDBD):
    """A step size for each weight by :func:`tidbd`."""

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        theta, credited = numbers["meta_step_size"], step.credited()
        log_alpha, memory = [], []
        for beta, h, f, z, (direction, _) in zip(
            state["log_alpha"],
            state["memory"],
            step.gradients,
            step.present_trace(),
            credited,
            strict=True,
        ):
            new_beta, new_h = tidbd(beta, h, f, z, step.error, direction, theta)
            log_alpha.append(new_beta)
            memory.append(new_h)
        sizes = [beta.exp() for beta in log_alpha]
        return Stepped(credited, sizes, mean(sizes), {"log_alpha": log_alpha, "memory": memory})


def tidbd(
    log_alpha: Tensor,
    memory: Tensor,
    features: Tensor,
    trace: Tensor,
    error: Tensor,
    direction: Tensor,
    meta_step_size: Tensor,
) -> tuple[Tensor, Tensor]:
    """Return β = ln α and the memory h after a step of semi-gradient TIDBD(λ).

        β ← β + θδ′φh;   α = exp β;   (w ← w + αΔw);   h ← h[1 − αφz]₊ + αΔw

    With λ = 0 this is IDBD with the target r + γV(s′). Kearney et al. 2019, the algorithm
    "TIDBD(λ)" with the semi-gradient.

    Args:
        log_alpha: β, ``[*weights, runs]``.
        memory: h, shaped as β.
        features: φ = ∇Q(s, a), shaped as β.
        trace: z, the trace including the present pair, shaped as β.
        error: δ′, ``[runs]``.
        direction: Δw, shaped as β.
        meta_step_size: θ, ``[runs]``.
    """
    log_alpha = log_alpha + meta_step_size * error * features * memory
    alpha = log_alpha.exp()
    kept = (1 - alpha * features * trace).clamp(min=0)
    return log_alpha, memory * kept + alpha * direction


class AutoTIDBD(StepSize):
    """A step size for each weight by :func:`auto_tidbd`."""

    numbers = ("meta_step_size", "tau")

    def start(self, alpha: Tensor, weights: Sequence[Tensor]) -> State:
        return {
            "log_alpha": filled(alpha.log(), weights),
            "memory": [torch.zeros_like(w) for w in weights],
            "scale": [torch.zeros_like(w) for w in weights],
        }

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        credited = step.credited()
        state = auto_tidbd(
            state,
            step.gradients,
            step.error_slope(),
            step.present_trace(),
            step.error,
            [direction for direction, _ in credited],
            numbers["meta_step_size"],
            numbers["tau"],
        )
        sizes = [beta.exp() for beta in state["log_alpha"]]
        return Stepped(credited, sizes, mean(sizes), state)


def auto_tidbd(
    state: State,
    features: Sequence[Tensor],
    error_slope: Sequence[Tensor],
    trace: Sequence[Tensor],
    error: Tensor,
    direction: Sequence[Tensor],
    meta_step_size: Tensor,
    tau: Tensor,
) -> State:
    """Return β = ln α, the memory h and the scale η after a step of AutoTIDBD(λ).

        with d = γφ′ − φ, the slope of the error:
        η ← max(|δ′dh|, η − αdz(|δ′φh| − η)/τ), with the α of the last step
        β ← β − θδ′dh/η where η > 0
        β ← β − ln max(−Σ exp(β)dz, 1), the sum over all weights
        α = exp β;   (w ← w + αΔw);   h ← h[1 + αdz]₊ + αΔw

    Kearney et al. 2019, algorithm 6. The listing differs in two places from what is done here. It
    updates z after η and β, so that these see the trace of the last step; here they see z with
    the present pair, along which the weights change in this step. And the listing writes the bound,
    which comes from Autostep, with the index of a single weight. Here the sum stands, which is
    Autostep's: the share of the error that the step corrects.

    Args:
        state: ``log_alpha``, ``memory`` and ``scale``, tensors ``[*weights, runs]`` each.
        features: φ = ∇Q(s, a), tensors ``[*weights, runs]``.
        error_slope: d = ∇δ′, shaped as φ.
        trace: z, the trace including the present pair, shaped as φ.
        error: δ′, ``[runs]``.
        direction: Δw, shaped as φ.
        meta_step_size: θ, ``[runs]``.
        tau: τ, in updates of a weight whose −αdz is 1, ``[runs]``.
    """
    grown, scales = [], []
    for beta, h, eta, phi, d, z in zip(
        state["log_alpha"],
        state["memory"],
        state["scale"],
        features,
        error_slope,
        trace,
        strict=True,
    ):
        slope, present = error * d * h, (error * phi * h).abs()
        scale = torch.maximum(slope.abs(), eta - beta.exp() * d * z * (present - eta) / tau)
        grown.append(beta - meta_step_size * normalised(slope, scale))
        scales.append(scale)
    along = [d * z for d, z in zip(error_slope, trace, strict=True)]
    effective = -total([beta.exp() * dz for beta, dz in zip(grown, along, strict=True)])
    bound = effective.clamp(min=1).log()
    log_alpha = [beta - bound for beta in grown]
    memory = [
        h * (1 + beta.exp() * dz).clamp(min=0) + beta.exp() * change
        for beta, h, dz, change in zip(log_alpha, state["memory"], along, direction, strict=True)
    ]
    return {"log_alpha": log_alpha, "memory": memory, "scale": scales}
