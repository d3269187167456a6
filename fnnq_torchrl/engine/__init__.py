"""Engines that run a step many times: eagerly, or in one compiled loop."""
