"""A small random Markov decision process, once as a TorchRL environment and once in plain Python.

Both draw the same random words, so their histories are equal.
"""

import random
from dataclasses import dataclass

import torch
from torch import Tensor

from envs.core import streams
from envs.core.pure import WHEN, PureEnv
from envs.core.streams import Stream
from envs.core.world import WorldConfig

from .pcg import draw
from .peng import Arrival

STATES, ACTIONS, BRANCHES = 5, 3, 4
ONE_IN_SO_MANY_STEPS_TERMINATES = 8
TRUNCATED_AFTER_STEPS = 9

_random = random.Random(1)
# The next states, by [state][action][branch]; all branches are equally likely.
SUCCESSORS = [
    [[_random.randrange(STATES) for _ in range(BRANCHES)] for _ in range(ACTIONS)]
    for _ in range(STATES)
]
REWARDS = [[_random.choice([-0.7, 0.0, 0.3]) for _ in range(ACTIONS)] for _ in range(STATES)]
END_REWARD = 1.1


@dataclass
class RandomMDPConfig(WorldConfig):
    """A configuration that has only a time limit."""

    @property
    def observations(self):
        return {"place": (0.0, STATES - 1.0)}

    @property
    def actions(self):
        return (-1.0, 1.0)


class RandomMDP(PureEnv):
    """States are the places 0, 1, … on a line, actions are evenly spaced in [−1, 1].

    An episode terminates by chance in any state, and is truncated at the time limit.
    """

    schema = RandomMDPConfig

    def __init__(self, runs: int) -> None:
        world = RandomMDPConfig("random_mdp", TRUNCATED_AFTER_STEPS)
        super().__init__(world, [runs], dtype=torch.float64)

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None):
        words = _unsigned(streams.draw(seed, episode, torch.zeros_like(episode), Stream.START))
        return self._entries(words[0] % STATES, words)

    def transition(self, state, action: Tensor):
        words = _unsigned(streams.draw(*(state[key] for key in WHEN), Stream.STEP))
        place = state["place"].long()
        action = ((action + 1) / 2 * (ACTIONS - 1)).round().long()
        after = torch.tensor(SUCCESSORS)[place, action, words[0] % BRANCHES]
        terminated = words[1] % ONE_IN_SO_MANY_STEPS_TERMINATES == 0
        reward = torch.tensor(REWARDS, dtype=self.dtype)[place, action]
        return self._entries(after, words) | {
            "reward": reward.masked_fill(terminated, END_REWARD),
            "terminated": terminated,
            "success": terminated & (after % 2 == 0),
        }

    def _entries(self, place: Tensor, words: tuple[Tensor, ...]) -> dict[str, Tensor]:
        chance = streams.uniform(words[2], self.dtype)
        return {"place": place.to(self.dtype), "chance": chance}


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
            success=terminated and after % 2 == 0,
            chance=_uniform(words[2]),
        )


def _unsigned(words: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
    return tuple(word.long() % 2**32 for word in words)


def _uniform(word: int) -> float:
    return (word >> 8) / 2**24
