"""The C programs that the benchmarks compare with: each compiles, runs, and prints a rate."""

import shutil
import subprocess
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.skipif(not shutil.which("gcc"), reason="needs gcc")
@pytest.mark.parametrize("name", ["limit", "limit_mlp", "limit_mountain_car", "limit_tiles"])
def test_a_c_program_prints_its_rate(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(BENCHMARKS)  # as Python does for a script there
    from watched import run_watched
    from yardsticks import FOLDER, readings_of

    program = tmp_path / name
    subprocess.run(
        ["gcc", "-O1", "-fopenmp", FOLDER / f"{name}.c", "-o", program, "-lm"], check=True
    )
    [(runs, reading)] = readings_of(run_watched([str(program), "20", "3000"])).items()
    assert runs == 20
    assert reading.rate > 0
