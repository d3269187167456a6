"""What every world is made of: the pure environment, random numbers, typed parameters."""
