"""Saves the progress of a training, and loads it to resume the training."""
