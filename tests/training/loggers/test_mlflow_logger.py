"""MLflow's client reads back all that is logged."""

import warnings
from pathlib import Path

import pytest

from fnnq_torchrl.config.loggers import MlflowConfig
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.loggers import JobResults, Loggers, SweepResults
from tests.job_files import keys_read, write_job


def test_jobs_and_their_sweep_are_in_one_database(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.chdir(tmp_path)
    chosen = ("logger=mlflow", "logger.mlflow.experiment=ball")
    sweep = tmp_path / "sweep"
    many = write_job(sweep / "0", "num_seeds=22", "logger.video=true", *chosen, sweep=sweep)
    one = write_job(sweep / "1", "lam=0.4", *chosen, sweep=sweep)
    (sweep / "summary.csv").write_text("job,mean_score\n")
    read = keys_read(MlflowConfig, monkeypatch)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # MLflow still uses what SQLAlchemy has deprecated
        loggers = Loggers()
        for job in (many, one):
            loggers.log_job(job)
        loggers.log_sweep(SweepResults(sweep, [many, one]))
        assert not loggers.left_out
        assert read == MlflowConfig.__dataclass_fields__.keys()
        from mlflow.tracking import MlflowClient

        client = MlflowClient(f"sqlite:///{sweep / 'mlflow.db'}")
        experiment = client.get_experiment_by_name("ball").experiment_id
        runs = {run.info.run_name: run for run in client.search_runs([experiment])}

        def history(run: str, name: str) -> list[tuple[int, float]]:
            metrics = client.get_metric_history(runs[run].info.run_id, name)
            return sorted((metric.step, metric.value) for metric in metrics)

        assert set(runs) == {"sweep/0", "sweep/1", "sweep: 2 jobs"}
        evaluations = JobResults(many).evaluations
        situations = evaluations.situations.tolist()
        names = ("score", "score_low", "score_high")
        for name, column in zip(names, mean_interval(evaluations.catches), strict=True):
            assert history("sweep/0", name) == list(zip(situations, column.tolist(), strict=True))
        assert history("sweep/1", "score_low") == []

    run = runs["sweep/1"]
    assert (run.info.status, run.data.tags["group"]) == ("FINISHED", "sweep")
    assert (run.data.params["lam"], run.data.params["env.speed_mps"]) == ("0.4", "0.3")
    assert run.data.metrics["final_score"] == JobResults(one).summary["final_score"]
    files = {path.name for path in (sweep / "mlartifacts").rglob("*") if path.is_file()}
    assert files == {
        *("learning_curve.png", "evaluations.csv", "summary.json", "summary.csv", "robot.gif")
    }
    assert [path.name for path in tmp_path.iterdir()] == ["sweep"]


def test_what_the_environment_says_is_heeded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that is named in it is that of a job alone, and not of many."""
    monkeypatch.chdir(tmp_path)
    uri = f"sqlite:///{tmp_path / 'own.db'}"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", uri)
    monkeypatch.setenv("MLFLOW_EXPERIMENT_NAME", "theirs")
    from mlflow.tracking import MlflowClient

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        client = MlflowClient(uri)
        made = client.create_experiment("made")
        run = client.create_run(made).info.run_id
        monkeypatch.setenv("MLFLOW_RUN_ID", run)
        alone = write_job(tmp_path / "alone", "logger=mlflow")
        jobs = [write_job(tmp_path / n, "logger=mlflow", sweep=tmp_path) for n in "01"]
        typed = write_job(tmp_path / "2", "logger=mlflow", "logger.mlflow.experiment=typed")
        loggers = Loggers()
        for job in (*jobs, alone, typed):
            loggers.log_job(job)
        assert not loggers.left_out
        assert "final_score" in client.get_run(run).data.metrics
        counts = {
            each.name: len(client.search_runs([each.experiment_id]))
            for each in client.search_experiments()
        }
    assert counts == {"Default": 0, "made": 1, "theirs": 2, "typed": 1}


def test_a_server_that_is_gone_is_told_of_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "0")
    nobody = "logger.mlflow.tracking_uri=http://127.0.0.1:9"
    job = write_job(tmp_path, "num_seeds=2", "logger=mlflow", nobody)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        loggers = Loggers()
        loggers.log_job(job)
        loggers.log_job(job)
    assert loggers.left_out == {"mlflow"}
    [line] = capfd.readouterr().err.splitlines()
    assert line.startswith("going on without mlflow, which has failed: API request to http://127")
