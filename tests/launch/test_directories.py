"""The directory and files that a refused command leaves."""

from pathlib import Path

import pytest

from fnnq_torchrl.launch.directories import OutputDirectory


def files(root: Path) -> dict[str, str]:
    return {
        str(path.relative_to(root)): path.read_text() if path.is_file() else ""
        for path in root.rglob("*")
    }


def write(directory: Path, *names: str) -> None:
    for name in names:
        path = directory / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("new")


HYDRAS = (".hydra/config.yaml", ".hydra/hydra.yaml", "train.log", "multirun.yaml", "0/train.log")


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


@pytest.mark.parametrize("name", ["outputs/deep/job", ".", "../elsewhere"])
def test_a_new_directory_goes(name: str, here: Path) -> None:
    directory = OutputDirectory(Path(name))
    write(Path(name), *HYDRAS)
    directory.restore()
    assert files(here.parent) == {"here": ""}


def test_a_directory_beside_others_goes_alone(here: Path) -> None:
    directory = OutputDirectory(Path("outputs/job"))
    write(Path("outputs"), "other/training.pt")
    before = files(here)
    write(Path("outputs/job"), *HYDRAS)
    directory.restore()
    assert files(here) == before


@pytest.mark.parametrize("result", ["training.pt", "0/summary.json", "0/evaluations.csv"])
def test_results_stay(result: str, here: Path) -> None:
    directory = OutputDirectory(Path("job"))
    write(Path("job"), *HYDRAS, result)
    before = files(here)
    directory.restore()
    assert files(here) == before


def test_the_configuration_of_an_earlier_job_is_put_back(here: Path) -> None:
    write(Path("job"), "training.pt")
    (Path("job") / ".hydra").mkdir()
    (Path("job") / ".hydra" / "config.yaml").write_text("num_seeds: 2000")
    before = files(here)
    directory = OutputDirectory(Path("job"))
    write(Path("job"), ".hydra/config.yaml")
    directory.restore()
    assert files(here) == before


def test_a_file_in_its_place_stays(here: Path) -> None:
    write(here, "job")
    OutputDirectory(Path("job")).restore()
    assert files(here) == {"job": "new"}
