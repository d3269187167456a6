"""Rules for choosing among candidate actions. Candidates are the first dimension, runs the last.

Every choice uses one uniform random number.
"""

import math

import torch
from torch import Tensor


def epsilon_greedy(action_values: Tensor, epsilon: Tensor, u: Tensor) -> Tensor:
    """Choose a random candidate with probability ε, else the best; ties are broken at random.

    If u is below ε, its position in [0, ε) picks among all candidates. Otherwise its position in
    [ε, 1) picks among the best candidates. Each is equally likely.

    Args:
        action_values: ``[candidates, *runs]``.
        epsilon: ``[*runs]``, in [0, 1].
        u: uniform in [0, 1), ``[*runs]``.

    Returns:
        The index of each run's choice, int32 ``[*runs]``.
    """
    explore = u < epsilon
    best = action_values == action_values.amax(0)
    # The ranks are whole numbers, but loops over many runs load floats faster than integers.
    rank = best.cumsum(0, dtype=u.dtype)  # numbers the best candidates 1, 2, …
    among = rank[-1].masked_fill(explore, len(action_values))
    share = torch.where(explore, u, u - epsilon) / torch.where(explore, epsilon, 1 - epsilon)
    pick = torch.minimum((share * among).floor(), among - 1)  # rounding may give `among`
    return torch.where(explore, pick, (rank <= pick).sum(0, dtype=u.dtype)).int()


def epsilon_greedy_probabilities(action_values: Tensor, epsilon: Tensor) -> Tensor:
    """Return the probability with which :func:`epsilon_greedy` chooses each candidate.

    Args:
        action_values: ``[candidates, *runs]``.
        epsilon: ``[*runs]``, in [0, 1].

    Returns:
        ``[candidates, *runs]``.
    """
    best = (action_values == action_values.amax(0)).to(action_values.dtype)
    return epsilon / len(action_values) + (1 - epsilon) * best / best.sum(0)


def annealed(first: Tensor, final: Tensor, over: Tensor, steps: Tensor) -> Tensor:
    """Return the amount of exploration after a number of steps, annealed linearly.

    Args:
        first: the amount before the first step, any shape.
        final: the amount after ``over`` or more steps, same shape.
        over: the number of steps from ``first`` to ``final``, > 0, same shape.
        steps: the number of steps taken, int64, same shape.
    """
    return first + (final - first) * (steps / over).clamp(max=1)


def boltzmann(action_values: Tensor, temperature: Tensor, u: Tensor) -> Tensor:
    """Choose a candidate with probability exp(Q/T)/Σexp(Q/T), by inverting the cumulative sum.

    Args:
        action_values: Q, ``[candidates, *runs]``.
        temperature: T > 0, in units of Q, ``[*runs]``.
        u: uniform in [0, 1), ``[*runs]``.

    Returns:
        The index of each run's choice, int32 ``[*runs]``.
    """
    strength = torch.exp((action_values - action_values.amax(0)) / temperature)
    below = strength.cumsum(0)
    total = below[-1]
    # If rounding makes u·total the total, choose the last candidate with a probability above 0.
    passed = (below <= u * total) & (below < total)
    return passed.to(u.dtype).sum(0).int()


def boltzmann_probabilities(action_values: Tensor, temperature: Tensor) -> Tensor:
    """Return the probability with which :func:`boltzmann` chooses each candidate.

    Args:
        action_values: Q, ``[candidates, *runs]``.
        temperature: T > 0, in units of Q, ``[*runs]``.

    Returns:
        ``[candidates, *runs]``.
    """
    strength = torch.exp((action_values - action_values.amax(0)) / temperature)
    return strength / strength.sum(0)


def noisy_greedy(action_values: Tensor, candidates: Tensor, noise_std: Tensor, u: Tensor) -> Tensor:
    """Return the best candidate plus normal noise, clipped to the candidates' range.

    u first breaks ties: each of n best candidates has a share 1/n of [0, 1). The position of u
    within the chosen share is uniform again and gives the noise.

    Args:
        action_values: ``[candidates, *runs]``.
        candidates: the actions, ascending, ``[candidates]``.
        noise_std: σ of the noise, ``[*runs]``.
        u: uniform in [0, 1), ``[*runs]``.

    Returns:
        The action, ``[*runs]``, which need not be a candidate.
    """
    best = action_values == action_values.amax(0)
    ties = u * best.to(u.dtype).sum(0)
    noise = noise_std * normal_quantile(ties - ties.floor())
    greedy = candidates[epsilon_greedy(action_values, torch.zeros_like(u), u)]
    lowest, highest = candidates[0], candidates[-1]
    return torch.minimum(torch.maximum(greedy + noise, lowest), highest)


def normal_quantile(u: Tensor) -> Tensor:
    """Return the standard normal quantile Φ⁻¹(u), within 10⁻⁴; u is clamped to [10⁻⁶, 1 − 10⁻⁶].

    It consists of elementary functions: S. Winitzki's inverse of erf ("A handy approximation for
    the error function and its inverse", 2008), then one step of Newton's method on erf itself.

    Args:
        u: in [0, 1], any shape.
    """
    a = 0.147
    y = 2 * u.clamp(1e-6, 1 - 1e-6) - 1
    log = torch.log((1 - y) * (1 + y))
    middle = 2 / (math.pi * a) + log / 2
    x = (torch.sqrt(middle.square() - log / a) - middle).clamp(min=0).sqrt()
    x = torch.where(y < 0, -x, x)
    x = x - (torch.erf(x) - y) * (math.sqrt(math.pi) / 2) * torch.exp(x.square())
    return math.sqrt(2) * x


def is_greedy(action_values: Tensor, candidates: Tensor, action: Tensor) -> Tensor:
    """Return 1 where an action is one of the best candidates, else 0.

    Args:
        action_values: Q of the candidates, ``[candidates, *runs]``.
        candidates: the actions, ``[candidates]``.
        action: the chosen action, ``[*runs]``.

    Returns:
        ``[*runs]``, in the dtype of the values.
    """
    every_run = (-1, *[1] * action.ndim)
    chosen = candidates.view(every_run) == action
    best = action_values == action_values.amax(0)
    return (chosen & best).to(action_values.dtype).amax(0)
