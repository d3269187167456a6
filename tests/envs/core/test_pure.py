"""The promises of every PureEnv about seeds, episodes and resets."""

from dataclasses import dataclass
from math import inf

import pytest
import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Unbounded
from torchrl.envs import check_env_specs

from envs.core import streams
from envs.core.pure import WHEN, PureEnv
from envs.core.streams import Stream
from envs.core.world import WorldConfig


@dataclass
class LotteryConfig(WorldConfig):
    """A configuration without parameters."""

    @property
    def observations(self):
        return {"ticket": (-inf, inf)}

    @property
    def actions(self):
        return 2


class Lottery(PureEnv):
    """The smallest PureEnv: each step draws a ticket, and one in eight ends the episode."""

    schema = LotteryConfig

    def __init__(self, batch_size=(), seed=0, dtype=torch.float64, limit=1000):
        super().__init__(LotteryConfig("lottery", limit), batch_size, seed=seed, dtype=dtype)

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None):
        words = streams.draw(seed, episode, torch.zeros_like(episode), Stream.START)
        return {"ticket": streams.uniform(words[0], self.dtype)}

    def transition(self, state, action: Tensor):
        words = streams.draw(*(state[key] for key in WHEN), Stream.STEP)
        ticket = streams.uniform(words[0], self.dtype)
        return {
            "ticket": ticket,
            "reward": ticket + action,
            "terminated": ticket < 1 / 8,
            "success": ticket < 1 / 16,
        }


def play(env: PureEnv, steps: int) -> TensorDictBase:
    """Return the states of all runs, with TorchRL's own resets, ``[*batch, steps]``."""
    return env.rollout(steps, break_when_any_done=False).select(*WHEN, "ticket")


def runs(env: PureEnv) -> list[tuple[int, int]]:
    """Return the seed and the episode with which each run begins."""
    start = env.reset()
    return list(
        zip(start["seed"].flatten().tolist(), start["episode"].flatten().tolist(), strict=True)
    )


@pytest.mark.parametrize("batch_size", [(), (3,), (2, 3)])
@pytest.mark.parametrize("break_when_any_done", [True, False])
def test_it_is_an_env(batch_size, break_when_any_done):
    check_env_specs(Lottery(batch_size), break_when_any_done=break_when_any_done)


def test_it_knows_of_no_fewest_steps():
    assert Lottery().world.fewest_steps == 1


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
    assert not (play(env, 50)["episode"] == first["episode"]).any()  # the episodes go on
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
    """TorchRL's loop, which branches on data, gives the same history as the compilable loop."""
    env = Lottery(batch_size, seed=5)
    history = env.rollout(100, break_when_any_done=False).exclude("next", "success")
    assert (history["episode"] > 2).any()
    state = env.start(history["seed"][..., 0, :], history["episode"][..., 0, :])
    for step in range(100):
        here = history[..., step]
        assert (state == here.select(*state.keys())).all()
        state = env.restart(env.step(state.set("action", here["action"]))["next"])


def test_the_next_state_is_that_of_a_step():
    env = Lottery((8,), seed=5, limit=4)
    state = env.reset()
    for _ in range(12):  # some episodes end by chance, others by the limit
        given = env.rand_action(state)
        after, of_step = env.next_state(given), env.step(given.copy())["next"]
        assert after.keys() == of_step.keys()
        assert (after == of_step).all()
        state = env.restart(after)
    assert state["episode"].min() > 1


def test_an_episode_starts_the_same_whatever_came_before():
    history = play(Lottery([8]), 100).exclude("success")
    first = history[history["step"].squeeze(-1) == 0]
    assert len(first) > 50
    env = Lottery(first.batch_size)
    start = env.start(first["seed"], first["episode"])
    assert (start.select(*first.keys()) == first).all()


# -- ends -----------------------------------------------------------------------------------------


def test_an_end_and_a_cut_are_told_apart():
    """A learner bootstraps at a cut and not at an end."""
    history = Lottery([200], limit=5).rollout(40, break_when_any_done=False)["next"]
    ended, cut = history["terminated"], history["truncated"]
    assert (history["done"] == (ended | cut)).all()
    assert not (ended & cut).any()
    assert (history["step"][cut] == 5).all()
    assert (history["step"] <= 5).all()
    assert (ended == (history["ticket"] < 1 / 8)).all()
    assert (history["success"] == (history["ticket"] < 1 / 16)).all()
    assert cut.any()


def test_a_world_that_says_nothing_of_success_has_none():
    class Joyless(Lottery):
        def transition(self, state, action):
            after = super().transition(state, action)
            del after["success"]
            return after

    history = Joyless([50]).rollout(40, break_when_any_done=False)
    assert history["next", "terminated"].any()
    assert not history["next", "success"].any()


def test_a_world_without_random_bits_to_spare_has_a_chance_all_the_same():
    chance = Lottery([500]).rollout(100, break_when_any_done=False)["chance"].flatten()
    assert chance.min() >= 0
    assert chance.max() < 1
    assert len(chance.unique()) > 0.99 * len(chance)
    assert abs(float(chance.mean()) - 0.5) < 0.01


# -- specs ----------------------------------------------------------------------------------------


def test_the_specs_are_what_the_configuration_offers():
    env = Lottery([3])
    assert isinstance(env.observation_spec["ticket"], Unbounded)
    assert isinstance(env.observation_spec["chance"], Bounded)
    assert isinstance(env.observation_spec["success"], Binary)
    assert isinstance(env.action_spec, Categorical)
    assert set(env.rand_action()["action"].flatten().tolist()) <= {0.0, 1.0}
    assert env.seen == ["ticket"]
