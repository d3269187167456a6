"""Where finished jobs are logged besides their result files, which every job has anyway.

Training is one native loop that knows its scores only when it is over, so loggers get whole columns
of what the result files hold, and not a call for each step. TorchRL's loggers take a number at a
time; where that serves, they are used.
"""

from .base import JobResults, Logger, SweepResults
from .guarded import Loggers

__all__ = ["JobResults", "Logger", "Loggers", "SweepResults"]
