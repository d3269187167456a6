"""The study of what prior knowledge does to learning: from result files to a page."""
