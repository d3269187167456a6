"""SwiftTD and Swift-Sarsa: true online learning with a step size for each weight.

The runs are the last dimension. Sources: K. Javed, A. Sharifnassab, R. S. Sutton, "SwiftTD: a fast
and robust algorithm for temporal difference learning", RLC 2024; K. Javed, R. S. Sutton,
"Swift-Sarsa: fast and robust linear control", arXiv 2507.19539, 2025, algorithm 1, which is SwiftTD
with the features of state and action.

The listing perceives features first and a reward afterwards, so a pass through its loop finishes
the step before and begins the next. A learning step here begins with the features of (s, a) and
ends with the reward: it is the second half of one pass and the first half of the next. The listing
goes on for ever; here the traces are set to 0 at the end of an episode, as in true online Sarsa(λ),
and h, the memory of the weights' changes, stays, as the weights do.

The authors' program, PyPI's ``swifttd``, differs from the listing. Its versions for sparse features
set h and z̄ to 0 before they use them, not afterwards, and cut traces that are small beside their
step size. Its version for all features sets h and z̄ of every weight to 0, also of those whose
feature is 0, and updates weights whose trace is 0. All compare α instead of ln α with ln η_min, so
that the lower limit has no effect.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from fnnq_torchrl.equations.traces import Credited

from .base import Numbers, State, Step, Stepped, StepSize, filled, mean, total


class Swift(StepSize):
    """A step size for each weight by :func:`swift`, for Sarsa(λ) with the dutch trace.

    The trace contains the step sizes, so Δw isn't multiplied by them once more.
    """

    numbers = ("meta_step_size", "eta", "eta_min", "eta_decay")

    def start(self, alpha: Tensor, weights: Sequence[Tensor]) -> State:
        zeros = {name: [torch.zeros_like(w) for w in weights] for name in _STATE}
        return {**zeros, "log_alpha": filled(alpha.log(), weights)}

    def update(self, alpha: Tensor, numbers: Numbers, state: State, step: Step) -> Stepped:
        credit = step.credit
        if credit.correction is None:
            raise ValueError("swift needs Sarsa(λ) with a dutch trace")
        change, goes_on = credit.correction.change, credit.goes_on
        credited, state = swift(
            state, step.traces, step.gradients, credit.decay, step.error, change, numbers
        )
        credited = [(direction, goes_on * z) for direction, z in credited]
        traces = {
            name: [goes_on * x for x in state[name]] for name in ("memory_trace", "slope_trace")
        }
        alphas = [beta.exp() for beta in state["log_alpha"]]
        one = torch.ones_like(alpha)
        return Stepped(credited, [one] * len(credited), mean(alphas), {**state, **traces})


def swift(
    state: State,
    traces: Sequence[Tensor],
    features: Sequence[Tensor],
    decay: Tensor,
    error: Tensor,
    change: Tensor,
    numbers: Numbers,
) -> tuple[Credited, State]:
    """Return Δw and z for each tensor of weights, and the state, after a step of Swift-Sarsa.

        z, z̄, p ← γλz, γλz̄, γλp;   τ = Σ exp(β)φ²;   b = Σ zφ
        zᵟ = min(1, η/τ) exp(β)φ
        z ← z + zᵟ(1 − b);   p ← p + h_old φ;   z̄ ← z̄ + zᵟ(1 − b − z̄φ)
        h_temp = h − h_old φ(z − zᵟ) − hzᵟφ
        if τ > η, where φ isn't 0: h_temp, h_old, h, z̄ ← 0;   β ← β + φ² ln ε
        Δw = (δ′ + c)z − czᵟ;   (w ← w + Δw)
        where z isn't 0: β ← β + θδ′p/exp β, clipped to [ln η_min, ln η]
        and there: h_old ← h;   h ← h_temp + (δ′ + c)z̄ − czᵟ

    Here c = Q − Q_old, which the listing calls v^δ, and δ′ = r + γQ′ − Q; the listing's own δ′ is
    r + γQ′ − Q_old, which is δ′ + c here. The sums are over all weights.

    Args:
        state: tensors ``[*weights, runs]`` each: ``log_alpha`` β, ``memory`` h, ``last_memory``
            h_old, ``memory_trace`` z̄ and ``slope_trace`` p.
        traces: z after the last step, tensors ``[*weights, runs]``; it contains the step sizes.
        features: φ = ∇Q(s, a), shaped as z.
        decay: γλ, ``[runs]``.
        error: δ′, ``[runs]``.
        change: c, ``[runs]``; any number in the first step of an episode.
        numbers: ``meta_step_size`` θ, ``eta`` η, ``eta_min`` η_min and ``eta_decay`` ε, each
            ``[runs]``.
    """
    theta, eta = numbers["meta_step_size"], numbers["eta"]
    lowest, highest, fall = numbers["eta_min"].log(), eta.log(), numbers["eta_decay"].log()
    tensors = [*zip(*(state[name] for name in _STATE), traces, features, strict=True)]
    squares = [phi.square() for phi in features]
    rate = total([beta.exp() * x for beta, x in zip(state["log_alpha"], squares, strict=True)])
    share, above = eta / torch.maximum(rate, eta), rate > eta
    overlap = total([decay * z * phi for z, phi in zip(traces, features, strict=True)])

    credited: Credited = []
    kept: dict[str, list[Tensor]] = {name: [] for name in _STATE}
    for beta, h, h_old, z_bar, p, z, phi in tensors:
        added = share * beta.exp() * phi
        z_new = decay * z + added * (1 - overlap)
        p_new = decay * p + h_old * phi
        z_bar_new = decay * z_bar + added * (1 - overlap - decay * z_bar * phi)
        h_temp = h - h_old * phi * (z_new - added) - h * added * phi

        forgets, moves = above & (phi != 0), z_new != 0
        h_temp, h, h_old, z_bar_new = (
            torch.where(forgets, 0, x) for x in (h_temp, h, h_old, z_bar_new)
        )
        beta = torch.where(above, beta + fall * phi.square(), beta)

        credited.append(((error + change) * z_new - change * added, z_new))
        learned = beta + theta * error * p_new / beta.exp()
        clipped = torch.minimum(torch.maximum(learned, lowest), highest)
        kept["log_alpha"].append(torch.where(moves, clipped, beta))
        kept["last_memory"].append(torch.where(moves, h, h_old))
        h_new = h_temp + (error + change) * z_bar_new - change * added
        kept["memory"].append(torch.where(moves, h_new, h))
        kept["memory_trace"].append(z_bar_new)
        kept["slope_trace"].append(p_new)
    return credited, kept


_STATE = ("log_alpha", "memory", "last_memory", "memory_trace", "slope_trace")
