"""Peers on the same task: deep Q-networks of TorchRL and of Stable-Baselines3, beside ours."""
