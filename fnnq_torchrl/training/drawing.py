"""Draws the learning curves of jobs and sweeps. A failure is reported but stops no training."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fnnq_torchrl.training.jobs import PICTURE, Job
from fnnq_torchrl.training.pictures.curve import Curve
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.terminal import announce


def draw_job(job: Job) -> None:
    """Draw the learning curve of a finished job from its evaluations.csv."""
    picture = job.directory / PICTURE
    with _optional(picture):
        from fnnq_torchrl.training.pictures.curves import learning_curve

        learning_curve(job.directory / "evaluations.csv", picture, Score.of(job.config))


def draw_sweep(curves: Sequence[Curve], of: str, picture: Path, score: Score) -> None:
    """Draw the learning curves of a sweep; the arguments are those of `sweep_curves`."""
    with _optional(picture):
        from fnnq_torchrl.training.pictures.curves import sweep_curves

        sweep_curves(curves, of, picture, score)


def draw_search(study: Any, directory: Path) -> None:
    """Draw Optuna's own figures of a study, one file for each."""
    for name in ("optimization_history", "slice", "param_importances"):
        picture = directory / f"{name}.png"
        with _optional(picture):
            from fnnq_torchrl.training.pictures.search import search_picture

            search_picture(study, name, picture)


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
