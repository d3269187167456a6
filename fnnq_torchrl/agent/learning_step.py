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
    """A step of the world, ``[runs]`` with ``"next"``, and its errors."""

    transition: TensorDictBase
    errors: Errors


class _Agent(nn.Module):
    """The policy in the world and the loss: all of a step that depends on the weights."""

    def __init__(self, env: PureEnv, policy: ExploringPolicy, loss: PengQLambdaLoss) -> None:
        super().__init__()
        self.env, self.policy, self.loss = env, policy, loss

    def forward(self, world: TensorDictBase) -> _Experience:
        """Take a step from the world's state, a TensorDict that is changed in place."""
        with torch.no_grad():
            transition = self.env.step(self.policy(world))
        return _Experience(transition, self.loss.errors(transition))


class Learner:
    """A batch of runs that learn with Q(λ) on a world, each run independently of the others.

    A run is one learner with one seed. A situation is an episode. Two TensorDicts of batch size
    ``[runs]`` hold everything that differs from run to run:

    * ``run`` never changes. Its entries, each ``[runs, 1]``, are ``seed``, ``lam``, ``alpha``,
      ``alpha_decay``, ``gamma``, ``kappa`` if the step size needs it, the amount of exploration
      under its own name, such as ``epsilon``, and ``situations``, the number to learn from.
    * ``state`` is replaced by every step. Its entries are ``world``, the environment's state;
      ``weights`` and ``trace``, by the names of the network's parameters; ``alpha``, the current
      step size; ``situations`` and ``steps``, the numbers of those learned from so far;
      ``diverged``, whether |Q| has become too large, after which the run counts no more steps;
      ``over``, whether the run has ended; and ``snapshot``, the weights and counts at the time
      when an evaluation was last due; and, if counted, ``fired``, the rules' firing strengths
      ∂Q(s, a)/∂w, summed over the steps that the run has learned from.

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
    ) -> None:
        self.env = env
        self.policy = make_policy(exploration, value_network, 0.0)  # `step` sets the amount
        self.loss = PengQLambdaLoss(value_network, gamma=1.0)  # likewise γ
        self.step_size = step_size
        self.evaluate_every = evaluate_every
        self._agent = _Agent(env, self.policy, self.loss)
        self._update = Update(self.loss, rule)
        self._count_firing = count_firing
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
                    },
                    **batch,
                ),
                **counted,
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
        slope, (transition, errors) = self._experienced(run, before, state["world"])
        after = transition["next"]
        direction, trace = self._update.update(transition, errors, slope, state["trace"], decay)
        kappa = run.get("kappa", None)
        step, alpha = self.step_size.update(
            per_run(state["alpha"]),
            None if kappa is None else per_run(kappa),
            Direction(
                partial(self._update.present_trace, transition, slope, state["trace"], decay),
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
            },
        }

    def _fired(self, state: TensorDictBase, slope: Weights) -> Tensor:
        """Return ``fired`` after a step; it doesn't change for a run that is over."""
        goes_on = over_batch(state["over"].logical_not(), like=state["fired"])
        return state["fired"] + goes_on * slope["weight"]

    def _within(self, action_value: Tensor) -> Tensor:
        """Return whether no |Q| of a run exceeds ``largest_value`` or is NaN, ``[runs, 1]``."""
        return action_value.abs().amax(-1, keepdim=True) <= self.largest_value

    def _step_of(self, name: str, step: Tensor) -> Tensor:
        """Return the step size of the weights with this name, 0 for those that don't learn."""
        return step * self._learns[name] if name in self._learns else step

    def _experienced(
        self, run: TensorDictBase, weights: dict[str, Tensor], world: TensorDictBase
    ) -> tuple[dict[str, Tensor], _Experience]:
        """Return each run's ∇Q(s, a), by autograd, and the step of its world."""
        amount = self.policy.amount_name
        numbers = {f"policy.{amount}": run[amount], "loss.gamma": run["gamma"]}

        def chosen_value(weights: dict[str, Tensor]) -> tuple[Tensor, _Experience]:
            # The policy has the same network as the loss, so these weights are replaced in both.
            named = {f"loss.value_network.{name}": weight for name, weight in weights.items()}
            experience: _Experience = functional_call(
                self._agent, named | numbers, (world.copy(),), tie_weights=False
            )
            return experience.errors.chosen_value, experience

        return gradient(chosen_value, weights)

    def _error_slope(
        self, weights: dict[str, Tensor], gamma: Tensor, slope: Weights, after: TensorDictBase
    ) -> list[Tensor]:
        """Return ∇δ′ = γ∇V(s′) − ∇Q(s, a), tensors ``[*weights, runs]``.

        ∇V is 0 if s′ ends the task, and the mean of the actions' gradients if several are best.
        """
        network = self.policy.value_network

        def value(weights: dict[str, Tensor]) -> tuple[Tensor, None]:
            observations = tuple(after[key] for key in network.in_keys)
            best = functional_call(network, weights, observations).amax(-1, keepdim=True)
            return best.masked_fill(after["terminated"], 0), None

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
