"""The pictures of a job and of a sweep, drawn from their result files."""
