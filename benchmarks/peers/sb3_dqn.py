"""Stable-Baselines3's DQN, through Gymnasium; runs in an environment of its own.

python -m benchmarks.peers.sb3_dqn --seed 0 --steps 12000 --learning-rate 1e-3
"""

import warnings

from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_checker import check_env

from envs.gymnasium import GymWorld

from .dqn import Settings, command_line
from .runs import Run, versions_of
from .task import EVERY, Diary, WorldClock, score, task


class Snapshots(BaseCallback):
    """A callback that keeps a copy of the network before learning, and then regularly."""

    diary: Diary

    def _on_training_start(self) -> None:
        self.diary = Diary()
        self.diary.note(0, self.model.q_net)

    def _on_step(self) -> bool:
        if self.num_timesteps % EVERY == 0:
            self.diary.note(self.num_timesteps, self.model.q_net)
        return True


def learn(settings: Settings, seed: int, steps: int) -> Run:
    config = task()
    env = GymWorld(config.env, config.action.candidates)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # its checker's advice counts as an error too
        check_env(env)
    clock = WorldClock(env.world)
    model = DQN(
        "MlpPolicy",
        env,
        learning_rate=settings.learning_rate,
        buffer_size=settings.buffer,
        learning_starts=settings.warm_up,
        batch_size=settings.batch,
        tau=settings.tau,
        target_update_interval=1,
        gamma=config.gamma,
        train_freq=settings.collect,
        gradient_steps=settings.collect,
        exploration_fraction=settings.anneal / steps,
        exploration_final_eps=settings.epsilon,
        max_grad_norm=settings.gradient_norm,
        policy_kwargs={"net_arch": list(settings.hidden)},
        seed=seed,
        device="cpu",
    )
    snapshots = Snapshots()
    model.learn(steps, callback=snapshots)
    diary = snapshots.diary
    catches = score(diary.networks, seed, config)
    versions = versions_of("stable_baselines3", "gymnasium", "torch")
    return Run(seed, diary.steps, diary.seconds, catches, versions, world_seconds=clock.seconds)


if __name__ == "__main__":
    command_line(learn)
