"""The part of a learning step that reads the weights: a step of the world, and its errors."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torch.func import functional_call

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.adaptive import Adaptive
from fnnq_torchrl.agent.gradient import Weights, gradient
from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy
from fnnq_torchrl.agent.progress import ended
from fnnq_torchrl.agent.reward_scaling import SCALED, RewardScaling
from fnnq_torchrl.equations.layout import per_run


class Experience(NamedTuple):
    """A step of the world, with its errors.

    Attributes:
        transition: the step, ``[runs]``, with ``"next"``.
        errors: its errors, and the values they come from.
        alpha, gamma: α and γ of this step, each ``[runs, 1]``.
        carried: entries of the state after the step, by name: ``adaptive``, ``reward_scale`` and
            ``action``, if the learner has them.
    """

    transition: TensorDictBase
    errors: Errors
    alpha: Tensor
    gamma: Tensor
    carried: dict[str, Any]


class Acting(nn.Module):
    """The policy acts, the world steps, and the loss compares.

    The optional entries of the state that are needed before the errors are known change here:

    * ``action``, the next action, if the variant chooses it before the update;
    * ``reward_scale``, if rewards are scaled;
    * ``adaptive``, if a scheme changes α, the temperature or γ.

    Args:
        env: the world.
        policy, loss: of the same value network.
        scaling: the scaling of rewards, if any.
        adaptive: the scheme that changes learning parameters, if any.
    """

    def __init__(
        self,
        env: PureEnv,
        policy: ExploringPolicy,
        loss: PengQLambdaLoss,
        scaling: RewardScaling | None,
        adaptive: Adaptive | None,
    ) -> None:
        super().__init__()
        self.env, self.policy, self.loss = env, policy, loss
        self._scaling, self._adaptive = scaling, adaptive
        if scaling is not None:
            loss.set_keys(reward=SCALED)

    def start(self, run: TensorDictBase) -> dict[str, Any]:
        """Return the optional entries before the first step."""
        entries: dict[str, Any] = {}
        if self.loss.bootstrap == "chosen":
            entries["action"] = torch.zeros_like(run["alpha"])
        if self._scaling is not None:
            entries["reward_scale"] = self._scaling.start(run)
        if self._adaptive is not None:
            entries["adaptive"] = self._adaptive.start(run)
        return entries

    def told(self, carried: Mapping[str, Any]) -> dict[str, Tensor]:
        """Return the numbers among the optional entries that an evaluation tells."""
        return {} if self._adaptive is None else self._adaptive.told(carried["adaptive"])

    def experience(
        self,
        run: Mapping[str, Tensor],
        state: Mapping[str, Any],
        weights: Weights,
        statistics: Mapping[str, Tensor],
    ) -> tuple[Weights, Experience]:
        """Return each run's ∇Q(s, a), by autograd, and its step of the world with the errors.

        Args:
            run, state: the runs, and their state before the step.
            weights: the weights that learn, by name.
            statistics: the network's statistics, by name.
        """
        name = self.policy.amount_name
        amount = state.get("adaptive", {}).get(name, None)
        if amount is None:
            amount = self.policy.amount(run, state["steps"])
        numbers = {f"policy.{name}": amount}

        def chosen_value(weights: Weights) -> tuple[Tensor, Experience]:
            # The policy has the same network as the loss, so these weights are replaced in both.
            of_network = {**weights, **statistics}
            named = {f"loss.value_network.{name}": each for name, each in of_network.items()}
            found: Experience = functional_call(
                self, named | numbers, (run, state), tie_weights=False
            )
            return found.errors.chosen_value, found

        return gradient(chosen_value, weights)

    def forward(self, run: Mapping[str, Tensor], state: Mapping[str, Any]) -> Experience:
        """Take a step of the world and return it with its errors; :meth:`experience` calls it."""
        carried: dict[str, Any] = {}
        with torch.no_grad():
            acting = self.policy(state["world"].copy())
            # The action was chosen before the last update, except in an episode's first step.
            if "action" in state:
                first = state["world"]["step"] == 0
                acting["action"] = torch.where(first, acting["action"], state["action"])
            after = self.env.next_state(acting)
            transition = acting.set("next", after)
            alpha, gamma = state["alpha"], run["gamma"]
            if self._adaptive is not None:
                carried["adaptive"], alpha = self._adapted(run, state, after)
                gamma = carried["adaptive"].get("gamma", gamma)
            after.update(self.loss.value_network.observed(after))
            if self._scaling is not None:
                before = state["reward_scale"]
                carried["reward_scale"], after[SCALED] = self._scaling.update(before, after, gamma)
            after.update(self._ahead(after))
            if self.loss.bootstrap == "chosen":
                carried["action"] = after["action"]
        return Experience(transition, self.loss.errors(transition, gamma), alpha, gamma, carried)

    def _adapted(
        self, run: Mapping[str, Tensor], state: Mapping[str, Any], after: TensorDictBase
    ) -> tuple[dict[str, Tensor], Tensor]:
        """Return the state of the adaptive scheme and α after a step's reward."""
        assert self._adaptive is not None
        over = ended(self.env, state["situations"], after)
        return self._adaptive.update(
            run, state["adaptive"], state["alpha"], after["reward"], over, state["steps"]
        )

    def _ahead(self, after: TensorDictBase) -> dict[str, Tensor]:
        """Return the entries of the next state that the loss needs to bootstrap, if any.

        They are computed with the weights before the update.
        """
        if self.loss.bootstrap == "best":
            return {}
        ahead = self.policy(after.copy())
        if self.loss.bootstrap == "chosen":
            return {"action": ahead["action"]}
        values = ahead["action_value"].movedim(-1, 0)
        amount = per_run(getattr(self.policy, self.policy.amount_name))
        return {"action_probability": self.policy.probabilities(values, amount).movedim(0, -1)}
