"""A learning step of a batch of runs, as a function from TensorDicts to TensorDicts."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any, NamedTuple

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn
from torch.func import functional_call

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.adaptive import Adaptive
from fnnq_torchrl.agent.gradient import gradient
from fnnq_torchrl.agent.loss import Errors, PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy, make_policy
from fnnq_torchrl.agent.update import Update, Weights
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.agent.watch import Watch
from fnnq_torchrl.equations.layout import over_batch, per_run, runs_first, runs_last
from fnnq_torchrl.equations.normalisation import Moments, RewardScale
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import State, StepSize, decayed


class _Rates(NamedTuple):
    """The α and γ of a step, each ``[runs, 1]``, and the state of the scheme that changes them."""

    alpha: Tensor
    gamma: Tensor
    adaptive: TensorDictBase | None


class _Experience(NamedTuple):
    """A step of the world, ``[runs]`` with ``"next"``, its α and γ, and the errors of Q in it."""

    transition: TensorDictBase
    rates: _Rates
    errors: Errors


class _Agent(nn.Module):
    """The policy, the world and the loss: the part of a learning step that reads the weights."""

    def __init__(self, env: PureEnv, policy: ExploringPolicy, loss: PengQLambdaLoss) -> None:
        super().__init__()
        self.env, self.policy, self.loss = env, policy, loss

    def forward(
        self,
        world: TensorDictBase,
        rates_after: Callable[[TensorDictBase], _Rates],
        chosen: Tensor | None = None,
        reward_scale: TensorDictBase | None = None,
    ) -> _Experience:
        """Take a step of the world and return the step with its errors.

        Args:
            world: the state before the step, a TensorDict that is changed in place.
            rates_after: returns α and γ of this step, from the entry ``"next"`` of the step.
            chosen: the action that was chosen before the last update, ``[runs, 1]``, ignored in the
                first step of an episode. None: the policy chooses the action now.
            reward_scale: the state of the reward's scale, if it has one. In ``"next"`` there are
                then the next state of it and ``scaled_reward``.
        """
        with torch.no_grad():
            acting = self.policy(world)
            if chosen is not None:
                acting["action"] = torch.where(world["step"] == 0, acting["action"], chosen)
            transition = self.env.step(acting)
            after = transition["next"]
            rates = rates_after(after)
            after.update(self.loss.value_network.observed(after))
            if reward_scale is not None:
                after.update(self._scaled(after, reward_scale, rates.gamma))
            after.update(self._ahead(after))
        return _Experience(transition, rates, self.loss.errors(transition, rates.gamma))

    def _scaled(
        self, after: TensorDictBase, before: TensorDictBase, gamma: Tensor
    ) -> dict[str, Any]:
        """Return the next state of the reward's scale, and the scaled reward."""
        reward, moments = after["reward"], Moments(*(before[key] for key in Moments._fields))
        scale = RewardScale(before["trace"], moments).with_reward(reward, gamma, after["done"])
        kept = {"trace": scale.trace} | scale.moments._asdict()
        return {"reward_scale": kept, "scaled_reward": scale.scaled(reward)}

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
      ``alpha_decay``, ``gamma``, the ``numbers`` of the step size, the amount of exploration
      under its own name, such as ``epsilon``, and ``situations``, the number of situations to learn
      from. If ε is annealed, there are ``epsilon_final`` and ``epsilon_over``, too.
    * ``state`` is replaced by every step. Its entries are ``world``, the environment's state;
      ``weights`` and ``trace``, by the names of the network's parameters; among the ``weights``
      there are also the network's ``statistics``, which have no trace; ``action``, the next
      action, if the variant chooses it before the update; ``alpha``, the current step size, or
      the mean of the weights' own; ``step_size``, what a rule with a step size for each weight
      remembers, by the rule's names and those of the parameters; ``reward_scale``, if rewards are
      scaled (:class:`fnnq_torchrl.equations.normalisation.RewardScale`);
      ``situations`` and ``steps``, the numbers of situations and steps learned from so far;
      ``diverged``, whether |Q| has become too large, after which the run counts no more steps;
      ``over``, whether the run has ended; and ``snapshot``, the weights and counts at the time when
      an evaluation was last due, with the numbers that the evaluation tells as ``told``, among them
      ``alpha``. Optional entries: ``fired`` (with ``count_firing``), the rules' firing strengths
      ∂Q(s, a)/∂w, summed over the steps that the run has learned from; ``earned`` (with
      ``count_earned``), the sum of rewards (``return``) and the number of successes since the
      snapshot before; ``adaptive`` (with ``adaptive``), the state of the scheme; and ``watch``, if
      the world states the best mean reward of a step: how close the run has come to it since the
      snapshot before (:class:`.watch.Watch`).

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
        scale_rewards: learn from scaled rewards; ``earned`` has the world's.
        adaptive: the scheme that changes α, the temperature or γ, if any.

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
        scale_rewards: bool = False,
        adaptive: Adaptive | None = None,
    ) -> None:
        self.env = env
        self.policy = make_policy(exploration, value_network, 0.0)  # `step` sets the amount
        bootstrap = rule.variant.bootstrap
        self.loss = PengQLambdaLoss(value_network, gamma=1.0, bootstrap=bootstrap)  # `step` sets γ
        self._scales = scale_rewards
        if scale_rewards:
            self.loss.set_keys(reward="scaled_reward")
        self.step_size = step_size
        self.evaluate_every = evaluate_every
        self._agent = _Agent(env, self.policy, self.loss)
        self._update = Update(self.loss, rule)
        self._count_firing, self._count_earned = count_firing, count_earned
        self._adaptive, self._watch = adaptive, Watch.of(env)
        like = value_network.candidates
        self._learns = {name: mask.to(like) for name, mask in (learns or {}).items()}
        self.largest_value = min(largest_value, torch.finfo(value_network.candidates.dtype).max)

    def begin(self, run: TensorDictBase) -> TensorDict:
        """Return the state before the first step: the network's start weights and a zero trace."""
        network = self.loss.value_network
        start = network.start(run["seed"])
        weights = {name: _copy(weight) for name, weight in start.items()}
        learned, before = self._apart(weights)
        kept = self.step_size.start(per_run(run["alpha"]), [*map(runs_last, learned.values())])
        zero = torch.zeros_like(run["seed"])  # cloned, because entries must not share memory
        batch = {"batch_size": run.batch_size, "device": run.device}
        alpha = run["alpha"].clone()
        further = {"fired": torch.zeros_like(weights["weight"])} if self._count_firing else {}
        if self._chooses_ahead:
            further["action"] = torch.zeros_like(run["alpha"])
        if self._count_earned:
            none = {"return": torch.zeros_like(run["alpha"]), "success": zero.clone()}
            further["earned"] = TensorDict(none, **batch)
        if self._scales:
            nothing = {key: torch.zeros_like(run["alpha"]) for key in ("trace", *Moments._fields)}
            further["reward_scale"] = TensorDict(nothing, **batch)
        if self._adaptive is not None:
            further["adaptive"] = self._adaptive.start(run)
        if self._watch is not None:
            further["watch"] = self._watch.start(run)
        told = {name: number.clone() for name, number in self._told(alpha, further).items()}
        world = self.env.start(run["seed"].clone(), zero.clone())
        first = network.observed(world.copy().update(before))
        return TensorDict(
            {
                "world": world,
                "weights": TensorDict(learned | first, **batch),
                "trace": TensorDict(self._update.start(learned), **batch),
                "alpha": alpha,
                **self._keeping(kept, learned, **batch),
                "situations": zero.clone(),
                "steps": zero.clone(),
                "diverged": torch.zeros_like(zero, dtype=torch.bool),
                "over": torch.zeros_like(zero, dtype=torch.bool),
                "snapshot": TensorDict(
                    {
                        "weights": TensorDict({k: _copy(w) for k, w in weights.items()}, **batch),
                        "situations": zero.clone(),
                        "steps": zero.clone(),
                        "told": TensorDict(told, **batch),
                    },
                    **batch,
                ),
                **further,
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
        before, statistics = self._apart(state["weights"])
        slope, (transition, rates, errors) = self._experienced(run, before, statistics, state)
        decay = rates.gamma * run["lam"]
        after = transition["next"]
        step = self._update.step(
            transition,
            errors,
            slope,
            state["trace"],
            decay,
            error_slope=partial(self._error_slope, before, rates.gamma, slope, after),
            alpha=rates.alpha,
            of_all=self._slope_of_all(before, transition),
        )
        credited, sizes, alpha, kept = self.step_size.update(
            per_run(rates.alpha),
            {name: per_run(run[name]) for name in self.step_size.numbers},
            self._kept(state, before),
            step,
        )
        weights = {
            name: runs_first(runs_last(weight) + self._size_of(name, size) * direction)
            for (name, weight), size, (direction, _) in zip(
                before.items(), sizes, credited, strict=True
            )
        }
        alpha = decayed(alpha.unsqueeze(-1), run["alpha_decay"], after["success"])
        further = self._further(state, slope, after, rates.adaptive)
        world = self.env.restart(after)
        weights |= self._statistics_after(after, world)
        return TensorDict(
            {
                "world": world,
                "weights": weights,
                "trace": self._update.updated(credited, errors, before).trace,
                "alpha": alpha,
                **self._keeping(kept, before),
                **self._counts(run, state, transition, weights, alpha, further),
            },
            batch_size=state.batch_size,
            device=state.device,
        )

    def _apart(self, weights: Weights) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Return the weights that have a trace, and the network's statistics."""
        names = self.loss.value_network.statistics
        learned = {name: weight for name, weight in weights.items() if name not in names}
        return learned, {name: weights[name] for name in names}

    def _statistics_after(self, after: TensorDictBase, world: TensorDictBase) -> dict[str, Tensor]:
        """Return the statistics after a step, with the first observations of new episodes."""
        network, done = self.loss.value_network, after["done"]
        before = {name: after[name] for name in network.statistics}
        again = network.observed(world.copy().update(before))
        return {name: torch.where(done, new, before[name]) for name, new in again.items()}

    @property
    def _chooses_ahead(self) -> bool:
        return self._update.rule.variant.bootstrap == "chosen"

    def _further(
        self,
        state: TensorDictBase,
        slope: Weights,
        after: TensorDictBase,
        adaptive: TensorDictBase | None,
    ) -> dict[str, Any]:
        """Return the state's optional entries after a step."""
        further: dict[str, Any] = {}
        if self._count_firing:
            goes_on = over_batch(state["over"].logical_not(), like=state["fired"])
            further["fired"] = state["fired"] + goes_on * slope["weight"]
        if self._chooses_ahead:
            further["action"] = after["action"]
        if self._count_earned:
            new = {"return": after["reward"], "success": after["success"].to(torch.int64)}
            further["earned"] = {key: state["earned", key] + new[key] for key in new}
        if self._scales:
            further["reward_scale"] = after["reward_scale"]
        if adaptive is not None:
            further["adaptive"] = adaptive
        if self._watch is not None:
            further["watch"] = self._watch.update(state["watch"], after)
        return further

    def _counts(
        self,
        run: TensorDictBase,
        state: TensorDictBase,
        transition: TensorDictBase,
        weights: Weights,
        alpha: Tensor,
        further: dict[str, Any],
    ) -> dict[str, Any]:
        """Return the counts after a step, and the snapshot, replaced where an evaluation is due.

        Args:
            run, state: the runs, and their state before the step.
            transition: the step.
            weights, alpha: those after the step.
            further: the optional entries after the step. They are returned, too; what they sum up
                from one evaluation to the next begins again.
        """
        within = self._within(transition["action_value"])
        diverged = state["diverged"] | ~(within | state["over"])
        goes_on = ~diverged
        situations = state["situations"] + (self._ended(state, transition["next"]) & goes_on)
        steps = state["steps"] + goes_on
        snapshot = state["snapshot"]
        due = situations == snapshot["situations"] + self.evaluate_every
        told = self._told(alpha, further)
        if self._count_earned:
            sums = further["earned"]
            further["earned"] = {key: torch.where(due, 0, sum_) for key, sum_ in sums.items()}
        if self._watch is not None:
            further["watch"] = self._watch.renewed(further["watch"], due)
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
                "told": {
                    name: torch.where(due, number, snapshot["told", name])
                    for name, number in told.items()
                },
            },
            **further,
        }

    def _ended(self, state: TensorDictBase, after: TensorDictBase) -> Tensor:
        """Return whether a situation has ended with a step, bool ``[runs, 1]``."""
        of_situation = self.env.world.steps_of_situation
        if of_situation is None:
            return after["done"]
        return after["step"] >= (state["situations"] + 1) * of_situation

    def _told(self, alpha: Tensor, further: Mapping[str, Any]) -> dict[str, Tensor]:
        """Return the numbers that a snapshot has besides the weights and counts, ``[runs, 1]``."""
        told = {"alpha": alpha, **further.get("earned", {})}
        if self._adaptive is not None:
            told |= self._adaptive.told(further["adaptive"])
        if self._watch is not None:
            told |= self._watch.told(further["watch"])
        return told

    def _within(self, action_value: Tensor) -> Tensor:
        """Return where all |Q| are at most ``largest_value``, false for NaN, ``[runs, 1]``."""
        return action_value.abs().flatten(1).amax(-1, keepdim=True) <= self.largest_value

    def _size_of(self, name: str, size: Tensor) -> Tensor:
        """Return the step size of the weights with this name, 0 for weights that don't learn."""
        return size * self._learns[name].unsqueeze(-1) if name in self._learns else size

    def _kept(self, state: TensorDictBase, names: Iterable[str]) -> State:
        """Return what the step size remembers, for the equations."""
        if "step_size" not in state:
            return {}
        return {
            key: [runs_last(of[name]) for name in names] for key, of in state["step_size"].items()
        }

    def _keeping(self, kept: State, names: Iterable[str], **batch: Any) -> dict[str, Any]:
        """Return the entry ``step_size`` of the state; none if nothing is remembered."""
        if not kept:
            return {}
        by_name = {
            key: dict(zip(names, map(runs_first, tensors), strict=True))
            for key, tensors in kept.items()
        }
        return {"step_size": TensorDict(by_name, **batch) if batch else by_name}

    def _experienced(
        self,
        run: TensorDictBase,
        weights: dict[str, Tensor],
        statistics: dict[str, Tensor],
        state: TensorDictBase,
    ) -> tuple[dict[str, Tensor], _Experience]:
        """Return each run's ∇Q(s, a), by autograd, and its step of the world with the errors."""
        adaptive = state.get("adaptive", {})
        name = self.policy.amount_name
        amount = adaptive.get(name, None)
        if amount is None:
            amount = self.policy.amount(run, state["steps"])
        numbers = {f"policy.{name}": amount}
        rates = partial(self._rates, run, state)
        ahead, scale = state.get("action", None), state.get("reward_scale", None)
        given = state["world"].copy(), rates, ahead, scale

        def chosen_value(weights: dict[str, Tensor]) -> tuple[Tensor, _Experience]:
            # The policy has the same network as the loss, so these weights are replaced in both.
            of_network = weights | statistics
            named = {f"loss.value_network.{name}": each for name, each in of_network.items()}
            experience: _Experience = functional_call(
                self._agent, named | numbers, given, tie_weights=False
            )
            return experience.errors.chosen_value, experience

        return gradient(chosen_value, weights)

    def _rates(self, run: TensorDictBase, state: TensorDictBase, after: TensorDictBase) -> _Rates:
        """Return α and γ of a step, which an adaptive scheme changes before the update."""
        if self._adaptive is None:
            return _Rates(state["alpha"], run["gamma"], None)
        ended = self._ended(state, after)
        changed, alpha = self._adaptive.update(
            run, state["adaptive"], state["alpha"], after["reward"], ended, state["steps"]
        )
        return _Rates(alpha, changed.get("gamma", run["gamma"]), changed)

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
            given = weights | {name: after[name] for name in network.statistics}

            def values(action: Tensor | None) -> Tensor:
                found: Tensor = functional_call(network, given, observations, {"action": action})
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
