"""Fuzzy Q-learning in plain Python, one rule after the other: the twin of ``value=fuzzy_q``.

P. Y. Glorennec, L. Jouffe, "Fuzzy Q-learning", FUZZ-IEEE 1997, with the eligibility of L. Jouffe,
"Fuzzy inference system learning by reinforcement methods", 1998. The variants of other names than
``naive`` are those of :mod:`tests.oracles.q_lambdas` for the joint choice of all rules.
"""

from collections.abc import Iterator, Sequence

import torch

from envs.core.pure import PureEnv

from .fuzzy import Label, normalised_firing_strengths
from .pcg import draw
from .peng import Table, epsilon_greedy

CHOICES = 5
"""The stream of the rules' random numbers."""


def random_numbers(rules: int, seed: int, episode: int, step: int) -> list[float]:
    """Return U[0, 1) for each rule: four rules share a draw."""
    groups = -(-rules // 4)
    words = [
        word
        for group in range(groups)
        for word in draw(seed, episode, groups * step + group, CHOICES)
    ]
    return [(word >> 8) / 2**24 for word in words[:rules]]


def fuzzy_q_learning(
    env: PureEnv,
    labels: dict[str, Sequence[Label]],
    actions: Sequence[float],
    *,
    variant: str,
    seed: int,
    lam: float,
    alpha: float,
    alpha_decay: float,
    gamma: float,
    epsilon: float,
) -> Iterator[tuple[Table, Table]]:
    """Yield q[rule][action] and its eligibility after each step, without end.

    Args:
        env: a world with one run.
        labels: the labels of each observation.
        actions: the actions among which each rule chooses.
    """
    rules = len(normalised_firing_strengths([0.0] * len(labels), [*labels.values()]))
    q = [[0.0] * len(actions) for _ in range(rules)]
    e = [[0.0] * len(actions) for _ in range(rules)]
    state = env.start(torch.tensor([[seed]]), torch.tensor([[0]]))
    while True:
        phi = strengths(state, labels)
        episode, step = state["episode"].item(), state["step"].item()
        u = random_numbers(rules, seed, episode, step)
        chosen = [epsilon_greedy(q[i], epsilon, u[i]) for i in range(rules)]
        action = sum(phi[i] * actions[chosen[i]] for i in range(rules))
        state["action"] = torch.tensor([[action]], dtype=torch.float64)
        after = env.step(state)["next"]
        ahead = strengths(after, labels)
        target = after["reward"].item()
        if not after["terminated"].item():
            target += gamma * sum(ahead[i] * max(q[i]) for i in range(rules))
        error = target - sum(phi[i] * max(q[i]) for i in range(rules))
        chosen_error = target - sum(phi[i] * q[i][chosen[i]] for i in range(rules))
        cut = variant == "watkins" and any(q[i][chosen[i]] < max(q[i]) for i in range(rules))
        past_error = error if variant == "peng" else chosen_error
        for i in range(rules):
            for a in range(len(actions)):
                e[i][a] *= 0.0 if cut else gamma * lam
                f = phi[i] if a == chosen[i] else 0.0
                q[i][a] += alpha * (past_error * e[i][a] + chosen_error * f)
                e[i][a] = 0.0 if after["done"].item() else e[i][a] + f
        if after["success"].item():
            alpha *= alpha_decay
        yield [*map(list.copy, q)], [*map(list.copy, e)]
        state = env.restart(after)


def strengths(state, labels: dict[str, Sequence[Label]]) -> list[float]:
    return normalised_firing_strengths([state[name].item() for name in labels], [*labels.values()])
