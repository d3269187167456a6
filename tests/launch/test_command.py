"""The command line, from ``sys.argv`` to the job and back to the exit status."""

import io
import os
import shlex
import signal
import subprocess
import sys
import types
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

from fnnq_torchrl import train
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.launch.command import command
from fnnq_torchrl.launch.directories import fresh_directory
from fnnq_torchrl.launch.train import train_batches
from fnnq_torchrl.training.resume.interruptions import Interrupted, Interruptions

ROOT = Path(train.__file__).parents[1]
UNIT = "must be a number in [0, 1]"
MISTAKES = {
    "lam=1.5": f"lam=1.5: {UNIT}",
    "lam=abc": f"lam=abc: {UNIT}",
    "lamm=0.2": "lamm=0.2: there is no lamm; did you mean lam?",
    "+lamm=0.2": "lamm=0.2: there is no lamm; did you mean lam?",
    "trace=foo": (
        "trace=foo: must be output, gradient, replacing, window, clearing, dutch or your own "
        "module:Class"
    ),
    "value=nope": (
        "value=nope: must be fnnq or fnnq_sum or fuzzy_q or mlp or rbf or table or tiles or "
        "tiles_sum"
    ),
    "env.sped_mps=1": "env.sped_mps=1: there is no env.sped_mps; did you mean env.speed_mps?",
    "+env.sped_mps=1": "env.sped_mps=1: there is no env.sped_mps; did you mean env.speed_mps?",
    "hydra.nope=1": "Could not override 'hydra.nope'. To append to your config use +hydra.nope=1",
}
QUIET = ("hydra/job_logging=none", "hydra/hydra_logging=none")  # leaves pytest's logging as it is
# Commands with frequent mistakes, such as a split parenthesis, and the message of each.
UNFRIENDLY = {
    ("lam=0.2,0.3",): "lam=0.2,0.3: several values need -m, a job for each",
    ("seed=range(22)",): "seed=range(22): several values need -m, a job for each",
    ("seed=range(0,", "22)", "-m"): "seed=range(0,: parentheses need quotes; "
    "type 'seed=range(0, 22)'",
    ("seed=range(22", "-m"): "seed=range(22: its parenthesis isn't closed; "
    "type it in quotes, as in 'seed=range(22)'",
    ("hydra.launcher.clustr=local", "-m"): "Could not override 'hydra.launcher.clustr'. "
    "To append to your config use +hydra.launcher.clustr=local; "
    "did you mean hydra.launcher.cluster?",
    ("hydra.launcher.cluster=slum", "-m"): "hydra.launcher.cluster=slum: "
    "must be none, local or slurm",
}


class Outcome(NamedTuple):
    status: int
    stderr: str
    jobs: list[tuple[Config, Path]]


@pytest.fixture
def run(tmp_path, monkeypatch, capsys) -> Callable[..., Outcome]:
    """Return a function that runs the train command here, with a job that records its arguments."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str, job: Callable[[Config, Path], None] | None = None) -> Outcome:
        jobs: list[tuple[Config, Path]] = []
        stub = types.ModuleType("fnnq_torchrl.training.job")
        stub.run_job = job or (lambda config, directory: jobs.append((config, directory)))
        stub.run_batches = lambda batches, **others: (
            [stub.run_job(each.config, each.directory) for each in batch] for batch in batches
        )
        monkeypatch.setitem(sys.modules, stub.__name__, stub)
        monkeypatch.setattr(sys, "argv", ["train", *QUIET, *arguments])
        status = 0
        try:
            train.main()
        except SystemExit as end:
            status = end.code
        return Outcome(status, capsys.readouterr().err, jobs)

    return run


def test_one_job(run, tmp_path):
    status, stderr, [(config, directory)] = run("lam=0.3", "seed=3")
    assert (status, stderr) == (0, "")
    assert (config.lam, config.seed) == (0.3, 3)
    assert directory.parent == tmp_path / "outputs"
    assert (directory / ".hydra" / "overrides.yaml").read_text() == "- lam=0.3\n- seed=3\n"
    assert Path.cwd() == tmp_path


def test_a_sweep_has_a_directory_for_each_job(run, tmp_path):
    status, stderr, jobs = run("seed=range(3)", "-m")
    assert (status, stderr) == (0, "")
    assert [config.seed for config, _ in jobs] == [0, 1, 2]
    [sweep] = (tmp_path / "outputs" / "sweeps").iterdir()
    assert [directory for _, directory in jobs] == [sweep / str(number) for number in range(3)]


@pytest.mark.parametrize("flag", ["-m", "--multirun"])
def test_the_flag_of_a_sweep_may_stand_anywhere(run, flag):
    status, _, jobs = run("--lam=0.2,0.3", flag, "seed=1")
    assert (status, [config.lam for config, _ in jobs]) == (0, [0.2, 0.3])


def test_the_configuration_is_shown_and_no_directory_is_made(run, monkeypatch):
    out = io.StringIO()
    monkeypatch.setattr(sys, "stdout", out)
    assert run("lam=0.3", "--cfg", "job", "seed=1") == (0, "", [])
    shown = yaml.safe_load(out.getvalue())
    assert (shown["lam"], shown["seed"]) == (0.3, 1)
    assert not list(Path.cwd().iterdir())


@pytest.mark.parametrize(
    ("flag", "told"), [("--help", "fnnq-train [key=value"), ("--version", "fnnq_torchrl 0.1")]
)
def test_what_the_program_says_of_itself(monkeypatch, capsys, flag, told):
    monkeypatch.setattr(sys, "argv", ["train", "lam=0.2", flag])
    train.main()
    assert capsys.readouterr().out.startswith(told)


def test_the_package_is_the_same_command():
    assert import_module("fnnq_torchrl.__main__").main is train.main


def test_ctrl_c_during_the_imports_is_one_line(monkeypatch, capsys):
    class Interrupting(types.ModuleType):
        def __getattr__(self, name):
            raise KeyboardInterrupt

    monkeypatch.setitem(sys.modules, "fnnq_torchrl.launch.train", Interrupting("train"))
    with pytest.raises(SystemExit) as ended:
        train.main()
    assert (ended.value.code, capsys.readouterr().err) == (130, "interrupted\n")


@pytest.mark.parametrize(
    ("program", "remedy"),
    [
        ("somewhere/train.py", "type fnnq-train instead, which looks for packages elsewhere"),
        ("bin/fnnq-train", "take its directory off PYTHONPATH"),
    ],
)
def test_another_package_envs_in_front_is_one_line(monkeypatch, capsys, tmp_path, program, remedy):
    (tmp_path / "envs").mkdir()
    (tmp_path / "envs" / "__init__.py").write_text("")
    monkeypatch.setattr(sys, "argv", [program])
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "envs")
    with pytest.raises(SystemExit) as ended:
        train.main()
    line = f"{tmp_path}/envs/__init__.py hides the package envs of fnnq_torchrl; {remedy}\n"
    assert (ended.value.code, capsys.readouterr().err) == (2, line)


def test_an_interrupted_job_says_how_to_go_on(run):
    def job(config, directory):
        raise Interrupted(signal.SIGTERM)

    status, line, _ = run("lam=0.3", job=job)
    assert (status, line.count("\n")) == (143, 1)
    assert line.startswith("SIGTERM: the work so far is saved; to go on: ")
    again = shlex.split(line.partition("; to go on: train ")[2])
    [(_, directory)] = run(*again).jobs
    assert [path.name for path in Path("outputs").iterdir()] == [directory.name]


def test_an_interrupted_sweep_says_how_to_go_on(run):
    def job(config, directory):
        raise Interrupted(signal.SIGINT)

    status, line, _ = run("lam=0.3,0.4", "-m", job=job)
    assert (status, line.count("\n")) == (130, 1)
    again = shlex.split(line.partition("; to go on: train ")[2])
    assert again[2:-1] == ["lam=0.3,0.4", "-m"]
    assert [directory.parent for _, directory in run(*again).jobs] == [
        *(Path.cwd() / "outputs" / "sweeps").iterdir()
    ] * 2


def assert_refused(outcome: Outcome, mistake: str) -> None:
    assert outcome == (2, MISTAKES[mistake] + "\n", [])
    assert not list(Path.cwd().iterdir())


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(run, mistake):
    assert_refused(run(mistake), mistake)


@pytest.mark.parametrize("mistake", ["lam=1.5", "lam=abc", "lamm=0.2", "+lamm=0.2", "value=nope"])
def test_a_mistake_is_one_line_with_m(run, mistake):
    assert_refused(run(mistake, "-m"), mistake)


@pytest.mark.parametrize("arguments", UNFRIENDLY, ids=" ".join)
def test_what_to_type_is_one_line(run, arguments):
    assert run(*arguments) == (2, UNFRIENDLY[arguments] + "\n", [])
    assert not list(Path.cwd().iterdir())


def test_a_bad_job_of_a_sweep_is_named_and_nothing_runs(run):
    status, stderr, jobs = run("lam=0.1,1.5,0.2", "seed=1", "-m")
    assert (status, stderr) == (2, f"job 1 (lam=1.5 seed=1): lam=1.5: {UNIT}\n")
    assert not jobs


@pytest.mark.parametrize("flags", [[], ["-m"]], ids=["run", "multirun"])
def test_a_jobs_own_refusal_is_one_line(run, flags):
    def job(config, directory):
        raise ConfigError("device=cuda: no GPU here,\nbut cpu works")

    assert run(*flags, job=job) == (2, "device=cuda: no GPU here, but cpu works\n", [])
    assert not list(Path.cwd().iterdir())


def test_a_refusal_leaves_what_was_there(run: Callable[..., Outcome]) -> None:
    def job(config: Config, directory: Path) -> None:
        raise ConfigError("num_seeds=1: more are saved")

    assert run("hydra.run.dir=job", "num_seeds=9").status == 0
    before = {path: path.read_bytes() for path in Path("job").rglob("*.yaml")}
    assert run("hydra.run.dir=job", "num_seeds=1", job=job).status == 2
    assert {path: path.read_bytes() for path in Path("job").rglob("*.yaml")} == before


def test_ctrl_c_is_one_line(run):
    def job(config, directory):
        raise KeyboardInterrupt

    place = "hydra.run.dir='outputs/λ = 0.3'"
    status, line, _ = run("seed=3", "--lam=0.3", "--resume=never", place, job=job)
    assert (status, line.partition(" train ")[0]) == (130, "interrupted; to go on:")
    again = shlex.split(line.partition(" train ")[2])
    assert again == [*QUIET, "seed=3", "--lam=0.3", place]
    [(config, directory)] = run(*again).jobs
    assert (config.lam, directory.name) == (0.3, "λ = 0.3")


def test_a_file_that_cant_be_written_is_one_line(run):
    def job(config, directory):
        (directory / "nowhere" / "summary.json").write_text("")

    status, stderr, _ = run(job=job)
    assert (status, stderr.count("\n")) == (1, 1)
    assert stderr.endswith("summary.json: No such file or directory\n")


def test_a_bug_keeps_its_traceback(run):
    def job(config, directory):
        raise ZeroDivisionError("a bug")

    with pytest.raises(ZeroDivisionError, match="a bug"):
        run(job=job)


def test_who_asks_hydra_for_tracebacks_gets_them(run, monkeypatch):
    monkeypatch.setenv("HYDRA_FULL_ERROR", "1")
    with pytest.raises(Exception, match="Error merging override lam=abc"):
        run("lam=abc")


def test_the_environment_is_left_as_it_was(run):
    before = dict(os.environ)
    run("lam=abc")
    assert dict(os.environ) == before


def test_no_two_starts_share_a_directory(run, tmp_path):
    with ThreadPoolExecutor(16) as pool:
        made = list(pool.map(fresh_directory, [str(tmp_path / "outputs" / "now")] * 64))
    names = {Path(path).name for path in made}
    assert names == {"now"} | {f"now_{number}" for number in range(2, 65)}
    assert run().jobs[0][1] != run().jobs[0][1]


def test_the_console_script_completes_keys():
    arguments = [Path(sys.executable).with_name("fnnq-train"), "-sc", "query=bash"]
    line = "fnnq-train env.circle"
    asked = {"COMP_LINE": line, "COMP_POINT": str(len(line))}
    ended = subprocess.run(arguments, env=os.environ | asked, capture_output=True, text=True)
    assert ended.stdout.strip() == "env.circle_radius_m="


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["lam=1.5"], f"lam=1.5: {UNIT}"),
        (
            ["rules.prior=rogh.txt"],
            "rules.prior=rogh.txt: there is no such file; "
            "shipped files: hopeful.txt, operator.csv, rough.txt, wrong.txt",
        ),
        (["lam=0.1,1.5", "-m"], f"job 1 (lam=1.5): lam=1.5: {UNIT}"),
        (["--help"], ""),
        (["--cfg", "job"], ""),
    ],
    ids=["run", "file", "multirun", "help", "cfg"],
)
def test_the_check_comes_before_torch(tmp_path, arguments, told):
    command = [sys.executable, "-X", "importtime", "-m", "fnnq_torchrl.train", *arguments]
    ended = subprocess.run(
        command, cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True
    )
    lines = ended.stderr.decode().splitlines()
    imports = [line for line in lines if line.startswith("import time:")]
    assert "\n".join(line for line in lines if line not in imports) == told
    assert (ended.returncode, bool(ended.stdout)) == (2 if told else 0, not told)
    assert not {"torch", "scipy"} & {entry.split("|")[-1].strip() for entry in imports}


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="needs Unix")
@pytest.mark.usefixtures("usual_signals")
def test_a_signal_to_save_ends_no_command_that_has_nothing_to_save(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    answers = []

    def job(config: Config, directory: Path) -> None:
        os.kill(os.getpid(), signal.SIGUSR1)
        with Interruptions(1e9) as interruptions:
            os.kill(os.getpid(), signal.SIGUSR1)
            answers.append(interruptions.due())
        os.kill(os.getpid(), signal.SIGUSR2)

    monkeypatch.setattr(sys, "argv", ["train", f"hydra.run.dir={tmp_path}"])
    try:
        command(job, train_batches)()
    finally:
        for number in (signal.SIGUSR1, signal.SIGUSR2):
            signal.signal(number, signal.SIG_DFL)
    assert answers == [True]
