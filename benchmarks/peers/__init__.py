"""Compares our learner with the deep Q-networks of TorchRL and of Stable-Baselines3."""
