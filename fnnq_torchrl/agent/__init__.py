"""The TorchRL faces of the equations: value networks, policies, loss, trace, learning step."""
