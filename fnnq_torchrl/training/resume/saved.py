"""The file that holds an unfinished training."""

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import torch
from torch import Tensor

from envs.core.registry import source_of
from fnnq_torchrl.config.identity import ASIDE
from fnnq_torchrl.config.own import own_kinds
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.files.plain import read_plain, write_plain
from fnnq_torchrl.training.batch import Batch
from fnnq_torchrl.training.jobs import BATCHABLE, TRAINING
from fnnq_torchrl.training.resume.keeper import Hand
from fnnq_torchrl.training.resume.ledger import Ledger

FORMAT = 4

# Keys left out of the identity: no result depends on ASIDE, the values of BATCHABLE are compared
# run by run, and the identity has the chosen engine instead of the key ``engine``.
_NO_MATTER = (*ASIDE, "engine", *BATCHABLE)


class SavedTraining:
    """The file of a batch's unfinished training, in the batch's directory.

    Args:
        batch: the batch. Its engine is part of the training's identity, because the results of
            different engines differ in the last bits.
    """

    def __init__(self, batch: Batch) -> None:
        self.path = batch.directory / TRAINING
        settings = asdict(batch.config)
        shared = {key: of for key, of in settings.items() if key not in _NO_MATTER}
        code = [source_of(key, kind) for key, kind in own_kinds(batch.config).items()]
        digest = batch.start and batch.start.digest
        identity = f"{torch.__version__} {batch.engine.name} {shared!r} {code} {digest}"
        self._identity = hashlib.sha256(identity.encode()).hexdigest()
        self._batch = batch
        self._read: tuple[dict[str, Any], Tensor] | None = None

    def read(self) -> None:
        """Read the file, if there is one and ``resume`` isn't ``never``.

        Raises:
            ConfigError: if the file was saved with another configuration, engine or version of
                PyTorch, or with other or more runs, or if it is damaged.
            OSError: if the file can't be read.
        """
        if self._batch.config.resume == "never" or not self.path.exists():
            return
        try:
            content = read_plain(self.path, FORMAT, "a saved training")
        except ValueError as error:
            raise ConfigError(f"{error}; resume=never starts over") from error
        rows = None
        if content["identity"] == self._identity:
            rows = self._batch.runs.rows_among(content["ledger"]["runs"].numpy())
        if rows is None:
            raise ConfigError(
                f"{self.path} was saved with another configuration, engine or version of PyTorch; "
                "take another directory, or start over with resume=never"
            )
        saved, runs = len(content["ledger"]["runs"]), len(rows)
        # In a sweep, further runs may be those of finished jobs. In a single job, further runs
        # would be thrown away.
        if saved > runs and self._batch.jobs[0].sweep is None:
            raise ConfigError(
                f"{self.path} was saved with {saved:,} runs, not num_seeds={runs}; "
                "take another directory, or start over with resume=never"
            )
        self._read = content["ledger"], torch.from_numpy(rows)

    def restore(self, ledger: Ledger) -> bool:
        """Load into the ledger the progress that :meth:`read` has found, if any.

        Returns:
            True if progress was loaded.
        """
        read, self._read = self._read, None
        if read is not None:
            ledger.load_state_dict(*read)
        return read is not None

    def save(self, ledger: Ledger, hands: Sequence[Hand]) -> None:
        """Write the progress so far.

        Args:
            ledger: the progress.
            hands: the runs that are learning now, and their states.

        Raises:
            OSError: if the file can't be written; an earlier file stays unchanged.
        """
        content = {"identity": self._identity, "ledger": ledger.state_dict(hands)}
        write_plain(self.path, FORMAT, content)

    def discard(self) -> None:
        """Remove the file, after all results are written."""
        self.path.unlink(missing_ok=True)
