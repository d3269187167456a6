"""The candidate actions, from which policies choose."""

import torch
from torch import Tensor

from fnnq_torchrl.config.schema import Config


def make_candidates(
    config: Config,
    dtype: torch.dtype = torch.float32,
    device: torch.device | str | None = None,
) -> Tensor:
    """Return the candidate actions: evenly spaced in the world's range, or all of its fixed set.

    Args:
        config: the configuration, with the world and the number of candidates.
        dtype, device: the dtype and device of the result.

    Returns:
        The actions, ``[candidates]``, ascending.
    """
    actions = config.env.actions
    if isinstance(actions, int):
        return torch.arange(actions, dtype=dtype, device=device)
    low, high = actions
    count = config.action.candidates
    return torch.linspace(low, high, count, dtype=dtype, device=device)
