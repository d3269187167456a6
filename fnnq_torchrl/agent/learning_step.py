"""One learning step of a whole batch of runs: a function from TensorDicts to TensorDicts."""

from collections.abc import Mapping
from functools import partial

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch.func import functional_call

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.gradient import gradient
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy, make_policy
from fnnq_torchrl.agent.update import Update, Weights
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import Direction, StepSize, decayed


class Learner:
    """Q(λ) on a world: act, step, the two errors, weights and trace, restart.

    Everything that differs from run to run comes in TensorDicts of batch size ``[runs]``, and
    nothing is averaged over runs, so each run is a learner of its own:

    * ``run``, which stays: ``seed``, ``lam``, ``alpha``, ``alpha_decay``, ``kappa`` where the step
      size has one, ``gamma``, the amount of exploration by its name, as ``epsilon``, and
      ``situations``, how many it is to learn from; each ``[runs, 1]``;
    * ``state``, which every step replaces: ``world``, what the environment needs to go on;
      ``weights`` and ``trace``, by the names of the network's parameters; ``alpha``, the step size
      as it has become; ``situations`` and ``steps``, counts of what was learned from; ``diverged``,
      whether |Q| has gone beyond all bounds, which ends the counts; ``over``, whether that is all;
      ``snapshot``, weights and counts as they were when an evaluation was last due; ``fired``,
      if it is asked for, the rules' firing strengths, which are ∂Q(s, a)/∂w, summed over the steps
      that it learned from.

    Args:
        env: the world, with the runs as its batch.
        value_network: Q(s, a).
        rule: which Q(λ) it is.
        step_size: which step size it has.
        exploration: which policy it learns by (:func:`fnnq_torchrl.agent.policy.make_policy`).
        evaluate_every: situations from one evaluation to the next.
        largest_value: a run with a larger |Q| than this has diverged; with infinity, one whose Q
            isn't finite.
        learns: by the names of the network's parameters, 1 for what learns and 0 for what stays as
            it is, ``[*weights]``; what isn't named learns.
        count_firing: whether the state has ``fired``; for a network whose parameter ``weight`` has
            the rules' consequents.

    Raises:
        ValueError: there is no such policy.
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
        self.policy = make_policy(exploration, value_network, 0.0)  # every step sets the amount
        self.loss = PengQLambdaLoss(value_network, gamma=1.0)
        self.step_size = step_size
        self.evaluate_every = evaluate_every
        self._update = Update(self.loss, rule)
        self._count_firing = count_firing
        like = value_network.candidates
        masks = (learns or {}).items()
        self._learns = {name: mask.unsqueeze(-1).to(like) for name, mask in masks}
        self.largest_value = min(largest_value, torch.finfo(value_network.candidates.dtype).max)

    def begin(self, run: TensorDictBase) -> TensorDict:
        """Return the state before the first step: weights as the network starts them, no trace."""
        runs = run.batch_size
        start = self.loss.value_network.start(run["seed"])
        weights = {name: _copy(weight) for name, weight in start.items()}
        zero = torch.zeros_like(run["seed"])  # cloned wherever it stands: no entry is an alias
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
        """Take one step of every run in its world, and learn from it (paper, Table 1).

        A snapshot is taken where the step ends a situation after which an evaluation is due.
        The caller must collect it within ``fewest_steps · evaluate_every`` steps
        (:class:`envs.core.world.WorldConfig`).
        """
        amount, decay = run[self.policy.amount_name], run["gamma"] * run["lam"]
        transition = self.env.step(act(self.policy, state["weights"], amount, state["world"]))
        after = transition["next"]
        slope, losses = self._slope(state["weights"], run["gamma"], transition)
        direction, trace = self._update.update(transition, losses, slope, state["trace"], decay)
        kappa = run.get("kappa", None)
        step, alpha = self.step_size.update(
            per_run(state["alpha"]),
            None if kappa is None else per_run(kappa),
            Direction(
                partial(self._update.present_trace, transition, slope, state["trace"], decay),
                partial(self._update.largest_error, losses),
                partial(self._error_slope, state["weights"], run["gamma"], slope, after),
            ),
        )
        steps = {name: step * learns for name, learns in self._learns.items()}
        weights = {
            name: runs_first(runs_last(weight) + steps.get(name, step) * runs_last(direction[name]))
            for name, weight in state["weights"].items()
        }
        alpha = decayed(alpha, per_run(run["alpha_decay"]), per_run(after["success"]))
        counted = {"fired": self._fired(state, slope)} if self._count_firing else {}
        return TensorDict(
            {
                "world": self.env.restart(after),
                "weights": weights,
                "trace": trace,
                "alpha": alpha.unsqueeze(-1),
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
    ) -> dict[str, Tensor | TensorDict]:
        """Return what a step makes of the counts, and the snapshot if one is due."""
        beyond = self._beyond(transition["action_value"])
        diverged = state["diverged"] | (beyond & ~state["over"])
        situations = state["situations"] + (transition["next", "done"] & ~diverged)
        steps = state["steps"] + ~diverged
        snapshot = state["snapshot"]
        # As a number: a compiled loop loads booleans slowly, and all the weights depend on it.
        now = situations == snapshot["situations"] + self.evaluate_every
        due = now.to(transition["action_value"].dtype)
        return {
            "situations": situations,
            "steps": steps,
            "diverged": diverged,
            "over": (situations >= run["situations"]) | diverged,
            "snapshot": TensorDict(
                {
                    "weights": _where(due, weights, snapshot["weights"]),
                    "situations": torch.where(due > 0, situations, snapshot["situations"]),
                    "steps": torch.where(due > 0, steps, snapshot["steps"]),
                }
            ),
        }

    def _fired(self, state: TensorDictBase, slope: Weights) -> Tensor:
        """Return the sums after a step; those of a run that is over stay as they are."""
        goes_on = per_run(state["over"].logical_not())
        return runs_first(runs_last(state["fired"]) + goes_on * runs_last(slope["weight"]))

    def _beyond(self, action_value: Tensor) -> Tensor:
        """Return whether a |Q| is larger than any may be, or not a number: bool ``[runs, 1]``."""
        return ~(action_value.abs().amax(-1, keepdim=True) <= self.largest_value)

    def _slope(
        self, weights: Weights, gamma: Tensor, transition: TensorDictBase
    ) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Return ∇Q(s, a) of every run, by autograd through the loss, and the errors δ and δ′."""

        def chosen_value(weights: dict[str, Tensor]) -> tuple[Tensor, dict[str, Tensor]]:
            overrides = {f"value_network.{name}": weight for name, weight in weights.items()}
            losses = functional_call(self.loss, overrides | {"gamma": gamma}, (transition,))
            # No run's Q depends on another's weights: the sum's gradient is each run's own.
            total = losses["chosen_action_value"].sum()
            return total, {key: losses[key] for key in ("td_error", "chosen_td_error")}

        return gradient(chosen_value, dict(weights.items()))

    def _error_slope(
        self, weights: Weights, gamma: Tensor, slope: Weights, after: TensorDictBase
    ) -> list[Tensor]:
        """Return ∇δ′ = γ∇V(s′) − ∇Q(s, a), 0·∇V at an end, tensors ``[*weights, runs]``.

        Between equally good actions, ∇V is the mean of theirs.
        """
        network = self.policy.value_network

        def value(weights: dict[str, Tensor]) -> tuple[Tensor, None]:
            observations = tuple(after[key] for key in network.in_keys)
            best = functional_call(network, weights, observations).amax(-1, keepdim=True)
            return best.masked_fill(after["terminated"], 0).sum(), None

        ahead, _ = gradient(value, dict(weights.items()))
        return [per_run(gamma) * runs_last(ahead[name]) - runs_last(slope[name]) for name in slope]


def act(
    policy: ExploringPolicy,
    weights: Weights,
    amount: Tensor,
    world: TensorDictBase,
) -> TensorDictBase:
    """Return the world's TensorDict with each run's choice, from its own weights and amount."""
    overrides = {f"value_network.{name}": weight for name, weight in weights.items()}
    return functional_call(policy, overrides | {policy.amount_name: amount}, (world.copy(),))


def _copy(weight: Tensor) -> Tensor:
    """Return a copy with the runs last in memory."""
    return runs_first(runs_last(weight).contiguous().clone())


def _where(mask: Tensor, chosen: Weights, other: Mapping[str, Tensor]) -> dict[str, Tensor]:
    mask = per_run(mask) > 0
    return {
        name: runs_first(torch.where(mask, runs_last(new), runs_last(other[name])))
        for name, new in chosen.items()
    }
