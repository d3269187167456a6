"""The eligibility trace of Q(λ) as a hook that replaces the loss."""

from typing import TYPE_CHECKING

import torch
from tensordict import TensorDictBase
from torch import Tensor

from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.agent.update import Update
from fnnq_torchrl.equations.layout import run_numbers
from fnnq_torchrl.equations.q_lambda import Rule

if TYPE_CHECKING:  # this module imports all of TorchRL's collectors
    from torchrl.trainers import Trainer


class EligibilityTrace:
    """A hook that turns the loss of one-step Q-learning into the loss of Q(λ).

    The hook replaces the loss by −⟨Δw, w⟩ with Δw = δe + δ′∇Q(s, a), so the loss has the gradient
    −Δw. Plain SGD with the step size α then does steps f and g of the paper's Table 1; the hook
    itself does steps e and h. Call it once per step of the world, in order::

        losses = trace(batch, loss(batch))
        losses["loss"].backward()
        optimizer.step()

    or, in TorchRL's Trainer, ``trace.register(trainer)``.

    Args:
        loss: the loss module, whose network's weights have the runs as their first dimension.
        lam: λ, one number or one per run, ``[runs, 1]``.
        rule: the variant of Q(λ) and its trace; by default the paper's.
        alpha: the step size of plain SGD, which a dutch trace needs.

    Raises:
        ValueError: if λ or α has a wrong shape, a dutch trace has no α, or the loss has another
            bootstrap than the variant.
    """

    def __init__(
        self,
        loss: PengQLambdaLoss,
        lam: Tensor | float,
        rule: Rule | None = None,
        alpha: Tensor | float | None = None,
    ) -> None:
        self.loss = loss
        self.lam = run_numbers("lam", lam, like=loss.gamma)
        self.alpha = None if alpha is None else run_numbers("alpha", alpha, like=loss.gamma)
        self._update = Update(loss, rule or Rule())
        if self._update.rule.trace.corrects and alpha is None:
            raise ValueError("alpha=None: a dutch trace needs the step size")
        weights = {name: w.detach() for name, w in loss.value_network.named_parameters()}
        self.trace = self._update.start(weights)

    def __call__(self, batch: TensorDictBase, losses: TensorDictBase) -> TensorDictBase:
        """Replace ``loss`` by the loss of Q(λ), update the trace and return the losses.

        Args:
            batch: one step of every run, ``[runs]`` or, from a collector, ``[runs, 1]``.
            losses: the loss module's result for the batch, which is changed in place.

        Raises:
            ValueError: if the batch has more than one step of a run.
        """
        runs, keys = len(batch), self.loss.tensor_keys
        if batch.numel() != runs:
            raise ValueError(f"batch of shape {list(batch.shape)}: must be one step of every run")
        weights = dict(self.loss.value_network.named_parameters())
        names = (keys.td_error, keys.chosen_td_error, keys.chosen_action_value, keys.next_value)
        errors = Errors(*(losses[key].view(runs, 1) for key in names))
        slopes = torch.autograd.grad(errors.chosen_value.sum(), [*weights.values()])
        step = self._update.step(
            batch.view(runs),
            errors,
            dict(zip(weights, slopes, strict=True)),
            self.trace,
            self.loss.gamma * self.lam,
            alpha=self.alpha,
            of_all=self._of_all(batch) if self._update.rule.trace.clears else None,
        )
        direction, self.trace = self._update.updated(step.credited(), errors, weights)
        losses["loss"] = -sum((direction[name] * w).sum() for name, w in weights.items())
        return losses

    def _of_all(self, batch: TensorDictBase) -> dict[str, Tensor]:
        """Return ∇ΣQ(s, ·) over all candidates, by the names of the weights."""
        network = self.loss.value_network
        weights = dict(network.named_parameters())
        slopes = torch.autograd.grad(network.values_in(batch).sum(), [*weights.values()])
        return dict(zip(weights, slopes, strict=True))

    def register(self, trainer: "Trainer", name: str = "eligibility_trace") -> None:
        """Register the hook with TorchRL's trainer, which calls it after the loss and saves it."""
        trainer.register_op("process_loss", self)
        trainer.register_module(name, self)

    def state_dict(self) -> dict[str, Tensor]:
        """Return a copy of the trace, by the names of the weights."""
        return {name: trace.clone() for name, trace in self.trace.items()}

    def load_state_dict(self, state_dict: dict[str, Tensor]) -> None:
        """Restore the trace that :meth:`state_dict` returned."""
        for name, trace in self.trace.items():
            trace.copy_(state_dict[name])
