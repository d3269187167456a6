"""One learning step of a whole batch of runs: a function from TensorDicts to TensorDicts."""

from collections.abc import Mapping

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch.func import functional_call

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.eligibility_trace import credit_weights, greedy_steps, no_trace
from fnnq_torchrl.agent.gradient import gradient
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy, make_policy
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.equations import q_lambda
from fnnq_torchrl.equations.layout import per_run, runs_first, runs_last
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import StepSize, alpha_bound, decayed, obgd


class Program:
    """Q(λ) on an environment: act, step, the two errors, weights and trace, restart.

    Everything that differs from run to run comes in TensorDicts of batch size ``[runs]``, and
    nothing is averaged over runs, so each run is a learner of its own:

    * ``run``, which stays: ``seed``, ``lam``, ``alpha``, ``alpha_decay``, ``kappa`` where the step
      size has one, ``gamma``, the amount of exploration by its name, as ``epsilon``, and
      ``situations``, how many it is to learn from; each ``[runs, 1]``;
    * ``state``, which every step replaces: ``world``, what the environment needs to go on;
      ``weights`` and ``trace``, by the names of the network's parameters; ``alpha``, the step size
      as it has become; ``situations`` and ``steps``, counts of what was learned from; ``diverged``,
      whether |Q| has gone beyond all bounds, which ends the counts; ``over``, whether that is all;
      ``snapshot``, weights and counts as they were when an evaluation was last due.

    Args:
        env: the world, with the runs as its batch.
        value_network: Q(s, a).
        rule: which Q(λ) it is.
        step_size: which step size it has.
        exploration: which policy it learns by (:func:`fnnq_torchrl.agent.policy.make_policy`).
        evaluate_every: situations from one evaluation to the next.
        largest_value: a run with a larger |Q| than this has diverged.

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
    ) -> None:
        self.env = env
        self.policy = make_policy(exploration, value_network, 0.0)  # every step sets the amount
        self.loss = PengQLambdaLoss(value_network, gamma=1.0)
        self.rule = rule
        self.step_size = step_size
        self.evaluate_every = evaluate_every
        self.largest_value = largest_value

    def begin(self, run: TensorDictBase) -> TensorDict:
        """The state before the first step: weights as the network starts them, no trace."""
        runs = run.batch_size
        start = self.loss.value_network.start(run["seed"])
        weights = {name: _copy(weight) for name, weight in start.items()}
        zero = torch.zeros_like(run["seed"])  # cloned wherever it stands: no entry is an alias
        batch = {"batch_size": runs, "device": run.device}
        return TensorDict(
            {
                "world": self.env.start(run["seed"].clone(), zero.clone()),
                "weights": TensorDict(weights, **batch),
                "trace": TensorDict(no_trace(self.rule, weights), **batch),
                "alpha": run["alpha"].clone(),
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
            },
            **batch,
        )

    def step(self, run: TensorDictBase, state: TensorDictBase) -> TensorDict:
        """One step of every run in its world, and what it learns from it (paper, Table 1).

        A snapshot is taken where the step ends a situation after which an evaluation is due.
        Whoever calls collects it before the next one can be due, ``env.fewest_steps ·
        evaluate_every`` steps later.
        """
        amount = run[self.policy.amount_name]
        world = act(self.policy, state["weights"], amount, state["world"])
        transition = self.env.step(world)
        after = transition["next"]
        slope, td_error, chosen_td_error = self._slope(state["weights"], run["gamma"], transition)
        greedy = greedy_steps(
            self.rule,
            world["action_value"],
            self.policy.value_network.candidates,
            world["action"],
        )
        directions, trace = credit_weights(
            self.rule,
            state["trace"],
            slope,
            td_error,
            chosen_td_error,
            run["gamma"] * run["lam"],
            greedy,
            after["done"],
        )
        errors = td_error, chosen_td_error
        step, alpha = self._step_sizes(run, state, after, slope, errors, greedy)
        weights = {
            name: runs_first(runs_last(weight) + step * runs_last(directions[name]))
            for name, weight in state["weights"].items()
        }
        alpha = decayed(alpha, per_run(run["alpha_decay"]), per_run(after["reward"]))
        diverged = state["diverged"] | (self._beyond(world["action_value"]) & ~state["over"])
        situations = state["situations"] + (after["done"] & ~diverged)
        steps = state["steps"] + ~diverged
        snapshot = state["snapshot"]
        # A number: where all the weights are at stake, loops load booleans slowly.
        due = (situations == snapshot["situations"] + self.evaluate_every).to(alpha.dtype)
        now = TensorDict(
            {
                "weights": _where(due, weights, snapshot["weights"]),
                "situations": torch.where(due > 0, situations, snapshot["situations"]),
                "steps": torch.where(due > 0, steps, snapshot["steps"]),
            }
        )
        return TensorDict(
            {
                "world": self.env.restart(after),
                "weights": weights,
                "trace": trace,
                "alpha": alpha.unsqueeze(-1),
                "situations": situations,
                "steps": steps,
                "diverged": diverged,
                "over": (situations >= run["situations"]) | diverged,
                "snapshot": now,
            },
            batch_size=state.batch_size,
            device=state.device,
        )

    def _beyond(self, action_value: Tensor) -> Tensor:
        """Whether a |Q| is larger than any may be, or not a number: bool ``[runs, 1]``."""
        return ~(action_value.abs().amax(-1, keepdim=True) <= self.largest_value)

    def _slope(
        self, weights: Mapping[str, Tensor], gamma: Tensor, transition: TensorDictBase
    ) -> tuple[dict[str, Tensor], Tensor, Tensor]:
        """∇Q(s, a) of every run, by autograd through the loss, and the errors δ and δ′."""

        def chosen_value(weights: dict[str, Tensor]) -> tuple[Tensor, tuple[Tensor, Tensor]]:
            overrides = {f"value_network.{name}": weight for name, weight in weights.items()}
            losses = functional_call(self.loss, overrides | {"gamma": gamma}, (transition,))
            # No run's Q depends on another's weights: the sum's gradient is each run's own.
            total = losses["chosen_action_value"].sum()
            return total, (losses["td_error"], losses["chosen_td_error"])

        slope, errors = gradient(chosen_value, dict(weights.items()))
        return slope, *errors

    def _step_sizes(
        self,
        run: TensorDictBase,
        state: TensorDictBase,
        after: TensorDictBase,
        slope: Mapping[str, Tensor],
        errors: tuple[Tensor, Tensor],
        greedy: Tensor | None,
    ) -> tuple[Tensor, Tensor]:
        """α of this step, and α from which later ones go on, each ``[runs]``."""
        alpha, kind = per_run(state["alpha"]), self.step_size.kind
        if kind not in ("obgd", "alpha_bound"):
            return alpha, alpha
        present_trace = q_lambda.present_trace(
            self.rule,
            [runs_last(state["trace"][name]) for name in slope],
            [runs_last(gradient) for gradient in slope.values()],
            per_run(run["gamma"] * run["lam"]),
            greedy,
        )
        if kind == "obgd":
            error = q_lambda.largest_error(self.rule, *map(per_run, errors))
            return obgd(alpha, per_run(run["kappa"]), error, present_trace), alpha
        ahead, gamma = self._slope_ahead(state["weights"], after), per_run(run["gamma"])
        error_slope = [gamma * runs_last(ahead[name]) - runs_last(slope[name]) for name in slope]
        bounded = alpha_bound(alpha, present_trace, error_slope)
        return bounded, bounded

    def _slope_ahead(
        self, weights: Mapping[str, Tensor], after: TensorDictBase
    ) -> dict[str, Tensor]:
        """∇V(s′) of every run, 0 at an end; between equally good actions, the mean of theirs."""
        network = self.policy.value_network

        def value(weights: dict[str, Tensor]) -> tuple[Tensor, None]:
            observations = tuple(after[key] for key in network.in_keys)
            best = functional_call(network, weights, observations).amax(-1, keepdim=True)
            return best.masked_fill(after["terminated"], 0).sum(), None

        slope, _ = gradient(value, dict(weights.items()))
        return slope


def act(
    policy: ExploringPolicy,
    weights: Mapping[str, Tensor],
    amount: Tensor,
    world: TensorDictBase,
) -> TensorDictBase:
    """The world's TensorDict with each run's choice in it, from that run's weights and amount."""
    overrides = {f"value_network.{name}": weight for name, weight in weights.items()}
    return functional_call(policy, overrides | {policy.amount_name: amount}, (world.copy(),))


def _copy(weight: Tensor) -> Tensor:
    """A copy with the runs last in memory."""
    return runs_first(runs_last(weight).contiguous().clone())


def _where(
    mask: Tensor, chosen: Mapping[str, Tensor], other: Mapping[str, Tensor]
) -> dict[str, Tensor]:
    mask = per_run(mask) > 0
    return {
        name: runs_first(torch.where(mask, runs_last(new), runs_last(other[name])))
        for name, new in chosen.items()
    }
