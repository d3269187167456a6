import contextlib
import io
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict
from torch import Tensor

from fnnq_torchrl.training.checkpoint import load_checkpoint, save_checkpoint

SEED, LAM = np.array([3, 4]), np.array([0.2, 0.1])
CONFIG = {"alpha": 0.4, "trace": "output", "env": {"dt_s": 0.1, "reset": None}, "balls": [1, 2]}


def weights() -> dict[str, Tensor]:
    return {"consequents": torch.arange(40.0).view(2, 5, 4), "bias": torch.tensor([0.5, -0.5])}


def saved(path: Path) -> bytes:
    save_checkpoint(path, weights(), SEED, LAM, CONFIG)
    return path.read_bytes()


def torch_bytes(content: object) -> bytes:
    file = io.BytesIO()
    torch.save(content, file)
    return file.getvalue()


def test_round_trip(tmp_path: Path) -> None:
    saved(tmp_path / "checkpoint.pt")
    checkpoint = load_checkpoint(tmp_path / "checkpoint.pt")
    torch.testing.assert_close(checkpoint.weights, weights(), rtol=0, atol=0)
    torch.testing.assert_close(checkpoint.seed, torch.tensor([3, 4]))
    torch.testing.assert_close(checkpoint.lam, torch.tensor([0.2, 0.1], dtype=torch.float64))
    assert checkpoint.config == CONFIG


def test_a_module_s_parameters_are_stored_by_their_dotted_names(tmp_path: Path) -> None:
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
    ("seed", "lam", "bias", "reason"),
    [
        ([3, 4], [0.2, 0.1], torch.zeros(3), "weights 'bias' must be"),
        ([3, 4], [0.2, 0.1], torch.tensor(0.0), "weights 'bias' must be"),
        ([3, 4], [0.2], torch.zeros(2), r"must both be \[runs\]"),
        (3, 0.2, torch.zeros(2), r"must both be \[runs\]"),
    ],
)
def test_shapes_that_do_not_agree_are_not_saved(
    tmp_path: Path, seed: Any, lam: Any, bias: Tensor, reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        save_checkpoint(tmp_path / "checkpoint.pt", {"bias": bias}, seed, lam, CONFIG)
    assert not list(tmp_path.iterdir())


def test_a_configuration_that_could_not_be_loaded_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="PosixPath"):
        save_checkpoint(tmp_path / "checkpoint.pt", weights(), SEED, LAM, {"out": tmp_path})
    assert not list(tmp_path.iterdir())


def test_a_file_cut_anywhere_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "checkpoint.pt"
    content = saved(path)
    for length in range(0, len(content), 7):
        path.write_bytes(content[:length])
        with pytest.raises(ValueError, match="not a checkpoint, or a damaged one"):
            load_checkpoint(path)


@given(data=st.data())
def test_a_damaged_byte_never_gives_another_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("checkpoint") / "checkpoint.pt"
    content = bytearray(saved(path))
    content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    with contextlib.suppress(ValueError):
        load_checkpoint(path)


class RunsCode:
    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("owned",)


WHOLE = {"format": 1, "weights": {}, "seed": torch.tensor([3]), "lam": torch.ones(1).double()}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "not a checkpoint, or a damaged one"),
        (b"seed,lam,situations,steps,catches\n", "not a checkpoint, or a damaged one"),
        (b"\x80\x04N.", "not a checkpoint, or a damaged one"),
        (torch_bytes(RunsCode()), "not a checkpoint, or a damaged one"),
        (torch_bytes(torch.zeros(3)), "not a checkpoint of fnnq_torchrl"),
        (torch_bytes({"weight": torch.zeros(3)}), "not a checkpoint of fnnq_torchrl"),
        (torch_bytes({"format": 2}), "has checkpoint format 2, and this program reads 1"),
        (torch_bytes({"format": torch.zeros(2)}), "has checkpoint format"),
        (torch_bytes(WHOLE), "not a complete checkpoint"),
        (torch_bytes(WHOLE | {"config": {}, "weights": 0}), "not a complete checkpoint"),
        (torch_bytes(WHOLE | {"config": {}, "weights": {"a": 0}}), "not a complete checkpoint"),
        (torch_bytes(WHOLE | {"config": {}, "seed": 3}), "not a complete checkpoint"),
        (
            torch_bytes(WHOLE | {"config": {}, "lam": torch.ones(1)}),
            "must be int64 and lam float64",
        ),
    ],
)
def test_a_foreign_file_is_refused_in_one_line_and_runs_no_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes, reason: str
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "checkpoint.pt"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=reason) as caught:
        load_checkpoint(path)
    assert "\n" not in str(caught.value)
    assert [left.name for left in tmp_path.iterdir()] == ["checkpoint.pt"]


def test_a_missing_file_is_the_usual_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_checkpoint(tmp_path / "checkpoint.pt")
