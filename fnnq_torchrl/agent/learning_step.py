"""A learning step of a batch of runs, as a function from TensorDicts to TensorDicts."""

from collections.abc import Mapping
from functools import partial
from typing import Any, NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torch.func import functional_call

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.gradient import gradient
from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy, make_policy
from fnnq_torchrl.agent.update import Update, Weights
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.equations.layout import over_batch, per_run, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import Direction, StepSize, decayed


class _Experience(NamedTuple):
    """A step of the world, ``[runs]`` with ``"next"``, and the errors of Q in that step."""

    transition: TensorDictBase
    errors: Errors


class _Agent(nn.Module):
    """The policy, the world and the loss: the part of a learning step that reads the weights."""

    def __init__(self, env: PureEnv, policy: ExploringPolicy, loss: PengQLambdaLoss) -> None:
        super().__init__()
        self.env, self.policy, self.loss = env, policy, loss

    def forward(self, world: TensorDictBase, chosen: Tensor | None = None) -> _Experience:
        """Take a step of the world and return the step with its errors.

        Args:
            world: the state before the step, a TensorDict that is changed in place.
            chosen: the action that was chosen before the last update, ``[runs, 1]``, ignored in the
                first step of an episode. None: the policy chooses the action now.
        """
        with torch.no_grad():
            acting = self.policy(world)
            if chosen is not None:
                acting["action"] = torch.where(world["step"] == 0, acting["action"], chosen)
            transition = self.env.step(acting)
            transition["next"].update(self._ahead(transition["next"]))
        return _Experience(transition, self.loss.errors(transition))

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


class Learner:
    """A batch of runs that learn with Q(λ) on a world, each run independently of the others.

    A run is one learner with one seed. A situation is an episode. Two TensorDicts of batch size
    ``[runs]`` hold everything that differs from run to run:

    * ``run`` never changes. Its entries, each ``[runs, 1]``, are ``seed``, ``lam``, ``alpha``,
      ``alpha_decay``, ``gamma``, ``kappa`` if the step size needs it, the amount of exploration
      under its own name, such as ``epsilon``, and ``situations``, the number of situations to learn
      from. If ε is annealed, there are ``epsilon_final`` and ``epsilon_over``, too.
    * ``state`` is replaced by every step. Its entries are ``world``, the environment's state;
      ``weights`` and ``trace``, by the names of the network's parameters; ``action``, the next
      action, if the variant chooses it before the update; ``alpha``, the current step size;
      ``situations`` and ``steps``, the numbers of situations and steps learned from so far;
      ``diverged``, whether |Q| has become too large, after which the run counts no more steps;
      ``over``, whether the run has ended; and ``snapshot``, the weights and counts at the time when
      an evaluation was last due. With ``count_firing`` there is ``fired``, the rules' firing
      strengths ∂Q(s, a)/∂w, summed over the steps that the run has learned from. With
      ``count_earned``, both ``state`` and ``snapshot`` have ``earned``: the sum of rewards
      (``return``) and the number of successes since the snapshot before.

    Args:
        env: the world, with the runs as its batch.
        value_network: Q(s, a).
        rule: the variant of Q(λ) and its trace.
        step_size: the rule for the step size.
        exploration: the name of the policy (:func:`fnnq_torchrl.agent.policy.make_policy`).
        evaluate_every: the number of situations from one evaluation to the next.
        largest_value: the |Q| above which a run has diverged. Infinity means that only a run
            whose Q isn't finite has diverged.
        learns: 1 for weights that learn and 0 for those that don't, ``[*weights]``, by the names of
            the network's parameters. Parameters without an entry learn.
        count_firing: add up ``fired``; for a network whose parameter ``weight`` holds the rules'
            consequents.
        count_earned: add up ``earned``, for learning without tests.

    Raises:
        ValueError: if there is no such policy.
    """

    def __init__(
        self,
        env: PureEnv,
        value_network: ValueNetwork,
        *,
        rule: Rule,
        step_size: StepSize,
        exploration: str,
        evaluate_every: int,
        largest_value: float,
        learns: Mapping[str, Tensor] | None = None,
        count_firing: bool = False,
        count_earned: bool = False,
    ) -> None:
        self.env = env
        self.policy = make_policy(exploration, value_network, 0.0)  # `step` sets the amount
        bootstrap = rule.variant.bootstrap
        self.loss = PengQLambdaLoss(value_network, gamma=1.0, bootstrap=bootstrap)  # `step` sets γ
        self.step_size = step_size
        self.evaluate_every = evaluate_every
        self._agent = _Agent(env, self.policy, self.loss)
        self._update = Update(self.loss, rule)
        self._count_firing, self._count_earned = count_firing, count_earned
        like = value_network.candidates
        self._learns = {name: mask.to(like) for name, mask in (learns or {}).items()}
        self.largest_value = min(largest_value, torch.finfo(value_network.candidates.dtype).max)

    def begin(self, run: TensorDictBase) -> TensorDict:
        """Return the state before the first step: the network's start weights and a zero trace."""
        runs = run.batch_size
        start = self.loss.value_network.start(run["seed"])
        weights = {name: _copy(weight) for name, weight in start.items()}
        zero = torch.zeros_like(run["seed"])  # cloned, because entries must not share memory
        batch = {"batch_size": runs, "device": run.device}
        counted = {"fired": torch.zeros_like(weights["weight"])} if self._count_firing else {}
        if self._chooses_ahead:
            counted["action"] = torch.zeros_like(run["alpha"])
        earned = self._nothing_earned(run)
        return TensorDict(
            {
                "world": self.env.start(run["seed"].clone(), zero.clone()),
                "weights": TensorDict(weights, **batch),
                "trace": TensorDict(self._update.start(weights), **batch),
                "alpha": self.step_size.start(run["alpha"]),
                "situations": zero.clone(),
                "steps": zero.clone(),
                "diverged": torch.zeros_like(zero, dtype=torch.bool),
                "over": torch.zeros_like(zero, dtype=torch.bool),
                "snapshot": TensorDict(
                    {
                        "weights": TensorDict({k: _copy(w) for k, w in weights.items()}, **batch),
                        "situations": zero.clone(),
                        "steps": zero.clone(),
                        **self._nothing_earned(run),
                    },
                    **batch,
                ),
                **counted,
                **earned,
            },
            **batch,
        )

    def step(self, run: TensorDictBase, state: TensorDictBase) -> TensorDict:
        """Take one step in every run's world, learn from it and return the new state.

        It does the paper's Table 1. When a situation ends after which an evaluation is due, the
        run's weights and counts are stored in ``snapshot``. The caller must read a snapshot before
        the next one replaces it, which takes at least ``fewest_steps · evaluate_every`` steps
        (:class:`envs.core.world.WorldConfig`).
        """
        before, decay = dict(state["weights"].items()), run["gamma"] * run["lam"]
        slope, (transition, errors) = self._experienced(run, before, state)
        after = transition["next"]
        of_all = self._slope_of_all(before, transition)
        direction, trace = self._update.update(
            transition,
            errors,
            slope,
            state["trace"],
            decay,
            alpha=state["alpha"],
            of_all=of_all,
        )
        kappa = run.get("kappa", None)
        step, alpha = self.step_size.update(
            per_run(state["alpha"]),
            None if kappa is None else per_run(kappa),
            Direction(
                partial(
                    self._update.present_trace,
                    transition,
                    slope,
                    state["trace"],
                    decay,
                    of_all=of_all,
                ),
                partial(self._update.largest_error, errors),
                partial(self._error_slope, before, run["gamma"], slope, after),
            ),
        )
        weights = {
            name: weight + self._step_of(name, over_batch(step, like=weight)) * direction[name]
            for name, weight in before.items()
        }
        alpha = decayed(alpha.unsqueeze(-1), run["alpha_decay"], after["success"])
        counted = {"fired": self._fired(state, slope)} if self._count_firing else {}
        if self._chooses_ahead:
            counted["action"] = after["action"]
        return TensorDict(
            {
                "world": self.env.restart(after),
                "weights": weights,
                "trace": trace,
                "alpha": alpha,
                **self._counts(run, state, transition, weights),
                **counted,
            },
            batch_size=state.batch_size,
            device=state.device,
        )

    @property
    def _chooses_ahead(self) -> bool:
        return self._update.rule.variant.bootstrap == "chosen"

    def _counts(
        self,
        run: TensorDictBase,
        state: TensorDictBase,
        transition: TensorDictBase,
        weights: Weights,
    ) -> dict[str, Any]:
        """Return the counts after a step, and the snapshot, replaced where an evaluation is due."""
        within = self._within(transition["action_value"])
        diverged = state["diverged"] | ~(within | state["over"])
        goes_on = ~diverged
        situations = state["situations"] + (transition["next", "done"] & goes_on)
        steps = state["steps"] + goes_on
        snapshot = state["snapshot"]
        due = situations == snapshot["situations"] + self.evaluate_every
        earned, earned_before = self._earned(state, transition["next"], due)
        return {
            "situations": situations,
            "steps": steps,
            "diverged": diverged,
            "over": (situations >= run["situations"]) | diverged,
            "snapshot": {
                "weights": {
                    name: torch.where(over_batch(due, like=weight), weights[name], weight)
                    for name, weight in snapshot["weights"].items()
                },
                "situations": torch.where(due, situations, snapshot["situations"]),
                "steps": torch.where(due, steps, snapshot["steps"]),
                **earned_before,
            },
            **earned,
        }

    def _nothing_earned(self, run: TensorDictBase) -> dict[str, TensorDict]:
        """Return ``earned`` before the first step; empty if it isn't counted."""
        if not self._count_earned:
            return {}
        zeros = {"return": torch.zeros_like(run["alpha"]), "success": torch.zeros_like(run["seed"])}
        return {"earned": TensorDict(zeros, run.batch_size, device=run.device)}

    def _earned(
        self, state: TensorDictBase, after: TensorDictBase, due: Tensor
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return ``earned`` of the state and of the snapshot after a step; empty if not counted."""
        if not self._count_earned:
            return {}, {}
        new = {"return": after["reward"], "success": after["success"].to(torch.int64)}
        so_far = {key: state["earned", key] + new[key] for key in new}
        kept = {
            key: torch.where(due, sum_, state["snapshot", "earned", key])
            for key, sum_ in so_far.items()
        }
        so_far = {key: torch.where(due, 0, sum_) for key, sum_ in so_far.items()}
        return {"earned": so_far}, {"earned": kept}

    def _fired(self, state: TensorDictBase, slope: Weights) -> Tensor:
        """Return ``fired`` after a step; it doesn't change for a run that is over."""
        goes_on = over_batch(state["over"].logical_not(), like=state["fired"])
        return state["fired"] + goes_on * slope["weight"]

    def _within(self, action_value: Tensor) -> Tensor:
        """Return where all |Q| are at most ``largest_value``, false for NaN, ``[runs, 1]``."""
        return action_value.abs().flatten(1).amax(-1, keepdim=True) <= self.largest_value

    def _step_of(self, name: str, step: Tensor) -> Tensor:
        """Return the step size of the weights with this name, 0 for weights that don't learn."""
        return step * self._learns[name] if name in self._learns else step

    def _experienced(
        self, run: TensorDictBase, weights: dict[str, Tensor], state: TensorDictBase
    ) -> tuple[dict[str, Tensor], _Experience]:
        """Return each run's ∇Q(s, a), by autograd, and its step of the world with the errors."""
        amount = self.policy.amount(run, state["steps"])
        numbers = {f"policy.{self.policy.amount_name}": amount, "loss.gamma": run["gamma"]}
        given = state["world"].copy(), state.get("action", None)

        def chosen_value(weights: dict[str, Tensor]) -> tuple[Tensor, _Experience]:
            # The policy has the same network as the loss, so these weights are replaced in both.
            named = {f"loss.value_network.{name}": weight for name, weight in weights.items()}
            experience: _Experience = functional_call(
                self._agent, named | numbers, given, tie_weights=False
            )
            return experience.errors.chosen_value, experience

        return gradient(chosen_value, weights)

    def _slope_of_all(
        self, weights: dict[str, Tensor], transition: TensorDictBase
    ) -> dict[str, Tensor] | None:
        """Return each run's ∇ΣQ(s, ·) over all candidates; None if the trace doesn't need it."""
        if not self._update.rule.trace.clears:
            return None
        network = self.policy.value_network

        def every_value(weights: dict[str, Tensor]) -> tuple[Tensor, None]:
            observations = tuple(transition[key] for key in network.in_keys)
            return functional_call(network, weights, observations), None

        return gradient(every_value, weights)[0]

    def _error_slope(
        self, weights: dict[str, Tensor], gamma: Tensor, slope: Weights, after: TensorDictBase
    ) -> list[Tensor]:
        """Return ∇δ′ = γ∇V(s′) − ∇Q(s, a), tensors ``[*weights, runs]``.

        ∇V is 0 if s′ ends the task. If V is a maximum, ∇V is the mean over the best actions.
        """
        network = self.policy.value_network

        def value(weights: dict[str, Tensor]) -> tuple[Tensor, None]:
            observations = tuple(after[key] for key in network.in_keys)

            def values(action: Tensor | None) -> Tensor:
                found: Tensor = functional_call(network, weights, observations, {"action": action})
                return found

            return self.loss.next_value(values, after).masked_fill(after["terminated"], 0), None

        ahead, _ = gradient(value, weights)
        return [per_run(gamma) * runs_last(ahead[name]) - runs_last(slope[name]) for name in slope]


def act(
    policy: ExploringPolicy,
    weights: Weights,
    amount: Tensor,
    world: TensorDictBase,
) -> TensorDictBase:
    """Return the world's TensorDict with the action that each run's weights choose."""
    overrides = {f"value_network.{name}": weight for name, weight in weights.items()}
    return functional_call(policy, overrides | {policy.amount_name: amount}, (world.copy(),))


def _copy(weight: Tensor) -> Tensor:
    """Return a copy of the weights with the runs as the last dimension in memory."""
    return runs_first(runs_last(weight).contiguous().clone())
