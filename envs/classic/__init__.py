"""Worlds of the literature on reinforcement learning."""
