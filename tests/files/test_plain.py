"""Files of tensors and plain values: read as they were written, or refused in one line."""

import pickle
from pathlib import Path
from typing import Any
from zipfile import ZIP_DEFLATED, ZipFile

import pytest
import torch

from fnnq_torchrl.files.plain import read_plain, write_plain

CONTENT = {"weight": torch.arange(6.0).view(2, 3), "name": "of a kind", "places": [(1, 2.5)]}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "some.pt"
    write_plain(path, 7, CONTENT)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(ValueError, match=r"some\.pt") as refused:
        read_plain(path, 7, "a cup")
    assert "\n" not in str(refused.value)
    return str(refused.value).replace(str(path), "FILE")


def test_what_was_written_comes_back(path: Path) -> None:
    read = read_plain(path, 7, "a cup")
    assert read.pop("weight").equal(CONTENT["weight"])
    assert read == {"name": "of a kind", "places": [(1, 2.5)]}


def test_a_file_cut_anywhere_is_refused(path: Path) -> None:
    whole = path.read_bytes()
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        assert refusal(path) == "FILE is damaged, or not a cup"


def test_a_changed_number_is_noticed(path: Path) -> None:
    whole = path.read_bytes()
    number = torch.tensor(5.0).numpy().tobytes()
    path.write_bytes(whole.replace(number, torch.tensor(5.5).numpy().tobytes()))
    assert refusal(path) == "FILE is damaged, or not a cup"


class Code:
    def __reduce__(self) -> tuple[Any, ...]:
        return pytest.fail, ("ran code",)


@pytest.mark.parametrize("content", [Code(), {"format": 7, "weight": Code()}])
def test_a_file_with_code_in_it_runs_none(path: Path, content: Any) -> None:
    torch.save(content, path)
    assert refusal(path) == "FILE is damaged, or not a cup"
    path.write_bytes(pickle.dumps(content))
    assert refusal(path) == "FILE is damaged, or not a cup"


@pytest.mark.parametrize("content", [torch.zeros(3), {"weight": torch.zeros(3)}])
def test_another_programs_file_is_refused(path: Path, content: Any) -> None:
    torch.save(content, path)
    assert refusal(path) == "FILE is not a cup of fnnq_torchrl"


def test_another_format_is_refused(path: Path) -> None:
    write_plain(path, 8, CONTENT)
    assert refusal(path) == "FILE is a cup of format 8, and this program reads 7"


def test_a_small_file_that_would_become_large_is_refused(path: Path) -> None:
    with ZipFile(path) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    assert refusal(path) == "FILE is damaged, or not a cup"
