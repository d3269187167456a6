"""The page ``docs/extrapolation.md``, on value functions in states that were never seen."""

import fnnq_torchrl.training.pictures  # noqa: F401  # before Matplotlib itself
