"""Runs whose weights are subnormal numbers are found and told."""

import json
from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict

from fnnq_torchrl.training.denormals import with_denormals
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.results import read_evaluations
from tests.programs import config


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@given(st.data())
def test_a_run_is_found_by_any_of_its_weights(dtype: torch.dtype, data: st.DataObject) -> None:
    tiny = torch.finfo(dtype).tiny
    fine = st.sampled_from([0.0, -0.0, tiny, -tiny, 1.0, float("inf"), float("nan")])
    subnormal = st.sampled_from([tiny / 2, -tiny / 2, tiny * torch.finfo(dtype).eps])
    weights = torch.tensor(data.draw(st.lists(fine, min_size=12, max_size=12)), dtype=dtype)
    weights = TensorDict({"a": weights[:6].view(3, 2), "b": weights[6:].view(3, 1, 2)}, [3])
    expected = [data.draw(st.booleans()) for _ in range(3)]
    for run, hit in enumerate(expected):
        if hit:
            weights[data.draw(st.sampled_from("ab"))][run].view(-1)[1] = data.draw(subnormal)
    assert with_denormals(weights).tolist() == expected


@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_a_job_tells_and_counts_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], dtype: str
) -> None:
    runs = ("situations=5", "engine=eager", f"machine.dtype={dtype}", "seed=3", "num_seeds=2")
    run_job(config(*runs, "alpha=1e-42"), tmp_path)
    counted = json.loads((tmp_path / "summary.json").read_text())["denormal_runs"]
    marked = read_evaluations(tmp_path / "evaluations.csv").denormal.tolist()
    stderr = capsys.readouterr().err
    if dtype == "float32":
        assert counted == 2
        assert marked == [[False, True], [False, True]]
        [line] = [line for line in stderr.splitlines() if "denormal" in line]
        assert line.startswith("denormal: 2 of 2 runs (seed 3, 4) have weights too small")
    else:
        assert counted == 0
        assert marked == [[False, False], [False, False]]
        assert "denormal" not in stderr
