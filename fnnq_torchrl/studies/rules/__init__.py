"""The rules of finished jobs: to read, to explain, to draw, to take away."""
