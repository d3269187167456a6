"""Two orders of dimensions: TensorDicts have the runs first, the arithmetic has them last.

Runs-last, sums over rules and candidates unroll into a few vectorised loops over the runs. The
TensorDict faces move the dimension at their edge: a view, it costs nothing.
"""

from torch import Tensor


def runs_last(tensor: Tensor) -> Tensor:
    """``[runs, *rest]`` as ``[*rest, runs]``."""
    return tensor.movedim(0, -1)


def runs_first(tensor: Tensor) -> Tensor:
    """``[*rest, runs]`` as ``[runs, *rest]``."""
    return tensor.movedim(-1, 0)


def per_run(tensor: Tensor) -> Tensor:
    """A number of each run, ``[runs, 1]``, as ``[runs]``; a number shared by all stays as it is."""
    return tensor.squeeze(-1)
