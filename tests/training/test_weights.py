"""checkpoint.pt and snapshots.pt are read as written; damaged files are in test_damaged_files."""

from pathlib import Path
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor

from fnnq_torchrl.training.weights import (
    load_checkpoint,
    load_snapshots,
    save_checkpoint,
    save_snapshots,
)

SEED, LAM, SITUATIONS = [3, 4], [0.2, 0.1], [0, 5, 10]
CONFIG = {"alpha": 0.4, "trace": "output", "env": {"dt_s": 0.1, "reset": None}, "balls": [1, 2]}


def weights(*evaluations: int) -> dict[str, Tensor]:
    """Return weights of two runs, with the runs as the last dimension in memory, as in a job."""
    shape = (*evaluations, 5, 4, 2)
    rules = torch.arange(1.0, 1.0 + torch.Size(shape).numel()).view(shape)
    return {"consequents": rules.movedim(-1, -3), "bias": torch.ones(*evaluations, 2)}


def test_a_checkpoint_comes_back(tmp_path: Path) -> None:
    save_checkpoint(tmp_path / "checkpoint.pt", weights(), SEED, LAM, CONFIG)
    checkpoint = load_checkpoint(tmp_path / "checkpoint.pt")
    torch.testing.assert_close(checkpoint.weights, weights(), rtol=0, atol=0)
    assert all(weight.is_contiguous() for weight in checkpoint.weights.values())
    torch.testing.assert_close(checkpoint.seed, torch.tensor(SEED))
    torch.testing.assert_close(checkpoint.lam, torch.tensor(LAM, dtype=torch.float64))
    assert checkpoint.config == CONFIG


def test_snapshots_come_back(tmp_path: Path) -> None:
    save_snapshots(tmp_path / "snapshots.pt", weights(3), SITUATIONS, SEED, LAM, CONFIG)
    snapshots = load_snapshots(tmp_path / "snapshots.pt")
    torch.testing.assert_close(snapshots.weights, weights(3), rtol=0, atol=0)
    assert all(weight.is_contiguous() for weight in snapshots.weights.values())
    torch.testing.assert_close(snapshots.situations, torch.tensor(SITUATIONS))
    torch.testing.assert_close(snapshots.seed, torch.tensor(SEED))
    torch.testing.assert_close(snapshots.lam, torch.tensor(LAM, dtype=torch.float64))
    assert snapshots.config == CONFIG


def test_a_modules_parameters_are_stored_by_their_dotted_names(tmp_path: Path) -> None:
    parameters = TensorDict.from_module(torch.nn.ModuleDict({"rules": torch.nn.Linear(3, 2)}))
    save_checkpoint(tmp_path / "checkpoint.pt", parameters, SEED, LAM, CONFIG)
    loaded = load_checkpoint(tmp_path / "checkpoint.pt").weights
    assert set(loaded) == {"rules.weight", "rules.bias"}
    torch.testing.assert_close(loaded["rules.weight"], parameters["rules", "weight"].detach())


@pytest.mark.parametrize(
    "padded",
    [torch.zeros(100_000, 5, 4), torch.zeros(5, 4, 100_000).movedim(-1, 0)],
    ids=["runs first in memory", "runs last in memory"],
)
def test_weights_are_stored_runs_first_without_padding(tmp_path: Path, padded: Tensor) -> None:
    save_checkpoint(tmp_path / "checkpoint.pt", {"consequents": padded[:2]}, SEED, LAM, CONFIG)
    loaded = load_checkpoint(tmp_path / "checkpoint.pt").weights["consequents"]
    assert loaded.shape == (2, 5, 4)
    assert loaded.is_contiguous()
    assert (tmp_path / "checkpoint.pt").stat().st_size < 10_000


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"situations": [0, 5]}, r"consequents must be \[2, 2, ...\], not \[3, 2, 5, 4\]"),
        ({"seed": [3]}, "1 seeds and 2 λ"),
        ({"seed": [3], "lam": [0.2]}, r"consequents must be \[3, 1, ...\]"),
        ({"weights": {"bias": torch.zeros(3)}}, r"bias must be \[3, 2, ...\], not \[3\]"),
    ],
)
def test_shapes_that_do_not_agree_are_not_saved(
    tmp_path: Path, change: dict[str, Any], reason: str
) -> None:
    given = {"weights": weights(3), "situations": SITUATIONS, "seed": SEED, "lam": LAM} | change
    with pytest.raises(ValueError, match=reason):
        save_snapshots(tmp_path / "snapshots.pt", **given, config=CONFIG)
    assert not list(tmp_path.iterdir())


def test_a_configuration_that_could_not_be_loaded_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="PosixPath"):
        save_checkpoint(tmp_path / "checkpoint.pt", weights(), SEED, LAM, {"out": tmp_path})
    assert not list(tmp_path.iterdir())


def test_one_file_taken_for_the_other_is_told_in_one_line(tmp_path: Path) -> None:
    checkpoint, snapshots = tmp_path / "checkpoint.pt", tmp_path / "snapshots.pt"
    save_checkpoint(checkpoint, weights(), SEED, LAM, CONFIG)
    save_snapshots(snapshots, weights(3), SITUATIONS, SEED, LAM, CONFIG)
    with pytest.raises(ValueError, match=r"/snapshots\.pt is not a checkpoint$"):
        load_checkpoint(snapshots)
    with pytest.raises(ValueError, match=r"/checkpoint\.pt is not a file of snapshots$"):
        load_snapshots(checkpoint)


@pytest.mark.parametrize("load", [load_checkpoint, load_snapshots])
def test_a_missing_file_is_the_usual_error(tmp_path: Path, load: Any) -> None:
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "weights.pt")
