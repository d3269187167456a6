"""Training imports only what it needs: the command's imports take longer than its work."""

import subprocess
import sys

# Each takes a tenth of a second or more, and a job that finds its programs needs none of them.
NEEDLESS = {
    "fnnq_torchrl.engine.native.translation",
    "matplotlib",
    "pandas",
    "scipy",
    "sklearn",
    "torch._inductor.compile_fx",
    "wandb",
}


def test_training_imports_no_more_than_it_needs() -> None:
    program = "import fnnq_torchrl.training.job, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert not NEEDLESS & {*done.stdout.decode().split()}
