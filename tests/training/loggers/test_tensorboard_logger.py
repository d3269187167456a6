"""TensorBoard's reader reads back all that is logged."""

import io
from pathlib import Path

import numpy as np
from PIL import Image
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.loggers import JobResults, Loggers, SweepResults
from tests.job_files import write_job


def read(directory: Path) -> EventAccumulator:
    events = EventAccumulator(str(directory), size_guidance={"scalars": 0, "histograms": 0})
    return events.Reload()


def test_a_job_has_its_curve_band_histograms_and_pictures(tmp_path: Path) -> None:
    job = write_job(
        tmp_path, "num_seeds=22", "logger=tensorboard", "logger.tensorboard.directory=events"
    )
    loggers = Loggers()
    loggers.log_job(job)
    assert not loggers.left_out

    events, evaluations = read(tmp_path / "events"), JobResults(job).evaluations
    columns = dict(
        zip(["score", "score_low", "score_high"], mean_interval(evaluations.catches), strict=True)
    )
    for name, column in (columns | {"steps": evaluations.steps.mean(axis=0)}).items():
        scalars = events.Scalars(name)
        assert [one.step for one in scalars] == evaluations.situations.tolist()
        assert [one.value for one in scalars] == column.astype(np.float32).tolist()
    for place, histogram in enumerate(events.Histograms("catches")):
        value = histogram.histogram_value
        counts = {
            limit - 0.5: count
            for limit, count in zip(value.bucket_limit, value.bucket, strict=True)
            if count
        }
        scores, expected = np.unique(evaluations.catches[:, place], return_counts=True)
        assert counts == dict(zip(scores, expected, strict=True))
    [picture] = events.Images("learning_curve")
    pixels = np.asarray(Image.open(io.BytesIO(picture.encoded_image_string)))
    assert pixels.shape == (6, 8, 3)
    assert pixels[0, 0].tolist() == [255, 127, 0]
    assert events.Scalars("mean_score")[0].value == np.float32(evaluations.mean_score.mean())
    assert "custom_scalars__config__" in events.Tags()["tensors"]  # the band


def test_a_video_moves_among_the_images(tmp_path: Path) -> None:
    job = write_job(tmp_path, "logger=tensorboard", "logger.video=true")
    loggers = Loggers()
    loggers.log_job(job)
    assert not loggers.left_out
    [video] = read(tmp_path / "tensorboard").Images("robot")
    assert video.encoded_image_string == (tmp_path / "robot.gif").read_bytes()
    assert (video.width, video.height, video.step) == (6, 4, 40)


def test_a_sweep_has_its_picture(tmp_path: Path) -> None:
    job = write_job(tmp_path, "logger=tensorboard")
    Loggers().log_sweep(SweepResults(tmp_path, [job] * 3))
    [picture] = read(tmp_path / "tensorboard").Images("learning_curve")
    assert picture.step == 3
