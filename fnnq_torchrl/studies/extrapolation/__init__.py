"""The page on value functions where nothing was seen, ``docs/extrapolation.md``."""

import fnnq_torchrl.training.pictures  # noqa: F401  # before Matplotlib itself
