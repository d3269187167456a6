"""IDBD: a step size for each weight, learned by gradient descent. The runs are the last dimension.

Source: R. S. Sutton, "Adapting bias by gradient descent: an incremental version of
delta-bar-delta", AAAI 1992, figure 2. IDBD learns a target from linear features. Here the target is
r + γV(s′) and the features are f = ∇Q(s, a). With λ = 0 this is the paper's algorithm. With traces,
the weights also change along the trace, of which the step sizes know nothing; :mod:`.tidbd` has the
algorithm for traces.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from .base import Numbers, State, Step, Stepped, StepSize, filled, mean


class IDBD(StepSize):
    """A step size for each weight by :func:`idbd`."""

    numbers = ("meta_step_size",)

    def start(self, alpha: Tensor, weights: Sequence[Tensor]) -> State:
        return {
            "log_alpha": filled(alpha.log(), weights),
            "memory": [torch.zeros_like(w) for w in weights],
        }

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        theta = numbers["meta_step_size"]
        tensors = zip(state["log_alpha"], state["memory"], step.gradients, strict=True)
        updated = [idbd(beta, h, f, step.error, theta) for beta, h, f in tensors]
        log_alpha, memory = map(list, zip(*updated, strict=True))
        sizes = [beta.exp() for beta in log_alpha]
        state = {"log_alpha": log_alpha, "memory": memory}
        return Stepped(step.credited(), sizes, mean(sizes), state)


def idbd(
    log_alpha: Tensor, memory: Tensor, features: Tensor, error: Tensor, meta_step_size: Tensor
) -> tuple[Tensor, Tensor]:
    """Return β = ln α and the memory h after a step, for a tensor of weights.

        β ← β + θδxh;   α = exp β;   (w ← w + αδx);   h ← h[1 − αx²]₊ + αδx

    h is a decaying trace of the weight's recent changes. If the present change has their sign,
    the step size was too small, so it grows. Sutton 1992, figure 2.

    Args:
        log_alpha: β, ``[*weights, runs]``.
        memory: h, shaped as β.
        features: x, shaped as β.
        error: δ, the error of the prediction, ``[runs]``.
        meta_step_size: θ, ``[runs]``.
    """
    log_alpha = log_alpha + meta_step_size * error * features * memory
    alpha = log_alpha.exp()
    kept = (1 - alpha * features.square()).clamp(min=0)
    return log_alpha, memory * kept + alpha * error * features
