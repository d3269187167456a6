"""What a user gets who has the wheel and no checkout."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def python(*arguments: str, cwd: Path, path: str = "") -> str:
    """What `python *arguments` prints, with `path` in front of all that is installed."""
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env={**os.environ, "PYTHONPATH": path},
        check=True,
        stdout=subprocess.PIPE,
        text=True,
    ).stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    python("-m", "hatchling", "build", "-t", "wheel", "-d", str(folder), cwd=ROOT)
    (built,) = folder.glob("*.whl")
    return built


def test_holds_the_packages_and_the_configuration(wheel: Path) -> None:
    sources = {
        path.relative_to(ROOT).as_posix()
        for folder, pattern in (
            ("envs", "*.py"),
            ("fnnq_torchrl", "*.py"),
            ("hydra_plugins", "*.py"),
            ("conf", "*.yaml"),
        )
        for path in (ROOT / folder).rglob(pattern)
    }
    expected = {f"fnnq_torchrl/{name}" if name.startswith("conf/") else name for name in sources}
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert packed == expected


def test_trains_from_another_directory(wheel: Path, tmp_path: Path) -> None:
    site, home = tmp_path / "site", tmp_path / "home"
    home.mkdir()
    python(
        *("-m", "pip", "install", "-qq", "--no-index", "--no-deps", "--no-compile"),
        *("--target", str(site), str(wheel)),
        cwd=home,
    )
    where = "import envs, fnnq_torchrl; print(envs.__path__[0], fnnq_torchrl.__path__[0])"
    assert python("-c", where, cwd=home, path=str(site)).split() == [
        str(site / "envs"),
        str(site / "fnnq_torchrl"),
    ]

    python("-m", "fnnq_torchrl.train", "situations=5", "num_seeds=2", cwd=home, path=str(site))
    (evaluations,) = home.glob("outputs/**/evaluations.csv")
    assert {path.name for path in evaluations.parent.iterdir()} >= {
        ".hydra",
        "checkpoint.pt",
        "learning_curve.png",
        "summary.json",
    }
