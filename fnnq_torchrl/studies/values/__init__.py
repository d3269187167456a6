"""Value functions on the classic worlds, and the two kinds of fuzzy Q-learning on the ball."""
