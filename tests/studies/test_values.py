"""The page on value functions, written from made-up results."""

import json
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl import values
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.values import SCHEMAS
from fnnq_torchrl.studies.experiments import Experiment, NoResults, newest_experiment
from fnnq_torchrl.studies.values import command
from fnnq_torchrl.studies.values import page as page_module
from fnnq_torchrl.studies.values.aloud import read_aloud
from fnnq_torchrl.studies.values.learners import (
    BALL,
    WORLDS,
    Learner,
    find,
    in_world,
    read_learners,
)
from fnnq_torchrl.training.results import Evaluations, write_evaluations
from fnnq_torchrl.training.weights import save_checkpoint
from tests.experiment_files import changed_config

RUNS = 6
CAR, POLE, ACROBOT = WORLDS
BEFORE = {CAR: 300.0, POLE: 20.0, ACROBOT: 500.0, BALL: 1.0}
AFTER = {CAR: 100.0, POLE: 450.0, ACROBOT: 80.0, BALL: 4.5}


def write_job(directory: Path, overrides: list[str], numbers: list[float]) -> None:
    """Write a finished job whose measure is about these numbers at its evaluations."""
    settings = asdict(config := changed_config(tuple(overrides), RUNS))
    (directory / ".hydra").mkdir(parents=True)
    (directory / ".hydra" / "config.yaml").write_text(json.dumps(settings))
    measured = np.add.outer(np.linspace(-0.5, 0.5, RUNS), np.array(numbers))
    shape = measured.shape
    evaluations = Evaluations(
        seed=np.arange(RUNS),
        lam=np.full(RUNS, settings["lam"]),
        situations=20 * np.arange(shape[1]),
        steps=np.zeros(shape, dtype=np.int64),
        catches=np.nan_to_num(measured).round().astype(np.int64),
        diverged=np.zeros(shape, dtype=bool),
        returns=-measured,
        lengths=measured,
    )
    write_evaluations(directory / "evaluations.csv", evaluations)
    network = make_value_network(config.value, make_candidates(config), RUNS)
    weights = {name: weight.detach().clone() for name, weight in network.named_parameters()}
    if "weight" in weights:  # the highest velocities prefer the last action, all others the first
        weights["weight"][..., 0] = 0.5
        weights["weight"][:, ..., -1, -1] = 1.0
    save_checkpoint(directory / "checkpoint.pt", weights, range(RUNS), [0.2] * RUNS, settings)
    (directory / "summary.json").write_text("{}")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Jobs of two value functions in each world; tables don't learn to balance the pole."""
    root = tmp_path_factory.mktemp("outputs")
    number, tasks = 0, [*(each.kind for each in WORLDS), "follow"]
    for world, task in zip((*WORLDS, BALL), tasks, strict=True):
        kinds = ["fnnq", "fuzzy_q"] + ["table"] * (world is POLE)
        for kind in kinds:
            words = [f"task={task}", f"value={kind}"]
            words += ["env.time_limit_steps=9"] * (world is CAR)
            worse = (1 if world is BALL else 5) * (kind == "fuzzy_q")
            after = AFTER[world] - world.sign * worse
            after = BEFORE[world] - 1 if kind == "table" else after
            where = root / "values" / "2026-01-02_03-04-05" / str(number)
            write_job(where, [*words, "lam=0.5", "alpha=0.3"], [BEFORE[world], *[after] * 4])
            for i, alpha in enumerate((0.1, 0.3)):
                where = root / "values_sweep" / "2026-01-02_03-04-05" / str(2 * number + i)
                better = world.sign * (alpha == (0.1 if kind == "fuzzy_q" else 0.3))
                numbers = [np.nan if world in WORLDS else 1.0, after + better]
                write_job(where, [*words, "lam=0.5", f"alpha={alpha}", "seed=1000"], numbers)
            number += 1
    return root


@pytest.fixture(scope="module")
def found(results: Path) -> dict[tuple[Path, str], Experiment]:
    names = ("values_sweep", "values")
    return {(results, name): newest_experiment(results, name) for name in names}


@pytest.fixture(scope="module")
def learners(found: dict[tuple[Path, str], Experiment]) -> list[Learner]:
    return read_learners(*found.values())


def test_the_learners(learners: list[Learner]) -> None:
    assert [each.value for each in in_world(learners, CAR)] == ["fnnq", "fuzzy_q"]
    assert [each.value for each in in_world(learners, POLE)] == ["fnnq", "fuzzy_q", "table"]
    fuzzy = find(learners, CAR, "fnnq")
    assert (fuzzy.is_best, find(learners, CAR, "fuzzy_q").is_best) == (True, False)
    assert fuzzy.weights == 90
    assert fuzzy.before.mean() == pytest.approx(300)
    assert fuzzy.afterwards.mean() == fuzzy.meanwhile.mean() == pytest.approx(100)
    assert (fuzzy.failed, find(learners, POLE, "table").failed) == (0, 1)
    with pytest.raises(NoResults, match="values has 0 jobs of value=mlp in acrobot, not one"):
        find(learners, ACROBOT, "mlp")


def test_a_diverged_run_is_the_worst_in_every_world(learners: list[Learner]) -> None:
    for world in WORLDS:
        evaluations = find(learners, world, "fnnq").judged.evaluations
        limit = np.full_like(evaluations.lengths, 500.0)  # as the trainer writes
        gone = replace(evaluations, diverged=np.ones_like(evaluations.diverged), lengths=limit)
        assert (world.measured(gone) == (0 if world is POLE else 500)).all()


def test_the_controllers_are_read(learners: list[Learner]) -> None:
    for value in ("fnnq", "fuzzy_q"):
        aloud = read_aloud(find(learners, CAR, value).judged.directory)
        # 6 positions with 2 velocities to either side: those backward, and the fastest forward one.
        assert aloud.moving("velocity") == 24
        assert aloud.along("velocity").tolist() == [18] * RUNS
        assert aloud.full.tolist() == [-9] * RUNS
        lines = aloud.grid().splitlines()
        assert lines[0].startswith("| position \\ velocity | fast_back | back | still |")
        assert len(lines) == 8
        if value == "fuzzy_q":
            assert all(line.endswith("| reverse (0.00) | forward (2.00) |") for line in lines[2:])


def test_the_command_writes_the_page(
    results: Path,
    found: dict[tuple[Path, str], Experiment],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(command, "newest_experiment", lambda root, name: found[root, name])
    reasons = {("cart_pole", "table"): "Cells are large."}
    monkeypatch.setattr(page_module, "_WHY", reasons)
    told = ["values", "--results", str(results), "--to", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", told)
    values.main()
    text = (tmp_path / "value_functions.md").read_text(encoding="utf-8")
    best = "after learning, `fnnq` is best, with 100 [100, 100] steps to the goal and 90 weights."
    other = "`fuzzy_q` has 105 [105, 105], +5 [+5, +5] of difference, with 90 weights."
    assert f"* **Mountain Car**: {best} {other}" in text
    assert "* **The ball**: after learning, `fnnq` is best, with 4.50 [" in text
    assert "* **Failing in a quarter of the runs or more**: `table` on Cart-Pole (100%)." in text
    assert "**`table` fails** in 100% of the runs. Cells are large." in text
    assert "| `fuzzy_q` | 90 | 0.5 | 0.3 (sweep's best: λ = 0.5, α = 0.1) | 300 |" in text
    assert "{" not in text
    for name in ("value_functions", "value_functions_sweep"):
        assert (tmp_path / "figures" / f"{name}.png").stat().st_size > 10_000


def test_the_reasons_are_about_learners_of_the_study() -> None:
    assert {world for world, _ in page_module._WHY} <= {world.kind for world in WORLDS}
    assert {value for _, value in page_module._WHY} <= {*SCHEMAS}


def test_the_weights_of_a_controller_on_the_ball_are_the_papers(learners: list[Learner]) -> None:
    assert [each.weights for each in in_world(learners, BALL)] == [20, 20]
    assert torch.tensor([each.failed for each in in_world(learners, BALL)]).sum() == 0
