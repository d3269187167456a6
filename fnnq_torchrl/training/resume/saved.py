"""Training that isn't finished, on disk: what it takes to go on from there."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import torch
from torch import Tensor

from envs.core.registry import is_own, source_of
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.files.plain import read_plain, write_plain
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.jobs import ASIDE, BATCHABLE, TRAINING
from fnnq_torchrl.training.resume.keeper import Hand
from fnnq_torchrl.training.resume.ledger import Ledger

FORMAT = 3

# In what learning doesn't depend on; which engine it is tells the identity by itself.
_NO_MATTER = (*ASIDE, "engine", *BATCHABLE)


class SavedTraining:
    """The file of a batch's training, in the batch's directory.

    Args:
        batch: whose it is. Another engine's results would differ in the last bits.
    """

    def __init__(self, batch: Batch) -> None:
        self.path = batch.directory / TRAINING
        settings = asdict(batch.config)
        shared = {key: of for key, of in settings.items() if key not in _NO_MATTER}
        kinds = {"env": batch.config.env.kind, "value": batch.config.value.kind}
        code = [source_of(group, kind) for group, kind in kinds.items() if is_own(kind)]
        digest = batch.start and batch.start.digest
        identity = f"{torch.__version__} {batch.engine.name} {shared!r} {code} {digest}"
        self._identity = hashlib.sha256(identity.encode()).hexdigest()
        self._batch = batch
        self._read: tuple[dict[str, Any], Tensor] | None = None

    def read(self) -> None:
        """Read the file, if there is one that is to be gone on from.

        Raises:
            ConfigError: it is of another configuration or PyTorch or of other runs, or damaged.
            OSError: it can't be read.
        """
        if self._batch.config.resume == "never" or not self.path.exists():
            return
        try:
            content = read_plain(self.path, FORMAT, "a saved training")
        except ValueError as error:
            raise ConfigError(f"{error}; resume=never begins anew") from error
        rows = None
        if content["identity"] == self._identity:
            rows = self._batch.runs.rows_among(content["ledger"]["runs"].numpy())
        if rows is None:
            raise ConfigError(
                f"{self.path} is of another configuration or PyTorch; "
                "take another directory, or begin anew with resume=never"
            )
        self._read = content["ledger"], torch.from_numpy(rows)

    def restore(self, ledger: Ledger) -> bool:
        """Have a training go on from what was read.

        Returns:
            Whether there was anything.
        """
        read, self._read = self._read, None
        if read is not None:
            ledger.load_state_dict(*read)
        return read is not None

    def save(self, ledger: Ledger, hands: Sequence[Hand]) -> None:
        """Write all that is done so far.

        Raises:
            OSError: the file can't be written; an earlier one stays as it was.
        """
        content = {"identity": self._identity, "ledger": ledger.state_dict(hands)}
        write_plain(self.path, FORMAT, content)

    def discard(self) -> None:
        """Everything is finished."""
        self.path.unlink(missing_ok=True)
