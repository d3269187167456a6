"""Train a batch of runs: ``python -m fnnq_torchrl.train lam=0.2 seed=3``, or ``fnnq-train …``."""

import sys
from importlib.util import find_spec
from pathlib import Path

from fnnq_torchrl.launch.interrupted import leave_interrupted


def main() -> None:
    """Run the train command. Slow imports are made inside, so that Ctrl-C is handled early."""
    _check_envs()
    try:
        from fnnq_torchrl.launch.imports import uncollected

        with uncollected():
            from fnnq_torchrl.launch.train import main as train
    except KeyboardInterrupt:
        leave_interrupted()
    train()


def _check_envs() -> None:
    """Exit with one line if another package named ``envs`` hides our own."""
    found, own = find_spec("envs"), Path(__file__).resolve().parents[1] / "envs"
    place = Path(found.origin).resolve() if found is not None and found.origin else own
    if own in (place, place.parent):
        return
    remedy = "take its directory off PYTHONPATH"
    if sys.argv[0].endswith(".py"):  # python -m searches the current directory first
        remedy = "type fnnq-train instead, which looks for packages elsewhere"
    sys.stderr.write(f"{place} hides the package envs of fnnq_torchrl; {remedy}\n")
    sys.exit(2)


if __name__ == "__main__":
    main()
