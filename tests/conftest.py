"""How torch and hypothesis run here."""

import os

# The tensors are small, so a second thread only waits for the first: for milliseconds an operation
# if the machine is busy. Torch reads this when it is imported; the commands under test inherit it.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from hypothesis import settings

# The first call of a torch operation can take seconds, so no example has a deadline.
settings.register_profile("here", deadline=None, derandomize="CI" in os.environ, print_blob=True)
settings.load_profile("here")
