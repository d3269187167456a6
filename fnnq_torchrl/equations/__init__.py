"""Pure functions of tensors, each with its equation and source. The runs are the last dimension."""
