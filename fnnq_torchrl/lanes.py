"""Runs as lanes of a batch whose size is a multiple of the machine's vectors.

Vectorised kernels treat the rest of a vector's length differently (another code path, another order
of summation), so a run could differ, in its last bit, from the same run in another batch. With the
batch padded, every lane takes the same path. Padding lanes repeat the last run; they cost little
and are never reported.
"""

import torch
from torch import Tensor

LANES = 32
"""16 are not enough: tried on AVX2 and AVX-512."""


def pad(values: Tensor) -> Tensor:
    """The values ``[runs, ...]``, the last repeated, up to a whole multiple of ``LANES``."""
    index = torch.arange(-(-len(values) // LANES) * LANES, device=values.device)
    return values[index.clamp(max=len(values) - 1)]
