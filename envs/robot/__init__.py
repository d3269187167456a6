"""The worlds of the mobile robot."""
