"""Training: from the configuration of a job to its result files."""
