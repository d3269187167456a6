"""The command line and sweeps. Of the package, only this room imports Hydra."""
