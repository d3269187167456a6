"""Which of the paper's claims hold: from result files to ``docs/reproduction.md``."""
