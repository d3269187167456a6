"""TensorBoard, through TorchRL's logger: curve, interval, histograms, settings, pictures, video."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image  # torch.utils.tensorboard needs it, too
from tensorboard.compat.proto.summary_pb2 import Summary
from torch.utils.tensorboard import SummaryWriter
from torchrl.record.loggers import TensorboardLogger as TorchrlLogger

from fnnq_torchrl.config.checking import flat
from fnnq_torchrl.config.loggers import TensorboardConfig

from .base import JobResults, Logger, SweepResults


class TensorboardLogger(Logger):
    """A logger that writes event files into the directory of each job and sweep.

    Args:
        settings: the settings that ``conf/logger/tensorboard.yaml`` explains.
    """

    def __init__(self, settings: TensorboardConfig) -> None:
        self._directory = settings.directory

    def log_job(self, job: JobResults) -> None:
        logger = self._logger(job.directory)
        catches, situations = job.evaluations.catches, job.evaluations.situations.tolist()
        edges = (np.arange(catches.max() + 2) - 0.5).tolist()  # a bin around each number of catches
        with logger.experiment as writer:
            for place, step in enumerate(situations):
                for name, column in job.curve.items():
                    logger.log_scalar(name, column[place], step=step)
                logger.log_histogram("catches", catches[:, place], step=step, bins=edges)
            if "score_low" in job.curve:
                band = ["score", "score_low", "score_high"]
                writer.add_custom_scalars_marginchart(band, title="score with its interval")
            plain = {
                key: value if isinstance(value, bool | int | float | str) else repr(value)
                for key, value in flat(job.settings).items()
            }
            writer.add_hparams(plain, job.scores, run_name=".")
            _add_pictures(writer, job.pictures, situations[-1])
            if job.video is not None:
                _add_video(writer, job.video, situations[-1])

    def log_sweep(self, sweep: SweepResults) -> None:
        with self._logger(sweep.directory).experiment as writer:
            _add_pictures(writer, sweep.pictures, len(sweep.jobs))

    def _logger(self, directory: Path) -> TorchrlLogger:
        return TorchrlLogger(exp_name=self._directory, log_dir=str(directory))


def _add_pictures(writer: SummaryWriter, pictures: Sequence[Path], step: int) -> None:
    for picture in pictures:
        with Image.open(picture) as image:
            pixels = np.asarray(image.convert("RGB"))
        writer.add_image(picture.stem, pixels, step, dataformats="HWC")


def _add_video(writer: SummaryWriter, video: Path, step: int) -> None:
    """Add a GIF, which TensorBoard shows moving among the images.

    TorchRL's `log_video` and torch's `add_video` make a GIF of frames, with the library moviepy.
    """
    with Image.open(video) as image:
        width, height = image.size
    gif = Summary.Image(
        height=height, width=width, colorspace=3, encoded_image_string=video.read_bytes()
    )
    value = Summary.Value(tag=video.stem, image=gif)
    events: Any = writer
    events._get_file_writer().add_summary(Summary(value=[value]), step)
