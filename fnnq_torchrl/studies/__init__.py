"""Statistics, figures and pages, made from result files."""
