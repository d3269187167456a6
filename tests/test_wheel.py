"""The wheel, installed without a checkout as by a user."""

import os
import subprocess
import sys
import tomllib
import venv
import zipfile
from collections.abc import Iterator
from email import message_from_bytes
from importlib.metadata import Distribution, distribution
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]


def run(*command: str | Path, cwd: Path) -> str:
    """Run a command without this checkout on its path, and return its output."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(
        command, cwd=cwd, env=environment, check=True, stdout=subprocess.PIPE, text=True
    ).stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    run(sys.executable, *["-m", "hatchling", "build", "-t", "wheel", "-d"], folder, cwd=ROOT)
    (built,) = folder.glob("*.whl")
    return built


def test_holds_the_packages_and_the_configuration(wheel: Path) -> None:
    sources = {
        path.relative_to(ROOT).as_posix()
        for folder, pattern in (
            ("envs", "*.py"),
            ("envs", "py.typed"),
            ("fnnq_torchrl", "*.py"),
            ("fnnq_torchrl", "py.typed"),
            ("fnnq_torchrl/studies", "*.js"),
            ("fnnq_torchrl/studies", "*.css"),
            ("fnnq_torchrl/studies", "*.html"),
            ("hydra_plugins", "*.py"),
            ("conf", "*.*"),
        )
        for path in (ROOT / folder).rglob(pattern)
    }
    expected = {f"fnnq_torchrl/{name}" if name.startswith("conf/") else name for name in sources}
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert packed == expected


def test_the_citation_names_the_same_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == project["version"]


def needed(requirements: list[str]) -> Iterator[Distribution]:
    """Yield the installed distributions that requirements need, directly or indirectly."""
    known, names = set(), [*requirements]
    while names:
        requirement = Requirement(names.pop())
        of_extras = [{"extra": extra} for extra in ("", *requirement.extras)]
        if requirement.marker and not requirement.marker.evaluate({"extra": ""}):
            continue
        found = distribution(requirement.name)
        if (key := (found.name, *sorted(requirement.extras))) in known:
            continue
        known.add(key)
        yield found
        for text in found.requires or []:
            further = Requirement(text)
            if further.marker is None or any(map(further.marker.evaluate, of_extras)):
                further.marker = None
                names.append(str(further))


@pytest.mark.long
def test_trains_from_another_directory_with_its_declared_dependencies_alone(
    wheel: Path, tmp_path: Path
) -> None:
    """The environment has links to the wheel's dependencies only, and pip finds none missing."""
    venv.create(tmp_path / "empty", symlinks=True, with_pip=False)
    (site,) = (tmp_path / "empty").glob("lib/python*/site-packages")
    metadata = next(name for name in zipfile.ZipFile(wheel).namelist() if "METADATA" in name)
    asked = message_from_bytes(zipfile.ZipFile(wheel).read(metadata)).get_all("Requires-Dist", [])
    for each in needed(asked):
        for entry in {file.parts[0] for file in each.files or []} - {"..", "__pycache__"}:
            if not (site / entry).exists():
                (site / entry).symlink_to(Path(str(each.locate_file(entry))))
    assert not (site / "pytest").exists()
    python, home = tmp_path / "empty/bin/python", tmp_path / "home"
    home.mkdir()
    pip = (sys.executable, "-m", "pip", "--python", python)
    run(*pip, "install", "-qq", "--no-index", "--no-compile", wheel, cwd=home)
    where = "import envs, fnnq_torchrl; print(envs.__path__[0], fnnq_torchrl.__path__[0])"
    assert run(python, "-c", where, cwd=home).split() == [
        str(site / "envs"),
        str(site / "fnnq_torchrl"),
    ]

    # The user's own package ``envs``, which `python -m` finds before ours.
    (home / "envs").mkdir()
    (home / "envs" / "__init__.py").write_text("raise RuntimeError")
    hidden = subprocess.run(
        [python, "-m", "fnnq_torchrl"], cwd=home, capture_output=True, text=True, check=False
    )
    assert (hidden.returncode, hidden.stderr.count("\n")) == (2, 1)
    assert "hides the package envs" in hidden.stderr

    run(tmp_path / "empty/bin/fnnq-train", "situations=5", "num_seeds=2", cwd=home)
    (evaluations,) = home.glob("outputs/**/evaluations.csv")
    assert {path.name for path in evaluations.parent.iterdir()} >= {
        ".hydra",
        "checkpoint.pt",
        "learning_curve.png",
        "summary.json",
    }
