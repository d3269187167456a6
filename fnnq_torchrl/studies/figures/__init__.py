"""The figures of experiments, drawn from their result files."""

import fnnq_torchrl.training.pictures  # noqa: F401  # before Matplotlib itself
