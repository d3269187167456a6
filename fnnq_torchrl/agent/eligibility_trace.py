"""The trace of Q(λ), kept in a network like the one for Q, as a hook on the loss."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import torch
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.equations import q_lambda
from fnnq_torchrl.equations.exploration import is_greedy
from fnnq_torchrl.equations.layout import per_run, run_numbers, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule

if TYPE_CHECKING:  # it imports all of TorchRL's collectors
    from torchrl.trainers import Trainer

Weights = Mapping[str, Tensor]


def no_trace(rule: Rule, weights: Weights) -> dict[str, Tensor]:
    """The trace before the first step, by the weights' names, with the runs first."""
    return {name: runs_first(rule.no_trace(runs_last(w))) for name, w in weights.items()}


def credit_weights(
    rule: Rule,
    trace: Weights,
    gradient: Weights,
    td_error: Tensor,
    chosen_td_error: Tensor,
    decay: Tensor,
    greedy: Tensor | None,
    done: Tensor,
) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """:func:`fnnq_torchrl.equations.q_lambda.credit_all` for the weights of a network.

    Args:
        rule: which Q(λ) it is.
        trace: e by the weights' names, as :func:`no_trace` has it.
        gradient: ∇Q(s, a) by the weights' names, each ``[runs, *weights]``.
        td_error, chosen_td_error, decay, done: δ, δ′, γλ and the end, each ``[runs, 1]``.
        greedy: of :func:`greedy_steps`.

    Returns:
        Δw and the new trace, by name, with the runs first.
    """
    credited = q_lambda.credit_all(
        rule,
        [runs_last(trace[name]) for name in gradient],
        [runs_last(slope) for slope in gradient.values()],
        per_run(td_error),
        per_run(chosen_td_error),
        per_run(decay),
        greedy,
        per_run(done).logical_not().to(td_error.dtype),
    )
    pairs = zip(gradient, credited, strict=True)
    directions, traces = {}, {}
    for name, (direction, after) in pairs:
        directions[name], traces[name] = runs_first(direction), runs_first(after)
    return directions, traces


def greedy_steps(
    rule: Rule, action_value: Tensor, candidates: Tensor, action: Tensor
) -> Tensor | None:
    """Where the action was greedy, for a rule that cuts the trace elsewhere.

    Args:
        rule: which Q(λ) it is.
        action_value: Q of the candidates, ``[runs, candidates]``.
        candidates: ``[candidates]``.
        action: ``[runs, 1]``.

    Returns:
        1 or 0, ``[runs]``; nothing for a rule that needn't know.
    """
    if rule.variant != "watkins":
        return None
    return is_greedy(action_value.movedim(-1, 0), candidates, per_run(action))


class EligibilityTrace:
    """The trace of Q(λ), kept in a network like the one for Q, as a hook on the loss.

    Between the loss and the optimiser it turns the loss into −⟨Δw, w⟩ with Δw = δe + δ′∇Q(s, a),
    whose gradient is −Δw: plain SGD with the step size α then does Table 1's f and g, and the hook
    has done e and h. One call per step of the world, in order::

        losses = trace(batch, loss(batch))
        losses["loss"].backward()
        optimizer.step()

    or, in TorchRL's Trainer, ``trace.register(trainer)``.

    Args:
        loss: whose value network's weights have the runs as their first dimension.
        lam: λ, one number or one per run, ``[runs, 1]``.
        rule: which Q(λ) it is; the paper's unless given.

    Raises:
        ValueError: λ has another shape.
    """

    def __init__(
        self, loss: PengQLambdaLoss, lam: Tensor | float, rule: Rule | None = None
    ) -> None:
        self.loss = loss
        self.lam = run_numbers("lam", lam, like=loss.gamma)
        self.rule = rule or Rule()
        weights = {name: w.detach() for name, w in loss.value_network.named_parameters()}
        self.trace = no_trace(self.rule, weights)

    def __call__(self, batch: TensorDictBase, losses: TensorDictBase) -> TensorDictBase:
        """The losses with the trace's share in ``loss``; the trace moves on by this step.

        Args:
            batch: one step of every run, ``[runs]`` or, from a collector, ``[runs, 1]``.
            losses: what the loss returned for it.

        Raises:
            ValueError: there is more than one step of a run in the batch.
        """
        runs, keys = len(batch), self.loss.tensor_keys
        if batch.numel() != runs:
            raise ValueError(f"batch of shape {list(batch.shape)}: must be one step of every run")
        network = self.loss.value_network
        weights = dict(network.named_parameters())
        slopes = torch.autograd.grad(losses[keys.chosen_action_value].sum(), list(weights.values()))
        directions, self.trace = credit_weights(
            self.rule,
            self.trace,
            dict(zip(weights, slopes, strict=True)),
            losses[keys.td_error].view(runs, 1),
            losses[keys.chosen_td_error].view(runs, 1),
            self.loss.gamma * self.lam,
            greedy_steps(
                self.rule,
                batch[keys.action_value].reshape(runs, -1),
                network.candidates,
                batch[keys.action].view(runs, 1),
            ),
            batch["next", keys.done].view(runs, 1),
        )
        losses["loss"] = -sum((directions[name] * w).sum() for name, w in weights.items())
        return losses

    def register(self, trainer: "Trainer", name: str = "eligibility_trace") -> None:
        """Have TorchRL's trainer call this after the loss, and keep it in its checkpoints."""
        trainer.register_op("process_loss", self)
        trainer.register_module(name, self)

    def state_dict(self) -> dict[str, Tensor]:
        """The trace, by the weights' names."""
        return {name: trace.clone() for name, trace in self.trace.items()}

    def load_state_dict(self, state_dict: dict[str, Tensor]) -> None:
        """Go on from a trace as :meth:`state_dict` gave it."""
        for name, trace in self.trace.items():
            trace.copy_(state_dict[name])
