"""Meta-learning on the ring, in plain Python: the twin of the learner with ``adaptive=doya``.

After N. Schweighofer, K. Doya, "Meta-learning in reinforcement learning", Neural Networks 16, 2003,
in the order of the replication by Sarazin et al. (2018): the action, the reward, the two means, the
parameters, and then the update of Q with the new α and γ.
"""

from collections.abc import Iterator
from math import cos, exp, log, pi, sin, sqrt
from typing import NamedTuple

from .pcg import CHANCE, draw

LEARNER, LAST_EPISODE = 5, 2**33 - 1


class Learned(NamedTuple):
    """The learner after a step."""

    q: list[list[float]]
    state: int
    long_mean: float
    alpha: float
    temperature: float
    gamma: float


def uniform(word: int) -> float:
    return (word >> 8) / 2**24


def ring_step(state: int, action: int, states: int, far_reward: float) -> tuple[int, float]:
    """Return the next state and the reward; action 0 is left, 1 is right."""
    if action == 0:
        return (states - 1, far_reward) if state == 0 else (state - 1, -1.0)
    return (0, -far_reward) if state == states - 1 else (state + 1, 1.0)


def normals(seed: int, step: int) -> tuple[float, float, float]:
    """Return the perturbations of α, the temperature and γ at a step."""
    u, v, other_u, other_v = map(uniform, draw(seed, LAST_EPISODE, step, LEARNER))
    radius, other = sqrt(-2 * log(1 - u)), sqrt(-2 * log(1 - other_u))
    return radius * cos(2 * pi * v), radius * sin(2 * pi * v), other * cos(2 * pi * other_v)


def doya(
    seed: int,
    states: int,
    far_reward: float,
    *,
    alpha: float,
    temperature: float,
    gamma: float,
    rate: float,
    period: int,
    short: float,
    long: float,
    affine: bool = False,
    parameters: tuple[str, ...] = ("alpha", "temperature", "gamma"),
) -> Iterator[Learned]:
    """Yield the learner after each step, without end."""
    beta = 1 / temperature
    levels = {
        "alpha": log(1 / alpha - 1),
        "temperature": beta - 1 if affine else log(beta),
        "gamma": log(gamma / (1 - gamma)),
    }
    q = [[0.0, 0.0] for _ in range(states)]
    state, step, short_mean, long_mean = states // 2, 0, 0.0, 0.0
    noise = dict.fromkeys(levels, 0.0)
    while True:
        high = max(q[state])
        odds = [exp((value - high) * beta) for value in q[state]]
        chance = uniform(draw(seed, 0, step, CHANCE)[0])
        action = 0 if odds[0] > chance * sum(odds) else 1
        after, reward = ring_step(state, action, states, far_reward)
        short_mean += (reward - short_mean) / short
        long_mean += (short_mean - long_mean) / long
        if step % period == 0:
            noise = dict(zip(levels, normals(seed, step), strict=True))
        for name in parameters:
            levels[name] += rate * (short_mean - long_mean) * noise[name]
        b = {name: levels[name] + noise[name] for name in levels}
        if "alpha" in parameters:
            alpha = 1 / (1 + exp(b["alpha"]))
        if "temperature" in parameters:
            beta = max(b["temperature"] + 1, 0.0) if affine else exp(b["temperature"])
        if "gamma" in parameters:
            gamma = 1 / (1 + exp(-b["gamma"]))
        q[state][action] += alpha * (reward + gamma * max(q[after]) - q[state][action])
        state, step = after, step + 1
        temperature = 1 / beta if beta else float("inf")
        yield Learned([*map(list.copy, q)], state, long_mean, alpha, temperature, gamma)
