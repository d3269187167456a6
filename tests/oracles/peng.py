"""Peng's Q(λ) for a table of states × actions, in plain Python: the twin of the learning step.

It is the paper's Table 1, after J. Peng, R. J. Williams, "Incremental multi-step Q-learning",
Machine Learning 22, 1996. These misprints are corrected: step f multiplies Tr by the error; V̂ is
the arg max of Q̂, and should be the max; Ŵ should be V̂.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

Table = list[list[float]]


class Arrival(NamedTuple):
    """The outcome of a step."""

    reward: float
    state: int
    terminated: bool
    done: bool
    success: bool
    chance: float


class World(Protocol):
    """The learner's world. It supplies the uniform random number of each choice, `chance`."""

    def start(self, episode: int) -> tuple[int, float]:
        """Return the first state, and the random number for the first choice."""

    def move(self, state: int, action: int, episode: int, step: int) -> Arrival:
        """Return the outcome of a step of the episode; steps count from 1."""


class Learned(NamedTuple):
    """The values of the learner after a step."""

    q: Table
    trace: Table
    alpha: float


def peng_q_lambda(
    world: World,
    states: int,
    actions: int,
    *,
    lam: float,
    alpha: float,
    alpha_decay: float,
    gamma: float,
    epsilon: float,
) -> Iterator[Learned]:
    """Yield the learner after each step, without end. Comments name the steps of Table 1."""
    q = [[0.0] * actions for _ in range(states)]  # 1
    trace = [[0.0] * actions for _ in range(states)]
    episode = 0
    while True:
        state, chance = world.start(episode)  # 2 a
        step, done = 0, False
        while not done:
            action = epsilon_greedy(q[state], epsilon, chance)  # b
            step += 1
            reward, after, terminated, done, success, chance = world.move(
                state, action, episode, step
            )  # c
            ahead = 0.0 if terminated else max(q[after])
            error = reward + gamma * ahead - max(q[state])  # d
            chosen_error = reward + gamma * ahead - q[state][action]  # e
            decay = gamma * lam
            for s in range(states):
                for a in range(actions):
                    chosen = (s, a) == (state, action)  # g
                    # δ·(γλTr), rounded as in the learning step: (δ·γλ)·Tr
                    credit = error * decay * trace[s][a]
                    q[s][a] += alpha * (credit + (chosen_error if chosen else 0.0))
                    trace[s][a] = decay * trace[s][a]  # f
            trace[state][action] += 1  # h
            if done:
                trace = [[0.0] * actions for _ in range(states)]
            if success:
                alpha = alpha_decay * alpha
            yield Learned([*map(list.copy, q)], [*map(list.copy, trace)], alpha)
            state = after
        episode += 1


def epsilon_greedy(values: Sequence[float], epsilon: float, u: float) -> int:
    """Return any action with probability ε, else a best one; u, uniform in [0, 1), decides."""
    if u < epsilon:
        among = list(range(len(values)))
        share = u / epsilon
    else:
        among = [a for a, value in enumerate(values) if value == max(values)]
        share = (u - epsilon) / (1 - epsilon)
    return among[min(int(share * len(among)), len(among) - 1)]
