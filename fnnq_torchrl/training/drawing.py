"""Draws learning curves, and videos of the robot. A failure is reported but stops no training."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fnnq_torchrl.training.jobs import PARAMETERS_PICTURE, PICTURE, VIDEO, Job
from fnnq_torchrl.training.results import Evaluations, read_evaluations
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.terminal import announce

if TYPE_CHECKING:  # this room's pictures import Matplotlib
    from fnnq_torchrl.training.pictures.curve import Curve


def draw_job(job: Job, evaluations: Evaluations | None = None) -> None:
    """Draw the learning curve of a finished job, and the course of its adaptive parameters, if any.

    Args:
        job: the job.
        evaluations: what its evaluations.csv contains; the file is read if this isn't given.
    """
    picture, score = job.directory / PICTURE, Score.of(job.config)
    with optional(picture):
        from fnnq_torchrl.training.pictures.curves import learning_curve

        if evaluations is None:
            evaluations = read_evaluations(job.directory / "evaluations.csv", score.measure)
        learning_curve(evaluations, picture, score)
    if job.config.adaptive != "none" and evaluations is not None:
        picture = job.directory / PARAMETERS_PICTURE
        with optional(picture):
            from fnnq_torchrl.training.pictures.parameters import parameters_picture

            parameters_picture(evaluations, picture, score)


def draw_video(job: Job) -> None:
    """Draw the first situations of a finished job's last test, played by its best run."""
    video = job.directory / VIDEO
    with optional(video):
        from fnnq_torchrl.training.policies import best_seed
        from fnnq_torchrl.training.watching import panel_title, play, write_gif
        from fnnq_torchrl.training.weights import load_checkpoint

        checkpoint = load_checkpoint(job.directory / "checkpoint.pt")
        panels = min(_PANELS, job.config.evaluation.tests)
        [films] = play(job.config, checkpoint, [best_seed(job.directory)], panels, learned=True)
        titles = [panel_title(number, learned=True) for number in range(1, panels + 1)]
        every = max(2, ceil(max(map(len, films)) / _FRAMES))
        write_gif(films, titles, video, size_px=_PANEL_PX, every=every, columns=panels)


def draw_sweep(curves: "Sequence[Curve]", of: str, picture: Path, score: Score) -> None:
    """Draw the learning curves of a sweep; the arguments are those of `sweep_curves`."""
    with optional(picture):
        from fnnq_torchrl.training.pictures.curves import sweep_curves

        sweep_curves(curves, of, picture, score)


def draw_search(study: Any, directory: Path) -> None:
    """Draw Optuna's own figures of a study, one file for each."""
    for name in ("optimization_history", "slice", "param_importances"):
        picture = directory / f"{name}.png"
        with optional(picture):
            from fnnq_torchrl.training.pictures.search import search_picture

            search_picture(study, name, picture)


_PANELS, _PANEL_PX = 3, 240
_FRAMES = 80  # the most frames in a video; drawing one takes some hundredths of a second


@contextmanager
def optional(picture: Path) -> Iterator[None]:
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
