"""The progress of a training: saved, and loaded again to go on."""
