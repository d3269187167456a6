"""The weights of all evaluations on disk; what both files refuse is in test_checkpoint.py."""

import io
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from fnnq_torchrl.training.snapshot_file import load_snapshots, save_snapshots

SITUATIONS, SEED, LAM = [0, 5, 10], [3, 4], [0.2, 0.1]
CONFIG = {"alpha": 0.4, "value": {"kind": "table"}, "balls": [1, 2]}


def weights() -> dict[str, Tensor]:
    """With the runs last in memory, as a job has them."""
    rules = torch.arange(120.0).view(3, 5, 4, 2).movedim(-1, 1)
    return {"weight": rules, "bias": torch.arange(6.0).view(3, 2)}


def test_round_trip(tmp_path: Path) -> None:
    save_snapshots(tmp_path / "snapshots.pt", weights(), SITUATIONS, SEED, LAM, CONFIG)
    snapshots = load_snapshots(tmp_path / "snapshots.pt")
    torch.testing.assert_close(snapshots.weights, weights(), rtol=0, atol=0)
    assert all(weight.is_contiguous() for weight in snapshots.weights.values())
    assert snapshots.situations.equal(torch.tensor(SITUATIONS))
    assert snapshots.seed.equal(torch.tensor(SEED))
    assert snapshots.lam.equal(torch.tensor(LAM, dtype=torch.float64))
    assert snapshots.config == CONFIG


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"situations": [0, 5]}, r"weights 'weight' must be \[2 evaluations, 2 runs, ...\]"),
        ({"seed": [3]}, r"seed and lam \[runs\], got \[3\], \[1\], \[2\]"),
        ({"seed": [3], "lam": [0.2]}, r"weights 'weight' must be \[3 evaluations, 1 runs, ...\]"),
        ({"weights": {"bias": torch.zeros(3)}}, "weights 'bias' must be"),
        ({"situations": 5}, r"situations must be \[evaluations\]"),
    ],
)
def test_shapes_that_do_not_agree_are_not_saved(
    tmp_path: Path, change: dict[str, Any], reason: str
) -> None:
    given = {"weights": weights(), "situations": SITUATIONS, "seed": SEED, "lam": LAM} | change
    with pytest.raises(ValueError, match=reason):
        save_snapshots(tmp_path / "snapshots.pt", **given, config=CONFIG)
    assert not list(tmp_path.iterdir())


WHOLE = {
    "format": 1,
    "weights": weights(),
    "situations": torch.tensor(SITUATIONS),
    "seed": torch.tensor(SEED),
    "lam": torch.ones(2).double(),
    "config": CONFIG,
}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ({"format": 2}, "has snapshots format 2, and this program reads 1"),
        ({"format": 1, "seed": torch.tensor([3])}, "not a complete file of snapshots"),
        (WHOLE | {"weights": {"a": 0}}, "not a complete file of snapshots"),
        (WHOLE | {"seed": torch.zeros(2)}, "situations and seed must be int64"),
        (WHOLE | {"lam": torch.ones(2)}, "lam float64, got torch.int64, .*float32"),
        (WHOLE | {"situations": [0, 5, 10]}, "not a complete file of snapshots"),
    ],
)
def test_another_file_is_refused_in_one_line(tmp_path: Path, content: Any, reason: str) -> None:
    file = io.BytesIO()
    torch.save(content, file)
    path = tmp_path / "snapshots.pt"
    path.write_bytes(file.getvalue())
    with pytest.raises(ValueError, match=reason) as caught:
        load_snapshots(path)
    assert "\n" not in str(caught.value)
    path.write_bytes(file.getvalue()[:-9])
    with pytest.raises(ValueError, match="not a file of snapshots, or a damaged one"):
        load_snapshots(path)


def test_a_missing_file_is_the_usual_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_snapshots(tmp_path / "snapshots.pt")
