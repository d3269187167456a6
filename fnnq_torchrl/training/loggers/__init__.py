"""Loggers, which log finished jobs to services beside the result files.

Training is one native loop, and its scores are known only after its end. So a logger isn't called
at every step: it gets whole columns of the result files. TorchRL's loggers take one step at a time.
Where that suffices, they are used; each other module here says why TorchRL's isn't.
"""

from .base import JobResults, Logger, SweepResults
from .registry import Loggers

__all__ = ["JobResults", "Logger", "Loggers", "SweepResults"]
