"""The files of Weights & Biases' offline runs hold all that is logged."""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
import wandb
from wandb.errors import AuthenticationError, CommError

from fnnq_torchrl.config.checking import flat
from fnnq_torchrl.config.loggers import WandbConfig
from fnnq_torchrl.config.schema import PER_RUN, ConfigError
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.loggers import JobResults, Loggers, SweepResults
from fnnq_torchrl.training.loggers import wandb as wandb_module
from fnnq_torchrl.training.results import EVALUATION_COLUMNS
from tests.commands import fnnq_train
from tests.job_files import keys_read, write_job
from tests.programs import SMALL_WORLD
from tests.training.loggers.wandb_files import WandbRun, read_wandb_runs

KEY = "0" * 40


@pytest.fixture(autouse=True)
def nobody_logged_in(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Give wandb a user who isn't logged in and has no settings."""
    for name in [name for name in os.environ if name.startswith("WANDB")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("NETRC", str(tmp_path / "no.netrc"))


@pytest.fixture(autouse=True, scope="module")
def wandbs_process() -> Iterator[None]:
    """End wandb's process after the last test that uses it."""
    yield
    wandb.teardown()


def logged(job: Job) -> list[WandbRun]:
    with closing(Loggers()) as loggers:
        loggers.log_job(job)
    assert not loggers.left_out
    return read_wandb_runs(job.directory)


def rows_of_csv(job: Job) -> list[dict[str, float]]:
    with open(job.directory / "evaluations.csv", newline="") as file:
        return [
            {key: json.loads(value) for key, value in row.items() if value != "nan"}
            for row in csv.DictReader(file)
        ]


def test_one_wandb_run_for_each_of_22_runs_has_all_rows(tmp_path: Path) -> None:
    directory = tmp_path / "sweep" / "3"
    job = write_job(
        *(directory, "num_seeds=22", "seed=7", "lam=0.4", "logger=wandb", "logger.wandb.per=run"),
        "logger.wandb.tags=[one,two]",
        sweep=directory.parent,
    )
    runs = logged(job)
    # The file with the values numbers the seeds from 0.
    by_seed = {int(run.name.removeprefix("seed=").partition(" ")[0]) - 7: run for run in runs}
    found = [
        {"seed": seed, "lam": run.config["lam"]}
        | {key: row[key] for key in EVALUATION_COLUMNS if key in row}
        for seed, run in sorted(by_seed.items())
        for row in run.history
    ]
    assert len(runs) == 22
    assert found == rows_of_csv(job)
    for seed, run in by_seed.items():
        assert (run.group, run.job_type, run.tags) == ("sweep", "train", ["one", "two"])
        assert run.name == f"seed={seed + 7} lam=0.4"
        assert {key: run.config[key] for key in PER_RUN} == {
            key: getattr(job.config, key) for key in PER_RUN
        } | {"seed": seed + 7, "epsilon_final": job.config.epsilon}
        assert run.config["env"] == JobResults(job).settings["env"]
        assert run.exit_code == 0
        assert [row["_step"] for row in run.history] == [row["situations"] for row in run.history]
    assert sum("learning_curve.path" in run.history[-1] for run in runs) == 1


def test_one_wandb_run_for_a_job_has_curve_band_tables_and_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = write_job(tmp_path / "job", "num_seeds=22", "logger=wandb")
    results = JobResults(job)
    read = keys_read(WandbConfig, monkeypatch)
    [run] = logged(job)
    assert read == WandbConfig.__dataclass_fields__.keys()
    assert (run.group, run.name, run.job_type) == ("job", "job", "train")
    assert flat(run.config).items() >= flat(results.settings | {"value": {}}).items()
    catches = results.evaluations.catches
    mean, low, high = mean_interval(catches)
    for name, column in {"score": mean, "score_low": low, "score_high": high}.items():
        assert [row[name] for row in run.history] == column.tolist()
    assert [row["situations"] for row in run.history] == results.evaluations.situations.tolist()
    assert run.summary["mean_score"] == results.summary["mean_score"]
    assert {"evaluations.csv", "summary.json"} <= run.files

    [folder] = (tmp_path / "job").glob("wandb/offline-run-*/files")
    [picture] = folder.glob("media/images/learning_curve_*.png")
    assert picture.read_bytes() == (tmp_path / "job" / "learning_curve.png").read_bytes()
    copy, original = folder / "evaluations.csv", job.directory / "evaluations.csv"
    assert copy.read_bytes() == original.read_bytes()
    [table] = map(json.loads, (path.read_text() for path in folder.glob("media/table/each*")))
    row = dict(zip(table["columns"], table["data"][21], strict=True))
    assert (row["seed"], row["mean_score"]) == (21, catches[21, 1:].mean())


@pytest.mark.parametrize("per", ["job", "run"])
def test_a_job_has_one_video(per: str, tmp_path: Path) -> None:
    job = write_job(
        tmp_path, "num_seeds=2", "logger=wandb", f"logger.wandb.per={per}", "logger.video=true"
    )
    runs = logged(job)
    [video] = tmp_path.glob("wandb/offline-run-*/files/media/videos/robot_*.gif")
    assert video.read_bytes() == (tmp_path / "robot.gif").read_bytes()
    assert sum(run.history[-1].get("robot._type") == "video-file" for run in runs) == 1


def test_jobs_that_arent_logged_have_no_video(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    job = write_job(
        *(tmp_path / "0", "logger=wandb", "logger.wandb.per=sweep", "logger.video=true"),
        sweep=tmp_path,
    )
    Loggers().prepare([job])
    line = "wandb: no videos, since logger.wandb.per=sweep logs no jobs of a sweep"
    assert line in capfd.readouterr().err.splitlines()


def test_a_sweep_has_a_wandb_run_of_its_own(tmp_path: Path) -> None:
    job = write_job(
        *(tmp_path / "0", "num_seeds=2", "logger=wandb", "logger.wandb.per=sweep"), sweep=tmp_path
    )
    (tmp_path / "learning_curves.png").write_bytes(
        (tmp_path / "0" / "learning_curve.png").read_bytes()
    )
    (tmp_path / "summary.csv").write_text("job,variant,mean_score\n0,peng,2.5\n1,naive,\n")
    assert logged(job) == []
    with closing(Loggers()) as loggers:
        loggers.log_sweep(SweepResults(tmp_path, [job, job]))
    [run] = read_wandb_runs(tmp_path)
    assert (run.group, run.job_type) == (tmp_path.name, "sweep")
    assert run.history[0]["learning_curves._type"] == "image-file"
    assert run.files >= {"summary.csv"}
    [table] = tmp_path.glob("wandb/offline-run-*/files/media/table/jobs*")
    assert json.loads(table.read_text())["data"] == [[0, "peng", 2.5], [1, "naive", None]]


@pytest.mark.parametrize(
    ("override", "variables", "line"),
    [
        (
            "logger.wandb.mode=online",
            {},
            "logger.wandb.mode=online: nobody is logged in; run `wandb login` or set WANDB_API_KEY",
        ),
        (
            "logger.wandb.mode=auto",
            {"WANDB_MODE": "online"},
            "WANDB_MODE=online: nobody is logged in; run `wandb login` or set WANDB_API_KEY",
        ),
        ("logger.wandb.mode=auto", {"WANDB_API_KEY": "short"}, "logger=wandb: WANDB_API_KEY inv"),
    ],
)
def test_what_cant_be_logged_online_is_one_line(
    override: str,
    variables: dict[str, str],
    line: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(ConfigError) as refused:
        Loggers().prepare([write_job(tmp_path / "job", "logger=wandb", override)])
    assert str(refused.value).startswith(line)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("asked", "variables", "mode"),
    [
        ("auto", {}, "offline"),
        ("auto", {"WANDB_API_KEY": KEY}, "online"),
        ("auto", {"WANDB_API_KEY": KEY, "WANDB_MODE": "offline"}, "offline"),
        ("offline", {"WANDB_API_KEY": KEY}, "offline"),
        ("online", {"WANDB_API_KEY": KEY, "WANDB_MODE": "offline"}, "online"),
    ],
)
def test_online_for_who_is_logged_in(
    asked: str, variables: dict[str, str], mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert wandb_module._mode(asked) == mode


USERS = {
    "WANDB_PROJECT": "theirs",
    "WANDB_RUN_GROUP": "their group",
    "WANDB_JOB_TYPE": "their type",
    "WANDB_TAGS": "one,two",
    "WANDB_NAME": "their name",
    "WANDB_RUN_ID": "their1id",
    "WANDB_SWEEP_ID": "their1sweep",
}


@pytest.fixture
def users_variables(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    for name, value in (USERS | {"WANDB_MODE": "offline"}).items():
        monkeypatch.setenv(name, value)
    wandb.teardown()  # ends the process, which has read the environment
    yield
    wandb.teardown()


@pytest.mark.usefixtures("users_variables")
def test_what_the_environment_says_is_heeded(tmp_path: Path) -> None:
    [run] = logged(write_job(tmp_path / "a", "num_seeds=2", "logger=wandb"))
    assert (run.project, run.group, run.job_type) == ("theirs", "their group", "their type")
    assert (run.name, run.id, run.sweep_id) == ("their name", "their1id", "their1sweep")
    assert run.tags == ["one", "two"]


@pytest.mark.usefixtures("users_variables")
def test_the_command_line_takes_precedence_over_the_environment(tmp_path: Path) -> None:
    typed = {"project": "mine", "group": "my group", "job_type": "my type", "tags": "[mine]"}
    overrides = [f"logger.wandb.{key}={value}" for key, value in typed.items()]
    [run] = logged(write_job(tmp_path / "a", "logger=wandb", *overrides))
    found = (run.project, run.group, run.job_type, run.tags)
    assert found == ("mine", "my group", "my type", ["mine"])


@pytest.mark.usefixtures("users_variables")
def test_what_names_one_run_is_not_given_to_many(tmp_path: Path) -> None:
    jobs = [write_job(tmp_path / n, "logger=wandb", sweep=tmp_path) for n in "01"]
    jobs += [write_job(tmp_path / "2", "logger=wandb", "logger.wandb.per=run", "num_seeds=2")]
    runs = [run for job in jobs for run in logged(job)]
    names = [f"{tmp_path.name}/0", f"{tmp_path.name}/1", "seed=0 lam=0.2", "seed=1 lam=0.2"]
    assert sorted(run.name for run in runs) == sorted(names)
    assert len({run.id for run in runs} - {"their1id"}) == 4
    assert {run.sweep_id for run in runs} == {""}
    assert {run.project for run in runs} == {"theirs"}


@pytest.mark.parametrize("how", ["logger.wandb.mode=disabled", "WANDB_MODE"])
def test_disabled_logs_nothing_and_says_nothing(
    how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    if how == "WANDB_MODE":
        monkeypatch.setenv("WANDB_MODE", "disabled")
        wandb.teardown()
    mode = [how] if "=" in how else []
    job = write_job(tmp_path / "0", "num_seeds=2", "logger=wandb", *mode)
    with closing(Loggers()) as loggers:
        loggers.prepare([job])
        loggers.log_job(job)
        loggers.log_sweep(SweepResults(tmp_path, [job]))
    assert not loggers.left_out
    assert read_wandb_runs(job.directory) == []
    assert capfd.readouterr().err == ""


def test_runs_that_jobs_share_are_logged_once(tmp_path: Path) -> None:
    chosen = ("num_seeds=3", "logger=wandb", "logger.wandb.per=run")
    jobs = [write_job(tmp_path / s, f"seed={s}", *chosen, sweep=tmp_path) for s in "01"]
    with closing(Loggers()) as loggers:
        for job in jobs:
            loggers.log_job(job)
    runs = [run.config["seed"] for job in jobs for run in read_wandb_runs(job.directory)]
    assert sorted(runs) == [0, 1, 2, 3]


def test_a_sweep_agent_starts_a_run_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What wandb's agent does: it sets the run's id, and types the values in either form."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("WANDB_MODE", "offline")
    for run_id, values in (("run1", ["alpha=0.1"]), ("run2", ["--alpha=0.2", "--lam=0.3"])):
        monkeypatch.setenv("WANDB_SWEEP_ID", "asweep")
        monkeypatch.setenv("WANDB_RUN_ID", run_id)
        wandb.teardown()
        where = f"hydra.run.dir={run_id}"
        quick = (*SMALL_WORLD, "situations=5", "engine=eager", "num_seeds=2")
        assert fnnq_train("logger=wandb", *values, *quick, where) == 0
        [run] = read_wandb_runs(tmp_path / run_id)
        assert (run.id, run.sweep_id, run.name) == (run_id, "asweep", run_id)
        assert run.config["alpha"] == float(values[0].rpartition("=")[2])
        assert "mean_score" in run.summary
    wandb.teardown()


def test_wandb_offline_is_heeded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """``wandb offline`` writes this setting to a file, and ``wandb online`` removes it."""
    monkeypatch.setenv("WANDB_API_KEY", KEY)
    monkeypatch.setenv("WANDB_CONFIG_DIR", str(tmp_path))
    for mode, line in (("offline", "mode = offline"), ("online", "")):
        (tmp_path / "settings").write_text(f"[default]\n{line}\n")
        wandb.teardown()  # ends the process, which has read the settings
        assert wandb_module._mode("auto") == mode
        assert wandb_module._mode("online") == "online"
    wandb.teardown()


def test_a_login_is_found_in_netrc(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NETRC", str(tmp_path / "netrc"))
    monkeypatch.setenv("WANDB_BASE_URL", "https://wandb.example")
    (tmp_path / "netrc").write_text(f"machine wandb.example login user password {KEY}\n")
    wandb.teardown()  # ends the process, which has read the server's address
    assert wandb_module._mode("auto") == "online"
    wandb.teardown()


def test_the_user_is_told_what_to_expect(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = write_job(tmp_path, "num_seeds=1000", "logger=wandb", "logger.wandb.per=run")
    Loggers().prepare([job])
    assert capfd.readouterr().err.splitlines() == [
        "wandb: nobody is logged in, so it logs offline; `wandb sync` uploads it later",
        "wandb: 1,000 wandb runs, which take about 50 s to log; logger.wandb.per=job makes fewer",
    ]


OFFLINE_NOW = "wandb: logs offline from now on, for `wandb sync` to upload later"


@pytest.mark.parametrize(
    ("error", "reason"),
    [(CommError("timed out"), "timed out"), (AuthenticationError("401\nUnauthorized"), "401")],
    ids=["unreachable", "refused"],
)
def test_a_server_that_is_no_use_is_told_of_and_done_without(
    error: CommError,
    reason: str,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("WANDB_API_KEY", KEY)
    init = wandb.init

    def offline_only(mode: str, **settings: object) -> wandb.Run:
        if mode == "online":
            raise error
        return init(mode=mode, **settings)

    monkeypatch.setattr(wandb, "init", offline_only)
    job = write_job(tmp_path, "num_seeds=3", "logger=wandb", "logger.wandb.per=run")
    assert len(logged(job)) == 3
    assert capfd.readouterr().err == f"{OFFLINE_NOW}: {reason}\n"


def test_a_server_that_is_slow_in_the_end_is_told_of_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("WANDB_API_KEY", KEY)
    init, finish = wandb.init, wandb.Run.finish

    def slow(run: wandb.Run) -> None:
        finish(run)
        raise TimeoutError("Timed out finishing run.")

    monkeypatch.setattr(wandb, "init", lambda mode, **settings: init(mode="offline", **settings))
    monkeypatch.setattr(wandb.Run, "finish", slow)
    job = write_job(tmp_path, "num_seeds=3", "logger=wandb", "logger.wandb.per=run")
    assert len(logged(job)) == 3
    assert capfd.readouterr().err == f"{OFFLINE_NOW}: Timed out finishing run.\n"


def test_the_loss_of_wandbs_process_is_one_line(tmp_path: Path) -> None:
    """Without our handling, wandb would print a traceback at the exit, or end the command."""
    write_job(tmp_path)
    script = f"""
import os, signal, subprocess
from contextlib import closing
from pathlib import Path
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.loggers import Loggers
config = load_config("situations=40", "logger=wandb", "logger.wandb.mode=offline")
with closing(Loggers()) as loggers:
    loggers.log_job(Job(config, Path({str(tmp_path)!r})))
    for child in map(int, subprocess.check_output(["pgrep", "-P", str(os.getpid())]).split()):
        if b"wandb" in Path(f"/proc/{{child}}/cmdline").read_bytes():
            os.kill(child, signal.SIGKILL)
"""
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    [line] = ended.stderr.splitlines()
    assert line.startswith("going on without wandb, which has failed: ")


def test_a_disk_that_is_full_for_wandb_leaves_the_results(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(*arguments: object, **settings: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(wandb.Run, "log", full)
    job = write_job(tmp_path, "num_seeds=2", "logger=wandb", "logger.wandb.mode=offline")
    with closing(Loggers()) as loggers:
        loggers.log_job(job)
        loggers.log_job(job)
    assert loggers.left_out == {"wandb"}
    [line] = capfd.readouterr().err.splitlines()
    assert line.endswith("which has failed: [Errno 28] No space left on device")


def test_nothing_is_asked_though_there_is_nobody_to_answer(tmp_path: Path) -> None:
    """The command runs as from cron: without standard input, terminal and login."""
    write_job(tmp_path)
    script = f"""
from contextlib import closing
from pathlib import Path
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.loggers import Loggers
job = Job(load_config("situations=40", "logger=wandb"), Path({str(tmp_path)!r}))
with closing(Loggers()) as loggers:
    loggers.prepare([job])
    loggers.log_job(job)
"""
    ended = subprocess.run(
        ["sh", "-c", 'exec "$0" -c "$1" <&-', sys.executable, script],
        env=os.environ | {"HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    told = "wandb: nobody is logged in, so it logs offline; `wandb sync` uploads it later\n"
    assert (ended.stdout, ended.stderr) == ("", told)
    [run] = read_wandb_runs(tmp_path)
    assert len(run.history) == 9
