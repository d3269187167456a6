"""What value functions do where nothing was seen, from the result files of two experiments."""

import fnnq_torchrl.training.pictures  # noqa: F401  # before Matplotlib itself
