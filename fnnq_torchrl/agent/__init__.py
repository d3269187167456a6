"""The equations as TorchRL modules: value networks, policies, loss, trace, learning step."""
