"""Peng's Q(λ) with the Q-function and its eligibility trace in a fuzzy neural network, in TorchRL.

This file imports nothing, so that a configuration can be checked without importing torch.
"""
