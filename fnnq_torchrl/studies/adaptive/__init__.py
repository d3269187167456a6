"""What adaptive step sizes do to the paper's experiment: from result files to a page."""
