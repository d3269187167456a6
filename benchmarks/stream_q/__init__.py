"""Stream Q(λ), ours beside the program of its authors: `make stream-q` writes docs/stream_q.md."""
