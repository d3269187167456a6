"""A page on which the reader moves the ball and a learned controller chases it."""
