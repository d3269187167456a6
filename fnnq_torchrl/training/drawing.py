"""Draws the learning curves of jobs and sweeps. A failure is reported but stops no training."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from fnnq_torchrl.training.jobs import PICTURE, Job
from fnnq_torchrl.training.results import Evaluations, read_evaluations
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.terminal import announce

if TYPE_CHECKING:  # this room's pictures import Matplotlib
    from fnnq_torchrl.training.pictures.curve import Curve


def draw_job(job: Job, evaluations: Evaluations | None = None) -> None:
    """Draw the learning curve of a finished job.

    Args:
        job: the job.
        evaluations: what its evaluations.csv contains; the file is read if this isn't given.
    """
    picture, score = job.directory / PICTURE, Score.of(job.config)
    with _optional(picture):
        from fnnq_torchrl.training.pictures.curves import learning_curve

        if evaluations is None:
            evaluations = read_evaluations(job.directory / "evaluations.csv", score.measure)
        learning_curve(evaluations, picture, score)


def draw_sweep(curves: "Sequence[Curve]", of: str, picture: Path, score: Score) -> None:
    """Draw the learning curves of a sweep; the arguments are those of `sweep_curves`."""
    with _optional(picture):
        from fnnq_torchrl.training.pictures.curves import sweep_curves

        sweep_curves(curves, of, picture, score)


@contextmanager
def _optional(picture: Path) -> Iterator[None]:
    """Report any failure in a block that draws a picture, and suppress the exception.

    Import Matplotlib within the block, because a user's settings can make the import fail.
    """
    try:
        yield
    except Exception as error:  # any exception: no result depends on the picture
        with suppress(OSError):  # an earlier picture would show other numbers
            picture.unlink()
        reason = " ".join(str(error).split()) or type(error).__name__
        announce(f"going on without {picture}, which can't be drawn: {reason}")
