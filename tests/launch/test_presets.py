"""A user's own presets, found by --config-dir."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fnnq_torchrl.launch.launcher import Multirun
from fnnq_torchrl.training import job as job_module
from tests.commands import fnnq_train

Train = Callable[..., tuple[int, str, list[float]]]


@pytest.fixture
def train(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Train:
    """Return a function that runs the command with a new preset and returns the jobs' λ."""
    monkeypatch.chdir(tmp_path)
    trained: list[float] = []

    def run_batches(batches, **others):
        trained.extend(job.config.lam for batch in batches for job in batch)
        return ([1.0] * len(batch) for batch in batches)

    monkeypatch.setattr(job_module, "run_batches", run_batches)
    monkeypatch.setattr(job_module, "run_job", lambda config, _: trained.append(config.lam))
    monkeypatch.setattr(Multirun, "_write_whole", lambda self, first: None)

    def train(preset: str, *arguments: str) -> tuple[int, str, list[float]]:
        folder = tmp_path / "my" / "experiment"
        folder.mkdir(parents=True)
        (folder / "mine.yaml").write_text(f"# @package _global_\n{preset}\n")
        quiet = ("hydra/job_logging=none", "hydra/hydra_logging=none")
        status = fnnq_train("+experiment=mine", *quiet, "--config-dir", "my", *arguments)
        return status, capsys.readouterr().err, trained

    return train


@pytest.mark.parametrize(
    "sweeper",
    ["{params: {lam: '0,0.1'}}", "{cases: [{lam: 0}, {lam: 0.1}]}"],
    ids=["params", "cases"],
)
@pytest.mark.parametrize("mode", ["", "mode: MULTIRUN, "])
def test_what_it_sweeps_is_swept(train: Train, sweeper: str, mode: str) -> None:
    assert train(f"hydra: {{{mode}sweeper: {sweeper}}}") == (0, "", [0.0, 0.1])


def test_a_mode_that_is_set_stays(train: Train) -> None:
    assert train("hydra: {mode: RUN, sweeper: {params: {lam: '0,0.1'}}}") == (0, "", [0.2])


def test_nothing_to_sweep_is_one_job(train: Train) -> None:
    assert train("lam: 0.7") == (0, "", [0.7])


@pytest.mark.parametrize(
    ("preset", "told"),
    [
        (
            "hydra: {sweeper: {parms: {lam: '0,0.1'}}}",
            "hydra.sweeper.parms: there is no such key; did you mean hydra.sweeper.params?",
        ),
        (
            "hydra: {mode: MULTIRUN, launcher: {cpu: 2}}",
            "hydra.launcher.cpu: there is no such key; did you mean hydra.launcher.cpus?",
        ),
        (
            "hydra: {sweeper: {params: {lamm: '0,0.1'}}}",
            "job 0 (lamm=0 +experiment=mine): lamm=0: there is no lamm; did you mean lam?",
        ),
        ("lamm: 1", "lamm: there is no lamm; did you mean lam?"),
    ],
    ids=["sweeper", "launcher", "swept", "set"],
)
@pytest.mark.parametrize("flags", [(), ("-m",)], ids=["", "-m"])
def test_a_misspelt_key_is_one_line_and_leaves_nothing(
    train: Train, tmp_path: Path, preset: str, told: str, flags: tuple[str, ...]
) -> None:
    status, line, trained = train(preset, *flags)
    assert (status, trained) == (2, [])
    assert line.removeprefix("job 0 (+experiment=mine): ") == f"{told}\n"
    assert [path.name for path in tmp_path.iterdir()] == ["my"]
