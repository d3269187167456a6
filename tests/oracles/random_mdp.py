"""A small random Markov decision process, once as a TorchRL environment and once in plain Python.

Both draw the same random words, so their histories are equal.
"""

import random

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Composite, Unbounded

from envs.core import streams
from envs.core.pure import WHEN, PureEnv
from envs.core.streams import Stream

from .pcg import draw
from .peng import Arrival

STATES, ACTIONS, BRANCHES = 5, 3, 4
ONE_IN_SO_MANY_STEPS_TERMINATES = 8
TRUNCATED_AFTER_STEPS = 9

_random = random.Random(1)
# The states are equally likely to follow, by [state][action][branch].
SUCCESSORS = [
    [[_random.randrange(STATES) for _ in range(BRANCHES)] for _ in range(ACTIONS)]
    for _ in range(STATES)
]
REWARDS = [[_random.choice([-0.7, 0.0, 0.3]) for _ in range(ACTIONS)] for _ in range(STATES)]
END_REWARD = 1.1


class RandomMDP(PureEnv):
    """States are the places 0, 1, … on a line, actions are evenly spaced in [−1, 1].

    An episode terminates by chance, wherever that leads to, and is truncated after some steps.
    """

    def __init__(self, runs: int) -> None:
        super().__init__([runs], seed=0, dtype=torch.float64, device=None)
        shape = (runs, 1)
        real = {"shape": shape, "dtype": self.dtype}
        state = {key: Unbounded(shape, dtype=torch.int64) for key in WHEN}
        seen = {"place": Unbounded(**real), "chance": Bounded(0, 1, **real)}
        flags = {key: Binary(1, shape, dtype=torch.bool) for key in ("done", "terminated")}
        self.state_spec = Composite(state, shape=[runs])
        self.observation_spec = Composite(seen | state, shape=[runs]).clone()
        self.action_spec = Bounded(-1, 1, **real)
        self.reward_spec = Unbounded(**real)
        self.done_spec = Composite(flags, shape=[runs])

    def start(self, seed: Tensor, episode: Tensor) -> TensorDict:
        step = torch.zeros_like(episode)
        words = _unsigned(streams.draw(seed, episode, step, Stream.START))
        place = words[0] % STATES
        return self._pack(place, words, {"seed": seed, "episode": episode, "step": step})

    def _step(self, tensordict: TensorDictBase) -> TensorDict:
        when = {key: tensordict[key] for key in WHEN} | {"step": tensordict["step"] + 1}
        words = _unsigned(streams.draw(*when.values(), Stream.STEP))
        place = tensordict["place"].long()
        action = ((tensordict["action"] + 1) / 2 * (ACTIONS - 1)).round().long()
        after = torch.tensor(SUCCESSORS)[place, action, words[0] % BRANCHES]
        terminated = words[1] % ONE_IN_SO_MANY_STEPS_TERMINATES == 0
        reward = torch.tensor(REWARDS, dtype=self.dtype)[place, action]
        outcome = {
            "reward": reward.masked_fill(terminated, END_REWARD),
            "terminated": terminated,
            "done": terminated | (when["step"] >= TRUNCATED_AFTER_STEPS),
        }
        return self._pack(after, words, when | outcome)

    def _pack(
        self, place: Tensor, words: tuple[Tensor, ...], others: dict[str, Tensor]
    ) -> TensorDict:
        chance = streams.uniform(words[2], self.dtype)
        return self.pack({"place": place.to(self.dtype), "chance": chance} | others)


class Walk:
    """A run of the same process, step by step."""

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def start(self, episode: int) -> tuple[int, float]:
        words = draw(self.seed, episode, 0, Stream.START)
        return words[0] % STATES, _uniform(words[2])

    def move(self, state: int, action: int, episode: int, step: int) -> Arrival:
        words = draw(self.seed, episode, step, Stream.STEP)
        after = SUCCESSORS[state][action][words[0] % BRANCHES]
        terminated = words[1] % ONE_IN_SO_MANY_STEPS_TERMINATES == 0
        return Arrival(
            reward=END_REWARD if terminated else REWARDS[state][action],
            state=after,
            terminated=terminated,
            done=terminated or step >= TRUNCATED_AFTER_STEPS,
            chance=_uniform(words[2]),
        )


def _unsigned(words: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
    return tuple(word.long() % 2**32 for word in words)


def _uniform(word: int) -> float:
    return (word >> 8) / 2**24
