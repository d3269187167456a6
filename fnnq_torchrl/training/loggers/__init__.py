"""The loggers of finished jobs, beside the result files that every job has.

Training is one native loop, whose scores are known only after its end. So loggers get the whole
columns of the result files, and no call for each step. TorchRL's loggers take one step at a time.
They are used if that is enough; a logger that doesn't use TorchRL's says why.
"""

from .base import JobResults, Logger, SweepResults
from .registry import Loggers

__all__ = ["JobResults", "Logger", "Loggers", "SweepResults"]
