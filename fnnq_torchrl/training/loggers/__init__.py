"""The loggers: where finished jobs are logged besides their result files, which all jobs have.

Training is one native loop that knows its scores only when it is over, so loggers get whole columns
of what the result files hold, and no call for each step. TorchRL's loggers take one step at a time;
they are used where that is enough, and a logger that doesn't use TorchRL's says why.
"""

from .base import JobResults, Logger, SweepResults
from .registry import Loggers

__all__ = ["JobResults", "Logger", "Loggers", "SweepResults"]
