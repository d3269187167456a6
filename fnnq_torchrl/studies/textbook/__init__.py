"""The figures of Sutton and Barto's book, and ours beside them."""
