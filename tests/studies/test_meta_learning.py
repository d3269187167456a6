"""The page on meta-learning, from invented results."""

import json
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from envs.pictures import Figure
from fnnq_torchrl.studies.experiments import Experiment, newest_experiment
from fnnq_torchrl.studies.meta_learning.ball import SCHEMES, compare, recoveries
from fnnq_torchrl.studies.meta_learning.command import main
from fnnq_torchrl.studies.meta_learning.page import ring_table
from fnnq_torchrl.studies.meta_learning.ring import (
    PUBLISHED,
    Cell,
    Shares,
    agrees,
    read_shares,
    share,
)
from fnnq_torchrl.studies.meta_learning.ring import RUNS as RUNS_OF_REPLICATION
from fnnq_torchrl.training.pictures.parameters import parameters_figure
from fnnq_torchrl.training.results import Evaluations, write_evaluations
from fnnq_torchrl.training.score import Score
from fnnq_torchrl.training.solved import COLUMNS, read_solved
from tests.compositions import config_of
from tests.experiment_files import Settings, grid, invent_experiment

ALPHAS = "0.1,0.4"
ADAPTIVE = {"adaptive_clock": "steps,situations", "alpha": ALPHAS}
CONSTANT = ("step_size=constant", "alpha_decay=1")
BALL = [
    *grid({"step_size": "decay,obgd", "alpha": ALPHAS}),
    *grid({"alpha": ALPHAS}, *CONSTANT),
    *grid(ADAPTIVE, "adaptive=doya", "exploration=boltzmann", *CONSTANT),
]
CHANGES = ("env.swap_wheels=1", "env.changed_speed=1.3")
CHANGING = [
    (*job, change, "env.change_at=100", "situations=200") for change in CHANGES for job in BALL
]
RUNS = 60


def level(settings: Settings) -> float:
    """Return a score: meta-learning is better, and ObGD the same as the paper's."""
    return 4.5 if settings["adaptive"] == "doya" else 3.5


@pytest.fixture(scope="module")
def ball() -> Experiment:
    return invent_experiment("meta_learning", BALL, level, RUNS)


@pytest.fixture(scope="module")
def changing() -> Experiment:
    return invent_experiment("changing_ball", CHANGING, level, RUNS)


def columns(**runs: list[float]) -> dict[str, np.ndarray]:
    return {key: np.array(values, dtype=float)[:, np.newaxis] for key, values in runs.items()}


def test_a_solution_is_stable_by_the_program_and_by_the_text() -> None:
    """Of four solutions, one dips, one is unsteady and one is both; the fifth run has none."""
    found = Shares.of(
        columns(
            solved=[1, 1, 1, 1, 0],
            lowest=[0.75, 0.7, 0.8, 0.7, np.inf],
            later=[10, 10, 10, 10, 0],
            above=[9, 9, 8, 8, 0],
        ),
        0,
    )
    assert found.solved.tolist() == [True] * 4 + [False]
    assert found.stable.tolist() == [True, True, True, False, False]
    assert found.stable_by_text.tolist() == [True, False, False, False, False]


def test_a_share_agrees_within_twice_its_error() -> None:
    """At 15.7 % of 300 and of 300 runs, twice the error of the difference is about 6 %."""
    cell = Cell("exponential", 10, (1.0, 0.99))
    assert PUBLISHED[cell] == 0.157
    for count, expected in ((47, True), (62, True), (70, False), (20, False)):
        stable = np.arange(300) < count
        assert agrees(cell, Shares(stable, stable, stable)) == expected
    value, low, high = share(np.arange(300) < 47)
    assert low < value == 47 / 300 < high


def test_schemes_are_compared_with_the_papers_over_the_same_seeds(ball: Experiment) -> None:
    found = compare(ball)
    assert [*found] == [
        *[*SCHEMES][:3],
        *("meta-learned α, T, γ (steps)", "meta-learned α, T, γ (situations)"),
    ]
    assert found["ObGD"].over_alphas.low <= 0 <= found["ObGD"].over_alphas.high
    for name in ("meta-learned α, T, γ (steps)", "meta-learned α, T, γ (situations)"):
        assert found[name].at_best.low > 0.5
        assert found[name].over_alphas.low > 0.5


def test_the_scores_around_a_change(changing: Experiment) -> None:
    found = recoveries(changing, {"env.swap_wheels": True})["constant α"]
    jobs = [
        job
        for job in changing.jobs
        if job.settings["step_size"] == "constant"
        and job.settings["adaptive"] == "none"
        and job.settings["env.swap_wheels"]
    ]
    scores = np.mean([job.evaluations.score for job in jobs], axis=0)
    for part, expected in (
        (found.before, scores[:, 12:20].mean(1)),
        (found.at_once, scores[:, 20]),
        (found.after, scores[:, 21:].mean(1)),
        (found.final, scores[:, 33:].mean(1)),
    ):
        np.testing.assert_allclose(part, expected)


def test_the_picture_has_a_panel_for_each_parameter_that_there_is(ball: Experiment) -> None:
    job = ball.jobs[0]
    shape = job.evaluations.steps.shape
    rng = np.random.default_rng(0)
    evaluations = Evaluations(
        **{
            key: getattr(job.evaluations, key)
            for key in ("seed", "lam", "situations", "steps", "catches", "diverged")
        },
        returns=job.evaluations.returns,
        lengths=job.evaluations.lengths,
        alpha=rng.uniform(0.1, 0.9, shape),
        gamma=rng.uniform(0.1, 0.9, shape),
    )
    figure: Figure = parameters_figure(evaluations, Score.of(job.config))
    assert [axes.get_ylabel() for axes in figure.axes] == ["score (catches of 5)", "α", "γ"]
    median = figure.axes[1].lines[0].get_ydata()
    np.testing.assert_allclose(median, np.median(evaluations.alpha, axis=0))
    assert [axes.get_yscale() for axes in figure.axes] == ["linear", "log", "linear"]


def test_a_cut_file_of_solved_tasks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "solved.csv"
    path.write_text(",".join(COLUMNS) + "\n0,20,1,0.8,5,4\n0,40,0,inf,0,0\n1,20,0,inf,0,0\n")
    with pytest.raises(ValueError, match="is not a complete file of solved tasks"):
        read_solved(path)
    path.write_text(path.read_text() + "1,40,1,0.5,7,7\n")
    assert read_solved(path)["lowest"].tolist() == [[0.8, np.inf], [np.inf, 0.5]]


def test_the_command_writes_the_page_and_prints_the_table(
    ball: Experiment,
    changing: Experiment,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_ring(tmp_path / "doya" / "2026-01-02_03-04-05")
    doya = newest_experiment(tmp_path, "doya")
    found = {"doya": doya, "meta_learning": ball, "changing_ball": changing}
    command = "fnnq_torchrl.studies.meta_learning.command"
    monkeypatch.setattr(f"{command}.newest_experiment", lambda root, name: found[name])
    arguments = ["meta_learning", "--to", str(tmp_path)]
    monkeypatch.setattr("sys.argv", [*arguments, "--ring"])
    main()
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 2 + len(read_shares(doya))
    assert "| exponential | 83.7 % | 50.0 % | 50.0 % [" in rows[2]
    monkeypatch.setattr("sys.argv", arguments)
    main()
    page = (tmp_path / "meta_learning.md").read_text()
    assert rows[2] in page
    assert re.search(r"^\| ObGD .* same \| .* same \|", page, re.MULTILINE)
    assert page.count("of learning. Mean scores afterwards, compared with decaying α (3.5") == 2
    assert page.count("): more: meta-learned α, T, γ (s") == 2
    for name in ("meta_learning.png", "changing_ball.svg"):
        assert (tmp_path / "figures" / name).stat().st_size > 1000


def test_as_many_runs_as_were_published_are_told_once() -> None:
    outcomes = np.arange(RUNS_OF_REPLICATION) % 2 > 0
    rows = ring_table({next(iter(PUBLISHED)): Shares(outcomes, outcomes, outcomes)}).splitlines()
    assert "| ours, 300 runs |" in rows[0]
    assert "first" not in rows[0]
    assert "| 83.7 % | 50.0 % [" in rows[2]


def write_ring(sweep: Path) -> None:
    """Write two jobs on the ring, in which every other run has a stable solution."""
    runs = RUNS_OF_REPLICATION + 100
    for number, beta in enumerate(("exponential", "affine")):
        config = config_of(
            *("task=ring", "adaptive=doya", "env.states=4", "temperature=1"),
            f"adaptive_beta={beta}",
        )
        directory = sweep / str(number)
        (directory / ".hydra").mkdir(parents=True)
        (directory / ".hydra" / "config.yaml").write_text(json.dumps(asdict(config)))
        counts = np.zeros((runs, 2), dtype=np.int64)
        write_evaluations(
            directory / "evaluations.csv",
            Evaluations(
                seed=np.arange(runs),
                lam=np.zeros(runs),
                situations=np.array([0, 50]),
                steps=counts,
                catches=counts,
                diverged=counts > 0,
                returns=counts * 1.0,
                lengths=counts * 1.0,
            ),
        )
        rows = [f"{run},50,{run % 2},0.8,100,95" for run in range(runs)]
        (directory / "solved.csv").write_text("\n".join([",".join(COLUMNS), *rows]) + "\n")
        (directory / "summary.json").write_text("{}")
