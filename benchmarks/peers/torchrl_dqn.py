"""TorchRL's DQN, of its own loss, collector, replay buffer and exploration.

python -m benchmarks.peers.torchrl_dqn --seed 0 --steps 12000 --learning-rate 1e-3
"""

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torch import Tensor, nn
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import ActionDiscretizer, Compose, InitTracker, SqueezeTransform, TransformedEnv
from torchrl.modules import MLP, EGreedyModule, QValueActor
from torchrl.objectives import DQNLoss, SoftUpdate

from envs.robot.follow import FollowBall

from .dqn import Settings, command_line
from .runs import Run, versions_of
from .task import EVERY, Diary, WorldClock, score, task


class EvenActions(ActionDiscretizer):
    """The candidates by their index, both ends of the range among them."""

    def custom_arange(self, nint: int, device: torch.device | None) -> Tensor:
        return torch.linspace(0, 1, nint, device=device)


def discrete(world: FollowBall, candidates: int) -> TransformedEnv:
    """The world with the indices of the candidates for actions."""
    scalar = SqueezeTransform(-1, in_keys=[], in_keys_inv=["action"])
    return TransformedEnv(world, Compose(InitTracker(), scalar, EvenActions(candidates)))


def learned_from(collected: TensorDictBase) -> TensorDictBase:
    """Return the entries that the loss needs, without the state of the world."""
    keys = ("bearing", "reward", "done", "terminated")
    return collected.select("bearing", "action", *(("next", key) for key in keys))


def learn(settings: Settings, seed: int, steps: int) -> Run:
    config = task()
    torch.manual_seed(seed)  # of weights, exploration and samples; the world's is its own
    world = FollowBall(config.env, seed=seed)
    clock = WorldClock(world)
    env = discrete(world, config.action.candidates)
    network = MLP(
        in_features=1,
        out_features=config.action.candidates,
        num_cells=settings.hidden,
        activation_class=nn.ReLU,
    )
    actor = QValueActor(network, in_keys=["bearing"], spec=env.action_spec)
    explore = EGreedyModule(env.action_spec, 1.0, settings.epsilon, settings.anneal)
    loss = DQNLoss(actor, loss_function="smooth_l1", action_space=env.action_spec)
    loss.make_value_estimator(gamma=config.gamma)
    target = SoftUpdate(loss, tau=settings.tau)
    optimizer = torch.optim.Adam(loss.parameters(), lr=settings.learning_rate)
    buffer = TensorDictReplayBuffer(
        storage=LazyTensorStorage(settings.buffer), batch_size=settings.batch
    )
    collector = Collector(
        env,
        TensorDictSequential(actor, explore),
        frames_per_batch=settings.collect,
        total_frames=steps,
        init_random_frames=settings.warm_up,
        postproc=learned_from,
    )

    diary, done = Diary(), 0
    diary.note(0, network)
    for collected in collector:
        done += collected.numel()
        buffer.extend(collected)
        explore.step(collected.numel())
        if done > settings.warm_up:
            for _ in range(settings.collect):
                optimizer.zero_grad()
                loss(buffer.sample())["loss"].backward()
                nn.utils.clip_grad_norm_(loss.parameters(), settings.gradient_norm)
                optimizer.step()
                target.step()
        if done % EVERY == 0:
            diary.note(done, network)
    collector.shutdown()
    catches = score(diary.networks, seed, config)
    versions = versions_of("torchrl", "tensordict", "torch")
    return Run(seed, diary.steps, diary.seconds, catches, versions, world_seconds=clock.seconds)


if __name__ == "__main__":
    command_line(learn)
