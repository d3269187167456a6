"""The step that the page repeats, in JavaScript: a greedy action, then a step of the world."""

from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torch.func import functional_call

from envs.core.pure import PureEnv
from envs.core.world import WorldConfig
from envs.robot.played import PLAYED
from fnnq_torchrl.agent.gradient import gradient
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.values import FNNQValue, ValueNetwork
from fnnq_torchrl.engine.graphs import leaves
from fnnq_torchrl.engine.loops import Step
from fnnq_torchrl.engine.native.javascript import ARRAYS, module
from fnnq_torchrl.engine.native.translation import written_out


@dataclass(frozen=True)
class Program:
    """A step in JavaScript, and its leaves: the arrays that the step reads and writes.

    Attributes:
        text: the module, which exports ``step(leaf)``.
        leaves: the name of each leaf (such as ``weights/weight`` or ``world/x_m``), the JavaScript
            class of its array, and its numbers before the first step.
    """

    text: str
    leaves: list[tuple[str, str, list[float]]]


@torch.no_grad()
def write_program(world: WorldConfig, network: ValueNetwork, seed: int) -> Program:
    """Write the step of a network's greedy policy in a world with objects that can be moved.

    Args:
        world: the parameters of the world, which is one of :data:`envs.robot.played.PLAYED`.
        network: the network, with one run's weights.
        seed: the seed of the world's random numbers.

    Raises:
        Unsupported: if an operation of the step has no translation.
    """
    step, stays, state = make_step(world, network, seed)
    numbers = {**leaves(stays), **leaves(state)}
    return Program(
        module(written_out(step, stays, state)),
        [
            (name, ARRAYS[leaf.dtype], leaf[..., 0].flatten().tolist())
            for name, leaf in numbers.items()
        ],
    )


def make_step(
    world: WorldConfig, network: ValueNetwork, seed: int
) -> tuple[Step, TensorDict, TensorDict]:
    """Return the step of two runs, its constant inputs and the state before the first step.

    Besides ``world``, the state has ``action``, ``action_value`` of all candidates (its sum over
    the rules, if each rule chooses an action), ``done`` and ``success``. For a network with rules
    of state and action the state also has ``fired``, the strength with which each rule fired for
    the action, in the shape of the consequents.

    Args:
        world, network, seed: as in :func:`write_program`.
    """
    dtype = network.candidates.dtype
    env = PLAYED[world.kind](world, [2], seed=torch.full([2], seed), dtype=dtype)
    start = env.reset()
    weights, real = network.start(start["seed"]), torch.zeros_like(start["chance"])
    no = torch.zeros_like(real, dtype=torch.bool)
    told = {
        "action": real.clone(),
        "action_value": real.new_zeros(2, len(network.candidates)),
        "done": no,
        "success": no.clone(),
    }
    if isinstance(network, FNNQValue):
        told["fired"] = torch.zeros_like(weights["weight"])
    kept = [*map(str, env.state_spec.keys()), "chance"]
    stays = TensorDict({"weights": weights, "epsilon": real}, [2])
    state = TensorDict({"world": start.select(*kept), **told}, [2])
    return _step(env, network), stays, state


def _step(env: PureEnv, network: ValueNetwork) -> Step:
    policy = EpsilonGreedyPolicy(network, epsilon=0.0)

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        weights = dict(stays["weights"].items())
        acted = act(policy, weights, stays["epsilon"], state["world"])
        observations = [state["world"][key] for key in network.in_keys]

        def value(weights: dict[str, Tensor]) -> tuple[Tensor, None]:
            chosen = functional_call(
                network, weights, (*observations,), {"action": acted["action"]}
            )
            return chosen.sum(), None

        after = env.step(acted)["next"]
        action_value = acted["action_value"].view(2, -1, len(network.candidates)).sum(1)
        told = {"action": acted["action"], "action_value": action_value}
        told |= {key: after[key] for key in ("done", "success")}
        if "fired" in state:
            told["fired"] = gradient(value, weights)[0]["weight"]
        world_after = after.select(*state["world"].keys())
        return TensorDict({"world": world_after, **told}, state.batch_size)

    return step
