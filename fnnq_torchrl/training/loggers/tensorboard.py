"""TensorBoard: events of each job: its curve and band, its scores as histograms, its pictures."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from PIL import Image  # which torch.utils.tensorboard needs for pictures
from torch.utils.tensorboard import SummaryWriter
from torchrl.record.loggers import TensorboardLogger as Writer

from fnnq_torchrl.config.loggers import TensorboardConfig
from fnnq_torchrl.config.schema import flat

from .base import JobResults, Logger, SweepResults


class TensorboardLogger(Logger):
    """See `.Logger`. By TorchRL's, which numbers and histograms are enough for.

    Args:
        settings: see ``conf/logger/tensorboard.yaml``.
    """

    def __init__(self, settings: TensorboardConfig) -> None:
        self._directory = settings.directory

    def log_job(self, job: JobResults) -> None:
        with self._writer(job.directory) as logger:
            self._log_job(logger, job)

    def log_sweep(self, sweep: SweepResults) -> None:
        with self._writer(sweep.directory) as logger:
            _log_pictures(logger, sweep.pictures, step=sweep.jobs)

    def _log_job(self, logger: Writer, job: JobResults) -> None:
        evaluations, curve = job.evaluations, job.curve
        best = len(job.job.config.evaluation.situations)
        for place, situations in enumerate(evaluations.situations.tolist()):
            for name, column in curve.items():
                logger.log_scalar(name, column[place], step=situations)
            logger.log_histogram(
                "catches", evaluations.catches[:, place], step=situations, bins=_bins(best)
            )
        writer: SummaryWriter = logger.experiment
        if "score_low" in curve:
            band = ["score", "score_low", "score_high"]
            writer.add_custom_scalars_marginchart(band, title="score with its interval")
        plain = {
            key: value if isinstance(value, bool | int | float | str) else repr(value)
            for key, value in flat(job.settings).items()
        }
        writer.add_hparams(plain, job.scores, run_name=".")
        _log_pictures(logger, job.pictures, step=int(evaluations.situations[-1]))

    @contextmanager
    def _writer(self, directory: Path) -> Iterator[Writer]:
        logger = Writer(exp_name=self._directory, log_dir=str(directory))
        try:
            yield logger
        finally:
            logger.experiment.close()


def _bins(best: int) -> list[float]:
    """The edges of a bin around each score, 0 … best."""
    return (np.arange(best + 2) - 0.5).tolist()


def _log_pictures(logger: Writer, pictures: Sequence[Path], step: int) -> None:
    for picture in pictures:
        with Image.open(picture) as image:
            pixels = np.asarray(image.convert("RGB"))
        logger.experiment.add_image(picture.stem, pixels, step, dataformats="HWC")
