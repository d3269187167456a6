"""Watkins', naive and Peng's Q(λ) and Sarsa(λ) for a table, as in their sources.

Watkins' and naive Q(λ) are from R. S. Sutton, A. G. Barto, "Reinforcement learning", 1998, fig.
7.14 and section 7.6: the present pair enters the trace before the update, so all pairs get αδ′e.
Peng's Q(λ) is the paper's Table 1, where the present pair enters the trace after the update.
Sarsa(λ) and true online Sarsa(λ) are from Sutton & Barto, 2018, section 12.7. The sources of the
step sizes are in `equations.step_size`.
"""

from collections.abc import Iterator, Sequence
from itertools import islice

from .peng import Learned, Table, World, epsilon_greedy

Visits = list[tuple[int, int]]  # the pairs (s, a) of this episode, the latest first


def q_lambda(
    world: World,
    states: int,
    actions: int,
    *,
    variant: str,
    trace: str,
    window: int,
    lam: float,
    alpha: float,
    alpha_decay: float,
    gamma: float,
    epsilon: float,
    step_size: str = "decay",
    kappa: float = 1.0,
) -> Iterator[Learned]:
    """Yield the learner after each step; the trace is computed from the visited pairs each time."""
    q = [[0.0] * actions for _ in range(states)]
    episode = 0
    while True:
        state, chance = world.start(episode)
        visits: Visits = []
        step, done = 0, False
        action = epsilon_greedy(q[state], epsilon, chance)
        dutch = [[0.0] * actions for _ in range(states)]
        q_old = 0.0
        while not done:
            if variant != "sarsa":
                action = epsilon_greedy(q[state], epsilon, chance)
            if variant == "watkins" and q[state][action] < max(q[state]):
                visits = []
            step += 1
            reward, after, terminated, done, success, chance = world.move(
                state, action, episode, step
            )
            next_action = epsilon_greedy(q[after], epsilon, chance)
            next_value = {
                "sarsa": q[after][next_action],
                "expected_sarsa": mean_value(q[after], epsilon),
            }.get(variant, max(q[after]))
            target = reward + (0.0 if terminated else gamma * next_value)
            error, chosen_error = target - max(q[state]), target - q[state][action]
            if trace == "dutch":
                overlap = alpha * gamma * lam * dutch[state][action]
                dutch = [[gamma * lam * x for x in row] for row in dutch]
                dutch[state][action] += 1 - overlap
                change = q[state][action] - q_old
                direction = [[(chosen_error + change) * x for x in row] for row in dutch]
                direction[state][action] -= change
                q_old = next_value
            elif variant == "peng":
                e = eligibility(visits, states, actions, trace, window, gamma * lam)
                z = [[gamma * lam * x for x in row] for row in e]
                direction = [[error * x for x in row] for row in z]
                direction[state][action] += chosen_error
                z[state][action] += 1
                largest_error = max(abs(error), abs(chosen_error))
            else:
                seen = [(state, action), *visits]
                # A window's steps are those before the present one.
                z = eligibility(seen, states, actions, trace, window + 1, gamma * lam)
                direction = [[chosen_error * x for x in row] for row in z]
                largest_error = abs(chosen_error)
            size = alpha
            if step_size == "obgd":
                reach = alpha * kappa * max(largest_error, 1) * sum(map(sum, z))
                size = alpha / max(reach, 1)
            elif step_size == "alpha_bound":
                assert variant in ("peng", "watkins", "naive")
                best = [
                    x for x, value in zip(z[after], q[after], strict=True) if value == max(q[after])
                ]
                ahead = 0.0 if terminated else gamma * sum(best) / len(best)
                along = ahead - z[state][action]
                size = alpha = min(alpha, 1 / abs(along)) if along < 0 else alpha
            q = [
                [a + size * b for a, b in zip(*rows, strict=True)]
                for rows in zip(q, direction, strict=True)
            ]
            visits = [] if done else [(state, action), *visits]
            if success:
                alpha = alpha_decay * alpha
            yield Learned([*map(list.copy, q)], [], alpha)
            state, action = after, next_action
        episode += 1


def eligibility(
    visits: Visits, states: int, actions: int, trace: str, window: int, decay: float
) -> Table:
    """Return every pair's sum of (γλ)ᵏ over its visits k steps ago.

    Only the pair's latest visit counts under ``replacing``, only the last visits under ``window``,
    and only the latest visit of a state under ``clearing``.
    """
    e = [[0.0] * actions for _ in range(states)]
    for k, (state, action) in enumerate(islice(visits, window if trace == "window" else None)):
        if trace == "clearing" and any(e[state]):
            continue
        share = decay**k
        e[state][action] = (
            max(e[state][action], share) if trace == "replacing" else (e[state][action] + share)
        )
    return e


def mean_value(values: Sequence[float], epsilon: float) -> float:
    """Return the mean value of an ε-greedy action."""
    best = [value for value in values if value == max(values)]
    return epsilon * sum(values) / len(values) + (1 - epsilon) * sum(best) / len(best)
