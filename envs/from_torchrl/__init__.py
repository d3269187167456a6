"""TorchRL's environments as worlds."""
