"""The command line, sweeps and clusters. No other part of the package imports Hydra."""
