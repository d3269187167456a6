"""The choice among candidate actions. Candidates are the first dimension, runs the last.

Every choice takes one uniform random number.
"""

import math

import torch
from torch import Tensor


def epsilon_greedy(action_values: Tensor, epsilon: Tensor, u: Tensor) -> Tensor:
    """A random candidate with probability ε, else the best one, with ties broken evenly at random.

    One uniform number decides: below ε, its place in [0, ε) picks among all candidates; above, its
    place in [ε, 1) picks among the best.

    Args:
        action_values: ``[candidates, *runs]``.
        epsilon: ``[*runs]``, in [0, 1].
        u: uniform in [0, 1), ``[*runs]``.

    Returns:
        The index of each run's choice, int32 ``[*runs]``.
    """
    explore = u < epsilon
    best = action_values == action_values.amax(0)
    # Small whole numbers, kept as floats, which loops over many runs load fastest.
    rank = best.to(u.dtype).cumsum(0)  # numbers the best ones 1, 2, …
    among = torch.where(explore, len(action_values), rank[-1])
    share = torch.where(explore, u, u - epsilon) / torch.where(explore, epsilon, 1 - epsilon)
    pick = torch.minimum((share * among).floor(), among - 1)  # rounding may make the share a whole
    return torch.where(explore, pick, (rank <= pick).to(u.dtype).sum(0)).int()


def boltzmann(action_values: Tensor, temperature: Tensor, u: Tensor) -> Tensor:
    """A candidate with probability exp(Q/T)/Σexp(Q/T), by the inverse of their cumulative sum.

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
    # If u·total is rounded up to the total, the choice is the last candidate that adds to the sum.
    passed = (below <= u * total) & (below < total)
    return passed.to(u.dtype).sum(0).int()


def noisy_greedy(action_values: Tensor, candidates: Tensor, noise_std: Tensor, u: Tensor) -> Tensor:
    """The best candidate plus normal noise, kept within the candidates' range.

    The uniform number first breaks ties. Its place within the share of the picked candidate is
    uniform again, and makes the noise.

    Args:
        action_values: ``[candidates, *runs]``.
        candidates: the actions, rising, ``[candidates]``.
        noise_std: σ of the noise, ``[*runs]``.
        u: uniform in [0, 1), ``[*runs]``.

    Returns:
        The action itself, ``[*runs]``; it need not be a candidate.
    """
    best = action_values == action_values.amax(0)
    ties = u * best.to(u.dtype).sum(0)
    noise = noise_std * normal_quantile(ties - ties.floor())
    greedy = candidates[epsilon_greedy(action_values, torch.zeros_like(u), u)]
    lowest, highest = candidates[0], candidates[-1]
    return torch.minimum(torch.maximum(greedy + noise, lowest), highest)


def normal_quantile(u: Tensor) -> Tensor:
    """The standard normal's quantile Φ⁻¹(u), within 10⁻⁴; u is clamped to [10⁻⁶, 1 − 10⁻⁶].

    From elementary functions: S. Winitzki's inverse of erf ("A handy approximation for the error
    function and its inverse", 2008), then one step of Newton's method on erf itself.

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
