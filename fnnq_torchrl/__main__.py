"""``python -m fnnq_torchrl``: the same command as ``python -m fnnq_torchrl.train``."""

from fnnq_torchrl.train import main

if __name__ == "__main__":
    main()
