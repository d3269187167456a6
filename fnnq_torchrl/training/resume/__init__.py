"""What is done so far of a training, and going on from it."""
