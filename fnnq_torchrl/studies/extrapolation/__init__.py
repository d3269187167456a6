"""What value functions do where nothing was seen, from the result files of two experiments."""
