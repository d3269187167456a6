"""Every command refuses every class of bad input in one line, and leaves no result."""

import sys
from collections.abc import Callable
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from envs.core.parameters import allowed
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.files.plain import write_plain
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.launch.launcher import Multirun
from fnnq_torchrl.studies.adaptive.command import main as adaptive
from fnnq_torchrl.studies.extrapolation.command import main as extrapolation
from fnnq_torchrl.studies.figures.command import main as figures
from fnnq_torchrl.studies.prior.command import main as prior
from fnnq_torchrl.studies.reproduction.command import main as reproduction
from fnnq_torchrl.training import job as job_module
from fnnq_torchrl.training.jobs import RESULTS
from fnnq_torchrl.training.resume.saved import FORMAT
from tests.commands import fnnq_train
from tests.programs import SMALL_WORLD

PAGES = {
    "figures": figures,
    "reproduction": reproduction,
    "adaptive": adaptive,
    "extrapolation": extrapolation,
    "prior": prior,
}
QUIET = ("hydra/job_logging=none", "hydra/hydra_logging=none")
HEADER = "seed,lam,situations,steps,catches,diverged,return,length\n"
DAMAGE = {
    "torn": HEADER + "0,0.2,0,0,1,0,0,9\n0,0.2,5,310",
    "nan": HEADER + "0,0.2,0,0,nan,0,0,9\n0,0.2,5,310,1,0,0,9\n",
    "huge": HEADER + f"0,0.2,0,0,1,0,0,9\n0,0.2,5,{10**30},1,0,0,9\n",
}
"""Damaged texts of evaluations.csv, by the names of the directories that have them."""


@cache
def settings_of_a_job() -> str:
    return OmegaConf.to_yaml(OmegaConf.create(asdict(load_config("lam=0.9"))))


def finished_job(job: Path, evaluations: str) -> None:
    (job / ".hydra").mkdir(parents=True)
    (job / ".hydra" / "config.yaml").write_text(settings_of_a_job())
    (job / "evaluations.csv").write_text(evaluations)
    (job / "summary.json").write_text("{}")


@pytest.fixture(scope="module")
def around(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a working directory with damaged and foreign files."""
    root = tmp_path_factory.mktemp("around")
    (root / "file").write_text("")
    for job in (root / "another", root / "another" / "0"):
        job.mkdir()
        write_plain(job / "training.pt", FORMAT, {"identity": "another's", "ledger": {}})
    finished_job(root / "finished" / "0", DAMAGE["nan"])
    for job in (root / "damaged", root / "damaged" / "0"):
        job.mkdir()
        (job / "training.pt").write_bytes(b"damage")
        (root / "folder" / job.relative_to(root / "damaged") / "training.pt").mkdir(parents=True)
    for name, evaluations in DAMAGE.items():
        for experiment in ("fig2_large", "fig2", "adaptive", "value_functions"):
            finished_job(root / name / experiment / "2026-01-02_03-04-05" / "0", evaluations)
    return root


class Ended(NamedTuple):
    status: int
    line: str


@pytest.fixture
def run(
    around: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Ended]:
    monkeypatch.chdir(around)

    def run(command: str, *arguments: str) -> Ended:
        if command == "train":
            status: object = fnnq_train(*QUIET, *arguments)
        elif command == "train -m":
            status = fnnq_train(*QUIET, *arguments, "-m")
        else:
            monkeypatch.setattr(sys, "argv", [command, *arguments])
            with pytest.raises(SystemExit) as end:
                PAGES[command]()
            status = end.value.code
        told = capsys.readouterr().err
        if isinstance(status, str):  # Python prints such a status as it exits
            status, told = 1, told + status + "\n"
        assert told.endswith("\n")
        assert told.count("\n") == 1, told
        assert isinstance(status, int)
        return Ended(status, told.removesuffix("\n").replace(str(around), "…"))

    return run


NO_PAIRS = "must be a list of at least one pair [centre, width] with width > 0, or {triangle…"
NO_RESULTS = "has no finished results: python -m fnnq_torchrl.train +experiment="
TORN = "evaluations.csv is not a complete evaluations file: its last row is cut short"
NO_NUMBER = "evaluations.csv is not a complete evaluations file: could not convert string "
OTHERS = (
    "was saved with another configuration, engine or version of PyTorch; "
    "take another directory, or start over with "
)
# The exit status and the line expected of each command. An ellipsis stands for the rest of a line.
# Commands that write figures and pages have no configuration keys, so none can be out of range.
TABLE: dict[str, dict[str, tuple[int, str]]] = {
    "wrong type": {
        "train logger=mlflow logger.mlflow.timeout_s=x": (
            2,
            "logger.mlflow.timeout_s=x: must be a number in (0, inf)",
        ),
        "train lam=abc": (2, "lam=abc: must be a number in [0, 1]"),
        "train num_seeds=1.5": (2, "num_seeds=1.5: must be a whole number >= 1"),
        "train env=null": (
            2,
            "env=null: must be acrobot or cart_pole or cart_pole_gymnasium or chain or "
            "follow_ball or follow_obstacles or follow_one_side or gymnasium or mountain_car or "
            "mountain_car_gymnasium or own or random_walk or ring or torchrl or "
            "two_states or wander",
        ),
        "train checkpoint=5": (2, "checkpoint=5: must be a mapping of every_s, snapshots"),
        "train -m lam=0.1,abc": (2, "job 1 (lam=abc): lam=abc: must be a number in [0, 1]"),
        "train -m hydra.sweeper.cases=5": (
            2,
            "hydra.sweeper.cases=5: must be a list of grids {key: values}",
        ),
        "figures fig9": (2, "there is no figure fig9; there is fig2, fig3, …"),
        "figures --nope": (2, "unrecognized arguments: --nope"),
        "reproduction extra": (2, "unrecognized arguments: extra"),
        "adaptive --nope": (2, "unrecognized arguments: --nope"),
        "extrapolation extra": (2, "unrecognized arguments: extra"),
    },
    "out of range": {
        "train env.start_angle_rad=4": (
            2,
            "env.start_angle_rad=4.0: must be a number in [0, 3.14159]",
        ),
        "train machine.device=cuda:99": (
            2,
            "machine.device=cuda:99: must be a device of this machine, which has …",
        ),
        "train -m lam=0.1,1.5": (2, "job 1 (lam=1.5): lam=1.5: must be a number in [0, 1]"),
        "train -m seed=range(0)": (2, "seed=range(0): must have at least one value to sweep"),
    },
    "NaN": {
        "train lam=nan": (2, "lam=nan: must be a number in [0, 1]"),
        "train value.action=[[nan,1]]": (2, f"value.action=[[nan, 1]]: {NO_PAIRS}"),
        "train -m lam=nan,0.1": (2, "job 0 (lam=nan): lam=nan: must be a number in [0, 1]"),
        "figures fig2 --results nan": (2, f"nan/fig2/2026-01-02_03-04-05/0/{NO_NUMBER}'nan' …"),
        "reproduction --results nan": (
            2,
            f"nan/fig2_large/2026-01-02_03-04-05/0/{NO_NUMBER}'nan' …",
        ),
        "adaptive --results nan": (2, f"nan/adaptive/2026-01-02_03-04-05/0/{NO_NUMBER}'nan' …"),
        "extrapolation --results nan": (
            2,
            f"nan/value_functions/2026-01-02_03-04-05/0/{NO_NUMBER}'nan' …",
        ),
    },
    "missing directory": {
        "train from=nowhere": (2, "from=nowhere: there is no such directory"),
        "train --config-dir nowhere": (2, "--config-dir nowhere: there is no such directory"),
        "train hydra.run.dir=file/job": (1, "file/job: Not a directory"),
        "train -m hydra.sweep.dir=file/sweep": (1, "file/sweep: Not a directory"),
        "figures fig2 --results nowhere": (2, f"nowhere/fig2 {NO_RESULTS}fig2"),
        "reproduction --results nowhere": (2, f"nowhere/fig2_large {NO_RESULTS}fig2_large"),
        "prior --results nowhere": (2, f"nowhere/prior {NO_RESULTS}prior"),
        "adaptive --results nowhere": (2, f"nowhere/adaptive {NO_RESULTS}adaptive"),
        "extrapolation --results nowhere": (
            2,
            f"nowhere/value_functions {NO_RESULTS}value_functions",
        ),
    },
    "foreign directory": {
        "train hydra.run.dir=another": (2, f"…/another/training.pt {OTHERS}resume=never"),
        "train -m hydra.sweep.dir=another": (2, f"…/another/0/training.pt {OTHERS}resume=never"),
        "train -m lam=0.2 hydra.sweep.dir=finished": (
            2,
            "job 0 (lam=0.2): …/finished/0 holds a job with lam=0.9, not lam=0.2; "
            "name another directory in hydra.sweep.dir",
        ),
        "figures fig2 --results another": (2, f"another/fig2 {NO_RESULTS}fig2"),
        "reproduction --results another": (2, f"another/fig2_large {NO_RESULTS}fig2_large"),
        "adaptive --results another": (2, f"another/adaptive {NO_RESULTS}adaptive"),
        "extrapolation --results another": (
            2,
            f"another/value_functions {NO_RESULTS}value_functions",
        ),
        "train from=finished": (
            2,
            "from=finished: has no .hydra/config.yaml; name the directory of one job",
        ),
        "train -m from=torn lam=0,1": (
            2,
            "from=torn: has no .hydra/config.yaml; name the directory of one job",
        ),
        "train from=file": (2, "from=file: there is no such directory"),
        "train from=finished/0 --config-name other": (
            2,
            "--config-name and from= exclude each other",
        ),
        "train from=finished/0 from=another": (2, "from=finished/0 from=another: name one job"),
        "train --experimental-rerun job.pickle": (
            2,
            "--experimental-rerun is refused: it reads a pickle, which can run any code; …",
        ),
    },
    "unreadable file": {
        r"train hydra.run.dir=\${lam}": (
            2,
            "hydra.run.dir=${lam}: must be a path without ${, which Hydra would resolve",
        ),
        "train hydra.run.dir=file": (1, "file: File exists"),
        "train hydra.run.dir=folder": (1, "…/folder/training.pt: Is a directory"),
        "train hydra.run.dir=damaged": (
            2,
            "…/damaged/training.pt is damaged, or not a saved training; resume=never starts over",
        ),
        "train -m hydra.sweep.dir=folder": (1, "…/folder/0/training.pt: Is a directory"),
        "train -m hydra.sweep.dir=damaged": (2, "…/damaged/0/training.pt is damaged, or …"),
        "figures fig2 --results torn": (2, f"torn/fig2/2026-01-02_03-04-05/0/{TORN}"),
        "reproduction --short --results torn": (2, f"torn/fig2/2026-01-02_03-04-05/0/{TORN}"),
        "adaptive --results torn": (2, f"torn/adaptive/2026-01-02_03-04-05/0/{TORN}"),
        "extrapolation --results torn": (
            2,
            f"torn/value_functions/2026-01-02_03-04-05/0/{TORN}",
        ),
    },
    "huge value": {
        "train num_seeds=1000000000000": (2, "1,000,000,000,000 runs with 41 evaluations …"),
        "train situations=1000000000000000": (
            2,
            "1 run with 200,000,000,000,001 evaluations of 20 weights each …",
        ),
        "train action.candidates=1000000000": (
            2,
            "1 run with 41 evaluations of 20 weights each and 1,000,000,000 candidate actions …",
        ),
        "train trace=window window=1000000000": (2, "1 run with 41 evaluations of 20 weights …"),
        "train seed=9223372036854775808": (
            2,
            "seed=9223372036854775808: must be at most 2**63 - 1 = 9223372036854775807",
        ),
        "train alpha=1e400": (2, "alpha=inf: must be a number in [0, inf)"),
        "train -m num_seeds=1000000000000,1": (2, "1,000,000,000,000 runs with 41 evaluations …"),
        "figures fig2 --results huge": (2, f"huge/fig2/2026-01-02_03-04-05/0/{NO_NUMBER}'100…"),
        "reproduction --results huge": (
            2,
            f"huge/fig2_large/2026-01-02_03-04-05/0/{NO_NUMBER}'100…",
        ),
        "adaptive --results huge": (2, f"huge/adaptive/2026-01-02_03-04-05/0/{NO_NUMBER}'100…"),
        "extrapolation --results huge": (
            2,
            f"huge/value_functions/2026-01-02_03-04-05/0/{NO_NUMBER}'100…",
        ),
    },
    "contradictory keys": {
        "train situations=7": (2, "situations=7: must be a whole multiple of evaluation.every=5"),
        "train env.ball_speed_min_radps=0.2": (
            2,
            "env.ball_speed_min_radps=0.2: must be at most ball_speed_max_radps=0.15",
        ),
        f"train seed={2**63 - 1} num_seeds=2": (
            2,
            f"seed={2**63 - 1}: must be at most {2**63 - 2}, so that the last seed fits in 63 bits",
        ),
        "train -m seed=0,1 hydra.sweep.subdir=same": (2, "job 1 (seed=1): …"),
        "train --resolve": (2, "--resolve needs --cfg, whose values it resolves"),
    },
}


@pytest.mark.parametrize(
    ("typed", "ended"),
    [
        pytest.param(typed, ended, id=f"{kind}: {typed}")
        for kind, cells in TABLE.items()
        for typed, ended in cells.items()
    ],
)
def test_bad_input(run: Callable[..., Ended], typed: str, ended: tuple[int, str]) -> None:
    command, *arguments = typed.split()
    if arguments[0] == "-m":
        command, arguments = "train -m", arguments[1:]
    before = results()
    status, line = run(command, *arguments)
    expected = ended[1]
    if expected.endswith("…"):
        line = line[: len(expected) - 1] + "…"
    assert (status, line) == (ended[0], expected)
    assert results() == before


def results() -> set[Path]:
    """Return every file below the working directory that has the name of a result."""
    names = ("checkpoint.pt", "evaluations.csv", "summary.*", "*.png", "*.svg", "*.md")
    return {path for name in names for path in Path().rglob(name)}


KEYS = [*allowed(Config), "env", "value", "value.inputs.bearing", "hydra", "hydra.run.dir", "nope"]
KEYS += ["hydra.launcher.cluster", "hydra.sweeper.params", "hydra/launcher", "+experiment", ""]
VALUES = ["nan", "inf", "-1", "0", "1e400", f"{10**30}", "", "null", "[]", "{}", "true", "a b", "λ"]
VALUES += ["x" * 5000, "${lam}", "${nowhere}", "${oc.env:NOWHERE}", "${", "'", '"', "[1", "{a:1}"]
VALUES += [
    "???",
    "1,2",
    "range(0)",
    "range(3)",
    "[[0,1]]",
    "[[0,0]]",
    "\\",
    "%",
    "{_target_:os.abc}",
]
overrides = st.builds(
    "{}{}{}{}".format,
    st.sampled_from(["", "", "", "+", "++", "~"]),
    st.sampled_from(KEYS),
    st.sampled_from(["=", "=", "=", "", "==", ":"]),
    st.sampled_from(VALUES) | st.text(max_size=8) | st.floats().map(str),
)


lists_of_overrides = st.lists(
    overrides.filter(lambda text: not text.startswith("-")), min_size=1, max_size=3
)
# A fifth of the examples of the other tests, since each example takes a tenth of a second.
few = settings(
    max_examples=settings().max_examples // 5,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@given(lists_of_overrides, st.booleans())
@few
def test_no_overrides_at_all_bring_a_traceback(
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    sweep: bool,
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("fuzz"))
    monkeypatch.setattr(job_module, "run_job", lambda config, directory: 1.0)
    monkeypatch.setattr(
        job_module,
        "run_batches",
        lambda batches, **others: ([1.0] * len(b) for b in batches),
    )
    monkeypatch.setattr(Multirun, "_write_whole", lambda self, first: None)
    status = fnnq_train(*QUIET, *arguments, *["-m"] * sweep)
    told = capsys.readouterr().err
    assert status in (0, 1, 2)
    assert told.count("\n") == (status != 0), told
    assert "Traceback" not in told
    assert not results()


TINY = (*SMALL_WORLD, "situations=5", "num_seeds=2", "engine=eager", "hydra.run.dir=job")


@given(lists_of_overrides)
@few
def test_overrides_leave_all_of_a_result_or_nothing(
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("fuzz"))
    status = fnnq_train(*QUIET, *arguments, *TINY)
    assert status in (0, 1, 2)
    assert "Traceback" not in capsys.readouterr().err
    found = {path.name for path in Path("job").glob("*") if path.suffix != ".log"}
    assert found - {".hydra"} == ({*RESULTS, "learning_curve.png"} if status == 0 else set())
