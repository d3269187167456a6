"""The comparison with the textbook's figures, from made-up results."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from matplotlib.collections import PathCollection

from fnnq_torchrl.studies.experiments import Experiment, NoResults, read_experiment
from fnnq_torchrl.studies.textbook.page import write_page
from fnnq_torchrl.studies.textbook.pictures import car_figure, walk_figure
from fnnq_torchrl.studies.textbook.published import REWARDS, STEPS, Point, compare
from fnnq_torchrl.studies.textbook.returns import Walk, learned, return_errors, walks
from fnnq_torchrl.studies.textbook.walk import read_errors, root_mean_square, true_values
from fnnq_torchrl.training.results import Evaluations, write_evaluations
from fnnq_torchrl.training.trainer import Trainer
from fnnq_torchrl.training.weights import save_snapshots
from tests.compositions import config_of

RUNS = 40


def write_job(directory: Path, overrides: list[str], number: float) -> None:
    """Write a finished job whose runs have a return and a length around a number."""
    settings = asdict(config_of(*overrides, f"num_seeds={RUNS}"))
    (directory / ".hydra").mkdir(parents=True)
    (directory / ".hydra" / "config.yaml").write_text(json.dumps(settings))
    scores = number + np.linspace(-1, 1, RUNS)[:, None] * [np.nan, 1.0]
    evaluations = Evaluations(
        seed=np.arange(RUNS),
        lam=np.full(RUNS, settings["lam"]),
        situations=np.array([0, settings["situations"]]),
        steps=np.zeros((RUNS, 2), dtype=np.int64),
        catches=np.zeros((RUNS, 2), dtype=np.int64),
        diverged=np.zeros((RUNS, 2), dtype=bool),
        returns=scores,
        lengths=abs(scores),
    )
    write_evaluations(directory / "evaluations.csv", evaluations)
    (directory / "summary.json").write_text("{}")


@pytest.fixture(scope="module")
def car(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """Results that are the published ones, except for λ = 0.99, which is 30 steps better."""
    sweep = tmp_path_factory.mktemp("car")
    for number, (lam, point) in enumerate(STEPS.items()):
        better = 30 if lam == 0.99 else 0
        words = ["+experiment=sutton_barto_12_10", f"lam={lam}", f"alpha={point.at / 8}"]
        write_job(sweep / str(number), words, point.value - better)
    return read_experiment(sweep, "car")


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    sweep = tmp_path_factory.mktemp("traces")
    for number, (trace, point) in enumerate(REWARDS.items()):
        words = ["+experiment=sutton_barto_12_11", f"trace={trace}", f"alpha={point.at / 8}"]
        write_job(sweep / str(number), words, point.value)
    return read_experiment(sweep, "traces")


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    """Jobs whose values are 0 before learning and then the true ones, plus 0.1 for λ = 0."""
    sweep = tmp_path_factory.mktemp("walk")
    jobs = [(trace, lam) for trace in ("gradient", "dutch") for lam in (0, 0.8)]
    for number, (trace, lam) in enumerate(jobs):
        words = ["+experiment=sutton_barto_12_6", f"trace={trace}", f"lam={lam}", "situations=1"]
        directory = sweep / str(number)
        write_job(directory, words, 0)
        truth = torch.tensor(true_values(19, -1, 1)).float() + (0.1 if lam == 0 else 0)
        weight = torch.stack([torch.zeros(RUNS, 19, 1), truth.view(1, 19, 1).expand(RUNS, -1, -1)])
        seeds, lams = np.arange(RUNS), np.full(RUNS, lam)
        save_snapshots(directory / "snapshots.pt", {"weight": weight}, [0, 1], seeds, lams, {})
    return read_experiment(sweep, "walk")


def test_the_true_values_solve_the_equations_of_the_walk() -> None:
    """Each value is the mean of its neighbours'; the ends' rewards stand for the outer ones."""
    values = true_values(19, -1.0, 1.0)
    padded = np.concatenate([[-1.0], values, [1.0]])
    np.testing.assert_allclose(values, (padded[:-2] + padded[2:]) / 2, atol=1e-15)
    assert root_mean_square(np.zeros(19), values) == pytest.approx(0.3**0.5)


def test_the_lambda_return_of_a_walk_by_hand() -> None:
    """The walk is 2, 1, 2, 3 and out to the right; V(3) = 1 and λ = ½."""
    values = np.array([[0.0, 0.0, 1.0]])
    walk = Walk(np.array([[2], [1], [2], [3]]), np.array([2.0]))
    # From the end: G₃ = 2, G₂ = (1 + 2)/2 = 1.5, G₁ = (0 + 1.5)/2 = 0.75, G₀ = (0 + 0.75)/2.
    after = learned(values, walk, lam=0.5, alpha=0.5)
    np.testing.assert_allclose(after, [[0.375, 0.1875 + 0.5 * (1.5 - 0.1875), 1.5]])


def test_td_lambda_makes_the_changes_of_the_lambda_return_if_alpha_is_small() -> None:
    """While V stays as it is, the traces' changes add up to those of the λ-returns."""
    [walk] = walks(config_of("task=random_walk", "env.states=5").env, np.arange(3), 1)
    values = np.random.default_rng(0).normal(size=(3, 5))
    lam, alpha = 0.7, 1e-7
    changed = (learned(values, walk, lam, alpha) - values) / alpha
    for run in range(3):
        path = [place - 1 for place in walk.places[:, run] if place]
        trace, expected = np.zeros(5), np.zeros(5)
        for t, place in enumerate(path):
            trace = lam * trace + np.eye(5)[place]
            last = t == len(path) - 1
            target = walk.rewards[run] if last else values[run, path[t + 1]]
            expected += (target - values[run, place]) * trace
        np.testing.assert_allclose(changed[run], expected, atol=1e-4)


def test_the_walks_are_those_of_the_learning_runs() -> None:
    config = config_of("task=random_walk", "situations=3", "num_seeds=4", "engine=eager")
    trainer = Trainer.of(config)
    trainer.learn()
    taken = walks(config.env, np.arange(4), 3)
    steps = sum(walk.walking.sum(axis=0) for walk in taken)
    np.testing.assert_array_equal(trainer.evaluate().steps[:, -1], steps)


def test_a_difference_has_the_error_of_both_means_and_of_the_reading() -> None:
    ours = np.array([9.0, 11.0])  # mean 10, standard deviation √2
    compared = compare(ours, Point(value=14.0, at=1.0, reading=2.0))
    assert compared.difference == -4
    assert compared.error == pytest.approx((2 * (1 / 30 + 1 / 2) + 4) ** 0.5)
    assert compared.agrees
    assert not compare(ours - 1, Point(14.0, 1.0, 2.0)).agrees


def test_the_errors_are_those_of_the_tables_after_learning(walk: Experiment) -> None:
    for each in read_errors(walk):
        assert each.before == pytest.approx(0.3**0.5)
        np.testing.assert_allclose(each.errors, 0.1 if each.lam == 0 else 0, atol=1e-7)


def test_the_page_says_what_agrees(car: Experiment, traces: Experiment, walk: Experiment) -> None:
    text = write_page(car, traces, read_errors(walk) + return_errors(walk))
    steps, rewards = (line for line in text.splitlines() if line.startswith("* **Our "))
    agreeing, differing = steps.partition("They differ")[::2]
    assert "They differ" not in rewards
    for lam in (0, 0.5, 0.95):
        assert f"λ = {lam:g} (+0 ± 2)" in agreeing
    assert differing.startswith(" for λ = 0.99 (-30 ± 2)")
    assert "| λ = 0.95 | 180 (1) | 180.0 [179.8, 180.2] |" in text
    assert "| accumulating | -406 (0.2) |" in text
    assert "the program measured 0.548" in text
    assert "{" not in text


def test_a_missing_point_is_told(car: Experiment, traces: Experiment, walk: Experiment) -> None:
    one = replace(car, jobs=[job for job in car.jobs if job.settings["lam"] != 0.5])
    with pytest.raises(NoResults, match=r"has no jobs with lam=0\.5"):
        write_page(one, traces, read_errors(walk) + return_errors(walk))
    moved = replace(car.jobs[0], settings=car.jobs[0].settings | {"alpha": 1.0})
    with pytest.raises(NoResults, match=r"there are 0 jobs with alpha=0\.1875, not one"):
        write_page(replace(car, jobs=[moved, *car.jobs[1:]]), traces, read_errors(walk))


def test_the_pictures_have_a_line_for_each_lambda(car: Experiment, walk: Experiment) -> None:
    (axes,) = car_figure(car).axes
    assert [line.get_label() for line in axes.lines] == [f"λ = {lam:g}" for lam in sorted(STEPS)]
    rings = [each.get_offsets() for each in axes.collections if isinstance(each, PathCollection)]
    places = {tuple(offset) for ring in rings for offset in ring.tolist()}
    assert places == {(point.at, point.value) for point in STEPS.values()}
    panels = walk_figure(read_errors(walk) + return_errors(walk)).axes
    assert [len(axes.lines) for axes in panels] == [2, 2, 2]
