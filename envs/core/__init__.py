"""The parts of every world: the pure environment, random numbers, typed parameters."""
