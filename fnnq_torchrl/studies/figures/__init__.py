"""The figures of experiments, drawn from their result files."""
