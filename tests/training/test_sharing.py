"""A job tells at its start how many tiles share a weight."""

from pathlib import Path

import pytest

from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.sharing import sharing_in_words
from tests.compositions import config_of

CAR = ("task=mountain_car", "value=tiles")


def test_a_job_tells_its_shared_tiles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = ("value.memory=100", "value.tilings=2", "env.time_limit_steps=20")
    config = config_of(*CAR, *few, "situations=5", "evaluation=none", "engine=eager")
    run_job(config, tmp_path)
    words = sharing_in_words(config)
    assert words is not None
    assert words.startswith(
        "486 tiles share 200 weights of a run (value.memory): 2.4 tiles a weight"
    )
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("overrides", [CAR, (*CAR, "value.memory=243"), ("value=mlp",)])
def test_nothing_is_told_if_no_tiles_share_a_weight(overrides: tuple[str, ...]) -> None:
    assert sharing_in_words(config_of(*overrides)) is None


def test_pairs_of_inputs_have_far_fewer_tiles() -> None:
    pole = ("task=cart_pole", "value.tilings=4", "value.tiles=8", "value.memory=1")
    whole, pairs = (
        sharing_in_words(config_of(f"value={kind}", *pole)) for kind in ("tiles", "tiles_sum")
    )
    assert whole is not None
    assert whole.startswith(f"{4 * 2 * 9**4:,} tiles")
    assert pairs is not None
    assert pairs.startswith(f"{6 * 4 * 2 * 9**2:,} tiles")
