"""Choosing among candidate actions. Candidates are the first dimension, runs the last."""

import torch
from torch import Tensor


def epsilon_greedy(action_values: Tensor, epsilon: Tensor, u: Tensor) -> Tensor:
    """A random candidate with probability ε, else the best one, ties broken evenly at random.

    One uniform number decides all: below ε, where it lies there is the random candidate; above,
    where it lies between ε and 1 picks among the best.

    Args:
        action_values: ``[candidates, *runs]``.
        epsilon: ``[*runs]``, in [0, 1].
        u: uniform in [0, 1), ``[*runs]``.

    Returns:
        The index of each run's choice, int32 ``[*runs]``.
    """
    explore = u < epsilon
    best = action_values == action_values.amax(0)
    # Small whole numbers, kept as floats: loops over many runs load those fastest.
    rank = best.to(u.dtype).cumsum(0)  # numbers the best ones 1, 2, …
    among = torch.where(explore, len(action_values), rank[-1])
    share = torch.where(explore, u, u - epsilon) / torch.where(explore, epsilon, 1 - epsilon)
    pick = torch.minimum((share * among).floor(), among - 1)  # rounding may make the share a whole
    return torch.where(explore, pick, (rank <= pick).to(u.dtype).sum(0)).int()
