"""Training that isn't finished, on disk: what it takes to go on from there."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import torch

from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.files.plain import read_plain, write_plain
from fnnq_torchrl.training.jobs import ASIDE, BATCHABLE, TRAINING
from fnnq_torchrl.training.resume.keeper import Hand
from fnnq_torchrl.training.resume.ledger import Ledger
from fnnq_torchrl.training.trainer import Trainer

FORMAT = 2

# In what learning doesn't depend on; which engine it is tells the identity by itself.
_NO_MATTER = (*ASIDE, "engine", *BATCHABLE)


class SavedTraining:
    """The file of a batch's training, in the directory of the batch's last job.

    The last, because its own files are written when all the others' are: where one is missing, its
    are too.

    Args:
        directory: for the file.
        config: of the batch.
        engine: that runs it: another's results would differ in the last bits.
    """

    def __init__(self, directory: Path, config: Config, engine: str) -> None:
        self.path = directory / TRAINING
        shared = {key: of for key, of in asdict(config).items() if key not in _NO_MATTER}
        identity = f"{torch.__version__} {engine} {shared!r}"
        self._identity = hashlib.sha256(identity.encode()).hexdigest()

    def save(self, ledger: Ledger, hands: Sequence[Hand]) -> None:
        """Write all that is done so far.

        Raises:
            OSError: the file can't be written; an earlier one stays as it was.
        """
        content = {"identity": self._identity, "ledger": ledger.state_dict(hands)}
        write_plain(self.path, FORMAT, content)

    def load(self, trainer: Trainer) -> bool:
        """Have a trainer go on from the file.

        Returns:
            Whether there is one.

        Raises:
            ConfigError: it is that of another configuration or PyTorch or of other runs, or no
                such file.
            OSError: it can't be read.
        """
        if not self.path.exists():
            return False
        try:
            content = read_plain(self.path, FORMAT, "a saved training")
        except ValueError as error:
            raise ConfigError(f"{error}; resume=never begins anew") from error
        try:
            same = content["identity"] == self._identity
            loaded = same and trainer.ledger.load_state_dict(content["ledger"], trainer.begun)
        except (AttributeError, LookupError, RuntimeError, TypeError, ValueError) as error:
            raise ConfigError(
                f"{self.path} is not a complete saved training; resume=never begins anew"
            ) from error
        if not loaded:
            raise ConfigError(
                f"{self.path} is of another configuration or PyTorch; "
                "take another directory, or begin anew with resume=never"
            )
        return True

    def discard(self) -> None:
        """Everything is finished."""
        self.path.unlink(missing_ok=True)
