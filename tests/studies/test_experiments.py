from pathlib import Path

import numpy as np
import pytest

from fnnq_torchrl.studies.experiments import NoResults, newest_experiment, read_experiment
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.training.results import Evaluations
from tests.experiment_files import grid, write_experiment


@pytest.fixture
def sweep(tmp_path: Path) -> Path:
    directory = tmp_path / "traces" / "2026-01-02_03-04-05"
    write_experiment(
        directory, grid({"trace": "output,gradient", "lam": "0,0.2"}), lambda settings: 3, runs=3
    )
    return directory


def test_the_jobs_are_found_by_their_settings(sweep: Path) -> None:
    experiment = read_experiment(sweep, "traces")
    assert experiment.varied == ["lam", "trace"]
    assert experiment.runs == 3
    assert experiment.values("trace") == ["output", "gradient"]
    job = experiment.job(trace="gradient", lam=0.2)
    assert job is experiment.jobs[3]
    assert (job.evaluations.lam == 0.2).all()
    assert job.settings["env.speed_mps"] == 0.3
    assert job.best == 5


@pytest.mark.parametrize(("settings", "count"), [({"lam": 0.3}, 0), ({"lam": 0}, 2)])
def test_what_is_not_one_job_is_told(sweep: Path, settings: dict[str, float], count: int) -> None:
    with pytest.raises(NoResults, match=f"^traces has {count} jobs with lam=0.*; it must have"):
        read_experiment(sweep, "traces").job(**settings)


def test_jobs_are_ordered_as_numbers(tmp_path: Path) -> None:
    lams = ",".join(f"{i / 20:g}" for i in range(12))
    write_experiment(
        tmp_path / "s", grid({"lam": lams}, "situations=5"), lambda settings: 3, runs=1
    )
    experiment = read_experiment(tmp_path / "s", "s")
    assert experiment.values("lam") == [i / 20 for i in range(12)]


def test_an_unfinished_sweep_is_passed_over_and_said_by_itself(sweep: Path) -> None:
    root = sweep.parents[1]
    later = sweep.with_name("2026-01-02_03-04-05_2")
    latest = sweep.with_name("2026-01-02_03-04-06")
    for directory, lams in ((later, "0.4"), (latest, "0.5,0.6")):
        jobs = grid({"lam": lams}, "situations=5")
        write_experiment(directory, jobs, lambda settings: 3, runs=1)
    assert newest_experiment(root, "traces").values("lam") == [0.5, 0.6]
    (latest / "1" / "summary.json").unlink()
    assert newest_experiment(root, "traces").values("lam") == [0.4]
    with pytest.raises(NoResults, match="job 1 hasn't finished"):
        read_experiment(latest, "traces")


def test_what_was_never_run_is_told_with_the_command(tmp_path: Path) -> None:
    with pytest.raises(NoResults, match=r"train \+experiment=fig2$"):
        newest_experiment(tmp_path, "fig2")
    (tmp_path / "empty").mkdir()
    with pytest.raises(NoResults, match="has no jobs"):
        read_experiment(tmp_path / "empty", "fig2")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: [", " is not a configuration"),
        ("- a list", " is not a configuration"),
        ("a: !!python/object/apply:os.abort []", " is not a configuration"),
        ("just words", " is not a configuration"),
        ("_target_: os.abort", ": _target_=os.abort: there is no _target_"),
        ("lam: 0.2", ": .*=.*: must be"),
    ],
)
def test_a_damaged_configuration_is_told(sweep: Path, text: str, words: str) -> None:
    path = sweep / "2" / ".hydra" / "config.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=rf"2/\.hydra/config\.yaml{words}"):
        read_experiment(sweep, "traces")


def test_the_measures_by_hand() -> None:
    catches = np.zeros((1, 21), dtype=np.int64)
    catches[0, 1:] = [0, 2, 4, 3, 4, 5, 5, 1, 5, 5, *[3] * 9, 5]
    evaluations = Evaluations(
        seed=np.array([0]),
        lam=np.array([0.2]),
        situations=5 * np.arange(21),
        steps=catches,
        catches=catches,
        diverged=np.zeros(catches.shape, dtype=bool),
        returns=np.zeros(catches.shape),
        lengths=np.zeros(catches.shape),
    )
    found = {name: measure.of(evaluations)[0] for name, measure in MEASURES.items()}
    assert found == {
        "mean_score": pytest.approx((34 + 27 + 5) / 20),
        "final_score": pytest.approx((7 * 3 + 5) / 8),
        "early_score": pytest.approx(3.4),
        "forgetting": pytest.approx((1 + 4 + 9 * 2) / 20),
    }
