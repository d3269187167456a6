"""From result files to statistics, figures and pages."""
