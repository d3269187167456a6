"""The command line and sweeps. Only this room imports Hydra."""
