"""What every environment of this kind promises about seeds, episodes and resets."""

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Composite, Unbounded
from torchrl.envs import check_env_specs

from envs.core import streams
from envs.core.pure import WHEN, PureEnv
from envs.core.streams import Stream


class Lottery(PureEnv):
    """The least that there is to it: a ticket a step, and one in eight ends the episode."""

    def __init__(self, batch_size=(), seed=0, dtype=torch.float64, device=None):
        super().__init__(batch_size, seed, dtype, device)
        shape = (*self.batch_size, 1)
        spec = {"shape": shape, "device": self.device}
        when = {key: Unbounded(dtype=torch.int64, **spec) for key in WHEN}
        ticket = Unbounded(dtype=dtype, **spec)
        self.state_spec = Composite(when, shape=self.batch_size)
        self.observation_spec = Composite(when, ticket=ticket, shape=self.batch_size).clone()
        self.action_spec = ticket.clone()
        self.reward_spec = ticket.clone()
        self.done_spec = Composite(
            {key: Binary(1, dtype=torch.bool, **spec) for key in ("done", "terminated")},
            shape=self.batch_size,
        )

    def start(self, seed: Tensor, episode: Tensor) -> TensorDict:
        words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        ticket = streams.uniform(words[0], self.dtype)
        when = {"seed": seed, "episode": episode, "step": torch.zeros_like(episode)}
        return self.pack(when | {"ticket": ticket})

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        when = {key: tensordict[key] for key in WHEN}
        when["step"] = when["step"] + 1
        ticket = streams.uniform(streams.draw(*when.values(), Stream.STEP)[0], self.dtype)
        end = {"terminated": ticket < 1 / 8, "done": ticket < 1 / 8}
        return self.pack(when | end | {"ticket": ticket, "reward": ticket.clone()})


def play(env: PureEnv, steps: int) -> TensorDictBase:
    """The states of all runs, with TorchRL's own resets, ``[*batch, steps]``."""
    return env.rollout(steps, break_when_any_done=False).select(*WHEN, "ticket")


def runs(env: PureEnv) -> list[tuple[int, int]]:
    """Which episode of which seed each run begins with."""
    start = env.reset()
    return list(
        zip(start["seed"].flatten().tolist(), start["episode"].flatten().tolist(), strict=True)
    )


@pytest.mark.parametrize("batch_size", [(), (3,), (2, 3)])
@pytest.mark.parametrize("break_when_any_done", [True, False])
def test_it_is_an_env(batch_size, break_when_any_done):
    check_env_specs(Lottery(batch_size), break_when_any_done=break_when_any_done)


def test_it_knows_of_no_fewest_steps():
    assert Lottery().fewest_steps == 1


# -- seeds ----------------------------------------------------------------------------------------


def test_an_integer_seeds_the_runs_one_after_the_other():
    assert runs(Lottery([3], seed=5)) == [(5, 0), (6, 0), (7, 0)]
    assert Lottery([2, 3], seed=5).reset()["seed"].tolist() == [[[5], [6], [7]], [[8], [9], [10]]]
    assert runs(Lottery([], seed=2**40)) == [(2**40, 0)]


@pytest.mark.parametrize("batch_size", [(), (4,), (2, 2)])
def test_every_run_can_have_a_seed_of_its_own(batch_size):
    seed = torch.randint(2**62, batch_size, generator=torch.Generator().manual_seed(0))
    start = Lottery(batch_size, seed=seed).reset()
    assert start["seed"].equal(seed.unsqueeze(-1))


def test_set_seed_begins_everything_again():
    env = Lottery([3], seed=5)
    first = play(env, 50)
    assert not (play(env, 50)["episode"] == first["episode"]).any()  # it went on, rather
    env.set_seed(5)
    assert (play(env, 50) == first).all()
    env.set_seed(6)
    assert (play(env, 50)[:2] == first[1:]).all()
    env.set_seed(None)
    assert env.reset()["seed"].flatten().tolist() == [6, 7, 8]


def test_what_others_do_to_a_tensor_that_they_gave_or_got_changes_nothing():
    seed = torch.tensor([5, 6])
    env = Lottery([2], seed=seed)
    for episode in range(3):
        start = env.reset()
        assert start["seed"].flatten().tolist() == [5, 6]
        assert start["episode"].flatten().tolist() == [episode, episode]
        for tensor in (seed, *start.values()):
            tensor.zero_()


def test_the_state_dict_says_where_the_runs_are():
    env, other = Lottery([3], seed=5), Lottery([3], seed=9)
    play(env, 50)
    other.load_state_dict(env.state_dict())
    assert (play(other, 50) == play(env, 50)).all()


# -- resets ---------------------------------------------------------------------------------------


def test_a_reset_begins_the_next_episode_of_every_run():
    env = Lottery([2], seed=5)
    for episode in range(4):
        assert runs(env) == [(5, episode), (6, episode)]


def test_a_partial_reset_leaves_the_other_runs_alone():
    env = Lottery([3], seed=5)
    before = env.rand_step(env.reset())["next"]
    due = torch.tensor([[False], [True], [False]])
    after = env.reset(before.clone().set("_reset", due))
    assert after["episode"].flatten().tolist() == [0, 1, 0]
    assert after["step"].flatten().tolist() == [1, 0, 1]
    others = [0, 2]
    assert (after[others] == before[others]).all()
    assert runs(env) == [(5, 1), (6, 2), (7, 1)]


@pytest.mark.parametrize("batch_size", [(), (3,), (2, 3)])
def test_restart_does_what_reset_does(batch_size):
    """TorchRL's loop, which branches on the data, and the loop that compiles: the same history."""
    env = Lottery(batch_size, seed=5)
    history = play(env, 100)
    assert (history["episode"] > 2).any()
    state = env.start(history["seed"][..., 0, :], history["episode"][..., 0, :])
    for step in range(100):
        assert (state == history[..., step]).all()
        state = env.restart(env.step(state)["next"])


def test_an_episode_starts_the_same_whatever_came_before():
    history = play(Lottery([8]), 100)
    first = history[history["step"].squeeze(-1) == 0]
    assert len(first) > 50
    env = Lottery(first.batch_size)
    assert (env.start(first["seed"], first["episode"]) == first).all()
