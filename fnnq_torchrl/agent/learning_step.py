"""A learning step of a batch of runs, as a function from TensorDicts to TensorDicts."""

from collections.abc import Mapping
from functools import partial

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch.func import functional_call

from envs.core.pure import PureEnv
from fnnq_torchrl.agent.adaptive import Adaptive
from fnnq_torchrl.agent.experience import Acting
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.agent.policy import ExploringPolicy, make_policy
from fnnq_torchrl.agent.progress import Progress, copied
from fnnq_torchrl.agent.records import Earned, Fired, Record
from fnnq_torchrl.agent.reward_scaling import RewardScaling
from fnnq_torchrl.agent.slopes import error_slope, slope_of_all
from fnnq_torchrl.agent.update import Update, Weights
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.agent.watch import Watch
from fnnq_torchrl.agent.weight_step import WeightStep
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import StepSize, decayed


class Learner:
    """A batch of runs that learn with Q(λ) on a world, each run independently of the others.

    A run is one learner with one seed. A situation is an episode. Two TensorDicts of batch size
    ``[runs]`` hold everything that differs from run to run:

    * ``run`` never changes. Its entries, each ``[runs, 1]``, are ``seed``, ``lam``, ``alpha``,
      ``alpha_decay``, ``gamma``, the ``numbers`` of the step size, the amount of exploration
      under its own name, such as ``epsilon``, and ``situations``, the number of situations to learn
      from. If ε is annealed, there are ``epsilon_final`` and ``epsilon_over``, too.
    * ``state`` is replaced by every step. Its entries are ``world``, the environment's state;
      ``weights`` and ``trace``, by the names of the network's parameters (among the ``weights``
      there are also the network's ``statistics``, which have no trace); ``alpha``, the current step
      size, or the mean of the weights' own; and ``situations``, ``steps``, ``diverged``, ``over``
      and ``snapshot`` (:class:`.progress.Progress`).
    * Optional entries of ``state`` are ``action``, ``reward_scale`` and ``adaptive``
      (:class:`.experience.Acting`); ``step_size`` (:class:`.weight_step.WeightStep`); and the
      records ``fired``, ``earned`` and ``watch`` (:class:`.records.Record`).

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
        self._network = value_network
        self.policy = make_policy(exploration, value_network, 0.0)  # a step sets the amount
        bootstrap = rule.variant.bootstrap
        self.loss = PengQLambdaLoss(value_network, gamma=1.0, bootstrap=bootstrap)  # and γ
        self.evaluate_every = evaluate_every
        like = value_network.candidates
        masks = {name: mask.to(like) for name, mask in (learns or {}).items()}
        scaling = RewardScaling() if scale_rewards else None
        self._acting = Acting(env, self.policy, self.loss, scaling, adaptive)
        self._update = Update(self.loss, rule)
        self._weight_step = WeightStep(step_size, masks)
        records = Fired() if count_firing else None, Earned() if count_earned else None
        kept: list[Record] = [each for each in (*records, Watch.of(env)) if each is not None]
        self.largest_value = min(largest_value, torch.finfo(like.dtype).max)
        self._progress = Progress(env, kept, evaluate_every, self.largest_value)

    def begin(self, run: TensorDictBase) -> TensorDict:
        """Return the state before the first step: the network's start weights and a zero trace."""
        network, batch = self._network, {"batch_size": run.batch_size}
        start = {name: copied(weight) for name, weight in network.start(run["seed"]).items()}
        weights, statistics = self._apart(start)
        alpha = run["alpha"].clone()
        world = self.env.start(run["seed"].clone(), torch.zeros_like(run["seed"]))
        first = network.observed(world.copy().update(statistics))
        carried = self._acting.start(run)
        told = {"alpha": alpha, **self._acting.told(carried)}
        return TensorDict(
            {
                "world": world,
                "weights": TensorDict(weights | first, **batch),
                "trace": TensorDict(self._update.start(weights), **batch),
                "alpha": alpha,
                **self._weight_step.start(run, weights),
                **carried,
                **self._progress.start(run, start, told),
            },
            **batch,
            device=run.device,
        )

    def step(self, run: TensorDictBase, state: TensorDictBase) -> TensorDict:
        """Take one step in every run's world, learn from it and return the new state.

        It does the paper's Table 1. When a situation ends after which an evaluation is due, the
        run's weights and counts are stored in ``snapshot``. The caller must read a snapshot before
        the next one replaces it, which takes at least ``fewest_steps · evaluate_every`` steps
        (:class:`envs.core.world.WorldConfig`).
        """
        # These are read many times, and a dict is read faster than a TensorDict.
        fixed, old = dict(run.items()), dict(state.items())
        before, statistics = self._apart(old["weights"])
        slope, experience = self._acting.experience(fixed, old, before, statistics)
        transition, errors, alpha, gamma, carried = experience
        after = transition["next"]
        step = self._update.step(
            transition,
            errors,
            slope,
            old["trace"],
            gamma * fixed["lam"],
            error_slope=partial(error_slope, self.loss, before, gamma, slope, after),
            alpha=alpha,
            of_all=self._slope_of_all(before, transition),
        )
        moved = self._weight_step.update(fixed, old, before, alpha, step)
        alpha = decayed(moved.alpha, fixed["alpha_decay"], after["success"])
        world = self.env.restart(after)
        weights = moved.weights | self._statistics_after(after, world)
        told = {"alpha": alpha, **self._acting.told(carried)}
        return TensorDict(
            {
                "world": world,
                "weights": weights,
                "trace": self._update.updated(moved.credited, errors, before).trace,
                "alpha": alpha,
                **moved.remembered,
                **carried,
                **self._progress.update(fixed, old, transition, slope, weights, told),
            },
            batch_size=state.batch_size,
            device=state.device,
        )

    def _apart(self, weights: Weights) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
        """Return the weights that have a trace, and the network's statistics."""
        names = self._network.statistics
        learned = {name: weight for name, weight in weights.items() if name not in names}
        return learned, {name: weights[name] for name in names}

    def _statistics_after(self, after: TensorDictBase, world: TensorDictBase) -> dict[str, Tensor]:
        """Return the statistics after a step, with the first observations of new episodes."""
        network, done = self._network, after["done"]
        if not network.statistics:
            return {}
        before = {name: after[name] for name in network.statistics}
        again = network.observed(world.copy().update(before))
        return {name: torch.where(done, new, before[name]) for name, new in again.items()}

    def _slope_of_all(
        self, weights: dict[str, Tensor], transition: TensorDictBase
    ) -> dict[str, Tensor] | None:
        """Return ∇ΣQ(s, ·), by name; None if the trace doesn't need it."""
        if not self._update.rule.trace.clears:
            return None
        return slope_of_all(self.loss, weights, transition)


def act(
    policy: ExploringPolicy,
    weights: Weights,
    amount: Tensor,
    world: TensorDictBase,
) -> TensorDictBase:
    """Return the world's TensorDict with the action that each run's weights choose."""
    overrides = {f"value_network.{name}": weight for name, weight in weights.items()}
    return functional_call(policy, overrides | {policy.amount_name: amount}, (world.copy(),))
