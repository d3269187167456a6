"""A comparison of our Q(λ) learner with the deep Q-networks of TorchRL and Stable-Baselines3."""
