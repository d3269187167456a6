"""The measures in unseen states equal closed forms, and the page agrees with the measures."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.studies.experiments import Experiment, NoResults, newest_experiment
from fnnq_torchrl.studies.extrapolation.command import main, measure
from fnnq_torchrl.studies.extrapolation.conclusions import (
    above,
    difference_words,
    movement_words,
)
from fnnq_torchrl.studies.extrapolation.findings import Findings
from fnnq_torchrl.studies.extrapolation.forgetting import FirstSide
from fnnq_torchrl.studies.extrapolation.indifferent import IndifferentWhereUnseen
from fnnq_torchrl.studies.extrapolation.interference import distances, interference
from fnnq_torchrl.studies.extrapolation.learners import Learner
from fnnq_torchrl.studies.extrapolation.movement import (
    STATES,
    greedy_change_beyond,
    movement,
    regions,
    state_values,
    towards_the_ball,
)
from fnnq_torchrl.studies.extrapolation.page import write_page
from fnnq_torchrl.studies.extrapolation.pictures import FIGURES
from fnnq_torchrl.studies.extrapolation.playing import TESTS, catches, shares_beyond, starts
from fnnq_torchrl.studies.extrapolation.step_sizes import best_steps, step_words
from fnnq_torchrl.studies.reproduction.verdicts import Verdict
from fnnq_torchrl.studies.statistics import Interval
from fnnq_torchrl.training.weights import Snapshots
from tests.extrapolation_files import RUNS, extrapolating, write_results
from tests.oracles.fuzzy import action_value, normalised_firing_strengths

TRIANGLES = "fnnq, 2 triangles"
KINDS = ("fnnq", "mlp", "table", TRIANGLES)
DOUBLE = "machine.dtype=float64"


def learner(config: Config, **weights: torch.Tensor) -> Learner:
    """Return runs with these weights, each ``[evaluations, runs, ...]``."""
    pages, runs = next(iter(weights.values())).shape[:2]
    return Learner(
        config,
        Snapshots(
            weights=weights,
            situations=torch.tensor([0, 200, 400][:pages]),
            seed=torch.arange(runs),
            lam=torch.full((runs,), 0.2, dtype=torch.float64),
            config={},
        ),
        np.zeros((runs, pages), dtype=bool),
    )


def rules(generator_seed: int = 0) -> torch.Tensor:
    """Return consequents ``[2, runs, 5, 4]``: 0 at the start, and random ones at the switch."""
    generator = torch.Generator().manual_seed(generator_seed)
    learned = torch.randn(RUNS, 5, 4, generator=generator, dtype=torch.float64)
    return torch.stack([torch.zeros_like(learned), learned])


# -- movement -------------------------------------------------------------------------------------


def test_regions_are_what_the_head_saw() -> None:
    where = regions(learner(extrapolating(), weight=rules()))
    states = STATES.numpy()
    bounds = [(round(float(states[r].min()), 2), round(float(states[r].max()), 2)) for r in where]
    assert bounds == [(-0.2, 1.0), (-1.0, -0.21), (1.01, 1.5), (-1.5, -1.01)]
    assert sum(region.astype(int) for region in where).tolist() == [1] * len(states)


def test_weights_of_one_cell_of_a_table_move_q_there_only() -> None:
    weight = torch.zeros(2, RUNS, 5, 4)
    weight[1, :, 4] = torch.tensor([3.0, -3.0, 3.0, -3.0])  # the label at 0.5 rad, any action
    moved = movement(learner(extrapolating("value=table"), weight=weight), 1)
    where = STATES.numpy() > 0.3
    # Beyond 0.21 rad, where the labels 0.1 and 0.5 have equal memberships, is one cell.
    assert np.ptp(moved[:, where]) == pytest.approx(0, abs=1e-6)
    assert moved[:, where].min() > 1  # 1 is the mean over all seen states
    assert (moved[:, STATES.numpy() < 0.1] == 0).all()


def test_movement_is_per_unit_of_the_seen_side() -> None:
    weights = rules()
    one, ten = (
        movement(learner(extrapolating(DOUBLE), weight=weights * factor), 1) for factor in (1, 10)
    )
    np.testing.assert_allclose(one, ten)
    where = regions(learner(extrapolating(DOUBLE), weight=weights))
    np.testing.assert_allclose(one[:, where.seen].mean(axis=1), 1)


def test_q_and_v_are_the_fuzzy_rule_bases() -> None:
    config, weights = extrapolating(DOUBLE), rules()
    labels = [config.value.inputs["bearing"], config.value.action]
    candidates = np.linspace(-1, 1, 21)
    values = state_values(learner(config, weight=weights), 1)
    for state in (0, 130, 300):
        flat = weights[1, 2].flatten().numpy()
        points = [(float(STATES[state]), action) for action in candidates]
        best = max(action_value(flat, point, labels) for point in points)
        assert values[2, state] == pytest.approx(best)


def test_the_greedy_action_beyond_the_view_is_compared_with_that_at_its_edge() -> None:
    left, right = torch.tensor([1.0, 0, 0, 0]), torch.tensor([0, 0, 0, 1.0])
    weight = torch.zeros(2, 1, 5, 4)
    weight[1, 0, 0], weight[1, 0, 4] = right, left
    same = greedy_change_beyond(learner(extrapolating(), weight=weight), 1)
    assert [change.item() for change in same] == [0, 0]
    # The last label is far out, and its action takes over on the way there.
    labels = {"bearing": [[-0.5, 0.1], [0, 0.05], [0.1, 0.1], [0.5, 0.1], [2.0, 0.1]]}
    config = replace(extrapolating(), value=replace(extrapolating().value, inputs=labels))
    weight[1, 0, 3] = right
    seen, unseen = greedy_change_beyond(learner(config, weight=weight), 1)
    assert 0.5 < seen.item() < 2.0
    assert unseen.item() == 0


# -- interference ---------------------------------------------------------------------------------


def test_interference_of_the_fuzzy_network_is_that_of_its_firing_strengths() -> None:
    """Q is linear in its weights, so ΔQ(s′, a) = α f(s, a)·f(s′, a)."""
    config = extrapolating(DOUBLE)
    labels = [config.value.inputs["bearing"], config.value.action]
    action = 0.3
    places = [0.05 * place for place in range(-20, 21)]
    f = np.array([normalised_firing_strengths((place, action), labels) for place in places])
    ratios: dict[int, list[float]] = {}
    for here in range(16, 41):  # from −0.2 rad on
        for there in range(41):
            ratio = f[there] @ f[here] / (f[here] @ f[here])
            ratios.setdefault(abs(there - here), []).append(ratio)
    found = interference(
        learner(config, weight=rules()), 1, torch.tensor([action]).double(), alpha=0.1
    )
    assert found.shape == (RUNS, len(distances())) == (RUNS, 21)
    expected = [np.mean(ratios[step]) for step in range(21)]
    np.testing.assert_allclose(found, np.tile(expected, (RUNS, 1)), rtol=1e-6)


def test_a_table_has_no_interference_beyond_its_widest_cell() -> None:
    found = interference(
        learner(extrapolating("value=table"), weight=rules().float()),
        1,
        torch.tensor([0.0, 1.0]),
        alpha=0.1,
    )
    # The widest cell is the one from its border at 0.21 rad to 1 rad.
    np.testing.assert_allclose(found[:, 0], 1)
    assert (found[:, distances() > 0.81] == 0).all()
    assert (found[:, distances() < 0.7] > 0).all()


# -- playing --------------------------------------------------------------------------------------


def test_the_sides_tests_are_mirror_images() -> None:
    assert len(starts(1)) == TESTS
    assert starts(1)[:, 0].min() > 0.2  # so that the mirrored starts are on the unseen side
    assert starts(-1).equal(-starts(1))


def test_a_policy_that_knows_nothing_of_the_right_catches_more_on_the_left() -> None:
    wanted = torch.tensor([0.0, 0.5, 0.0, -0.5, -1.0])  # at the label far to the right, straight on
    actions = torch.tensor([-1.0, -0.4, 0.4, 1.0])
    weight = -(wanted.unsqueeze(1) - actions).square().expand(2, 3, 5, 4)
    config = extrapolating()
    world = replace(config.env, circle_radius_m=1.5, time_limit_steps=120)
    runs = learner(replace(config, env=world), weight=weight)
    assert catches(runs, [0, 1], 1).shape == (3, 2)
    assert catches(runs, [1], 1).min() > catches(runs, [1], -1).max()


def test_q_that_is_right_where_nothing_was_seen_catches_more_than_the_control() -> None:
    wanted = torch.tensor([1.0, 0.5, 0.0, -0.5, -1.0])  # towards the ball, wherever it is
    actions = torch.tensor([-1.0, -0.4, 0.4, 1.0])
    weight = -(wanted.unsqueeze(1) - actions).square().expand(2, 8, 5, 4)
    config = extrapolating()
    world = replace(config.env, circle_radius_m=1.5, time_limit_steps=120)
    runs = learner(replace(config, env=world), weight=weight)
    learned, control = (
        catches(runs, [1], side, indifferent=indifferent).mean()
        for side, indifferent in ((-1, False), (-1, True))
    )
    assert learned > control + 1
    # From the left the ball is rarely lost to the right.
    assert catches(runs, [1], 1, indifferent=True).mean() > control + 1
    seen, unseen = towards_the_ball(runs, 1)
    assert seen.min() > 0.9
    assert (unseen == 1).all()
    away, never = towards_the_ball(replace(runs, snapshots=flipped(runs)), 1)
    assert away.max() < 0.1
    assert (never == 0).all()


def flipped(runs: Learner) -> Snapshots:
    """Return weights that prefer the opposite action everywhere."""
    weights = {name: weight.flip(-1) for name, weight in runs.snapshots.weights.items()}
    return replace(runs.snapshots, weights=weights)


def test_the_control_is_q_where_it_was_seen_and_nothing_elsewhere() -> None:
    network = make_value_network(extrapolating().value, torch.linspace(-1, 1, 21), 1)
    torch.nn.init.ones_(network.get_parameter("weight"))
    bearing = torch.tensor([[[-0.3], [-0.2], [0.0], [1.0]]])
    control = IndifferentWhereUnseen(network, -0.2)
    assert (control(bearing)[0, 0] == 0).all()
    assert control(bearing)[0, 1:].equal(network(bearing)[0, 1:])
    assert control(bearing, action=bearing)[0, :, 0].tolist()[0] == 0


def test_nothing_is_seen_farther_to_the_right_than_the_head_sees() -> None:
    runs = learner(extrapolating(), weight=torch.zeros(2, RUNS, 5, 4))
    edges = (-0.2, -0.1, 0.0, 2.0)
    hidden, whole = (shares_beyond(runs, edges, whole_view=whole) for whole in (False, True))
    assert (hidden[:, 0] == 0).all()
    assert (hidden[:, -1] == 1).all()
    assert (np.diff(whole, axis=1) >= 0).all()
    # With weights of 0 all actions are equally likely, and the sign of the bearing doesn't depend
    # on how far out a ball is reported.
    np.testing.assert_array_equal(hidden[:, 2], whole[:, 2])
    assert whole[:, 0].max() > 0


# -- words ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("low", "high", "verdict", "words"),
    [
        (0.01, 0.05, Verdict.FAILS, "stayed"),
        (0.05, 0.15, Verdict.OPEN, "may have moved or not"),
        (0.2, 0.3, Verdict.HOLDS, "less than half"),
        (0.4, 0.6, Verdict.HOLDS, "can't be told"),
        (0.9, 1.1, Verdict.HOLDS, "more than half"),
        (1.1, 1.2, Verdict.HOLDS, "farther"),
    ],
)
def test_what_a_movement_comes_to(low: float, high: float, verdict: Verdict, words: str) -> None:
    interval = Interval((low + high) / 2, low, high)
    assert above(interval, 0.1) is verdict
    assert words in movement_words(interval)


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (1, 2, "helps"),
        (-2, -1, "hurts"),
        (-0.2, 0.2, "no difference"),
        (-1, 1, "a difference or not"),
        (0.2, 1, "a difference or not"),
    ],
)
def test_what_a_difference_comes_to(low: float, high: float, words: str) -> None:
    assert words in difference_words(Interval((low + high) / 2, low, high), "helps", "hurts")


# -- the page -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def extrapolation_results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("outputs")
    write_results(root, KINDS)
    return root


Measured = tuple[list[Findings], list[FirstSide]]


@pytest.fixture(scope="module")
def experiment(extrapolation_results: Path) -> Experiment:
    return newest_experiment(extrapolation_results, "extrapolation")


@pytest.fixture(scope="module")
def sweep(extrapolation_results: Path) -> Experiment:
    return newest_experiment(extrapolation_results, "value_functions")


@pytest.fixture(scope="module")
def measured(experiment: Experiment) -> Measured:
    return measure(experiment)


def test_the_page_is_whole(sweep: Experiment, measured: Measured) -> None:
    findings, constant = measured
    page = write_page(findings, constant, sweep)
    for table in re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1
        assert table.count("\n| `") == len(KINDS)
    assert "nan" not in page
    assert "{" not in page
    assert set(re.findall(r"\(figures/(.*)\.png\)", page)) == FIGURES.keys()
    assert "The claim that the fuzzy network doesn't extrapolate **" in page
    assert re.search(r"with compact membership functions \*\*.*\*\* for `fnnq, 2 triangles`", page)
    moved = findings[0].moved_in(findings[0].where.unseen).mean()
    assert f"| `fnnq` | {moved:.2f}" in page
    assert f"at most {0:.2%} of the states that a run visited" in page


def test_the_command(
    extrapolation_results: Path,
    measured: Measured,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    findings = iter(measured[0])
    monkeypatch.setattr(Findings, "of", lambda learner: next(findings))
    command = ["extrapolation", "--results", str(extrapolation_results), "--to", str(tmp_path)]
    monkeypatch.setattr("sys.argv", command)
    main()
    assert (tmp_path / "extrapolation.md").exists()
    names = {path.name for path in (tmp_path / "figures").iterdir()}
    assert names == {f"{name}{suffix}" for name in FIGURES for suffix in (".png", ".svg")}


def test_step_sizes_that_are_not_the_best_are_told(sweep: Experiment) -> None:
    best = best_steps(sweep)
    assert best["mlp"].alpha == 0.1
    assert best["mlp"].among == [0.05, 0.1, 0.2]
    job = next(j for j in sweep.jobs if j.config.value.kind == "mlp" and j.config.alpha == 0.1)
    assert best["mlp"].score.value == job.evaluations.mean_score[RUNS // 2 :].mean()
    assert step_words(best, "mlp", 0.1)[-1] == ""
    assert step_words(best, "mlp", 0.2)[-1] == "not the best of the sweep"
    edge = {"mlp": replace(best["mlp"], alpha=0.05)}
    assert step_words(edge, "mlp", 0.05)[-1] == "the best is at the sweep's edge"
    with pytest.raises(NoResults, match="has no rbf"):
        step_words(best, "rbf", 0.1)


@pytest.mark.parametrize(
    "change", [{"start_side": "right"}, {"switch_side_after": 0}, {"switch_side_after": 400}]
)
def test_runs_of_another_experiment_are_refused(change: dict[str, Any]) -> None:
    config = extrapolating()
    with pytest.raises(NoResults, match="with env=follow_one_side on the left, and then on the"):
        learner(replace(config, env=replace(config.env, **change)), weight=rules())


def test_runs_that_diverged_count_as_catching_nothing_and_have_no_q(
    sweep: Experiment, measured: Measured
) -> None:
    whole = measured[0][0]
    diverged = np.zeros_like(whole.learner.diverged)
    diverged[1, 3:] = True  # from the switch on
    snapshots = whole.learner.snapshots
    weights = {name: weight.clone() for name, weight in snapshots.weights.items()}
    for weight in weights.values():
        weight[3:, 1] = torch.nan
    some = Learner(whole.learner.config, replace(snapshots, weights=weights), diverged)
    found = Findings.of(some)
    np.testing.assert_allclose(found.moved, np.delete(whole.moved, 1, axis=0), rtol=1e-5)
    np.testing.assert_array_equal(found.caught[1, 1:], 0)
    np.testing.assert_array_equal(found.caught[1, 0], whole.caught[1, 0])
    np.testing.assert_array_equal(np.delete(found.caught - whole.caught, 1, axis=0), 0)
    np.testing.assert_array_equal(found.first_side.kept, np.delete(whole.first_side.kept, 1))
    others = [found, *measured[0][1:]]
    of_constant = np.zeros_like(measured[1][0].diverged)
    of_constant[:2, 1] = True
    constant = [replace(measured[1][0], diverged=of_constant), *measured[1][1:]]
    page = write_page(others, constant, sweep)
    assert "nan" not in page
    assert "Runs that diverged: 3 below, 0 in the sweep." in page
    assert re.search(r"^\| `fnnq` \|.*\| 2 \|$", page, re.MULTILINE)
    with pytest.raises(NoResults, match="fnnq: all its runs diverged"):
        replace(some, diverged=np.ones_like(diverged)).sound()


def test_each_value_function_must_be_there_with_both_kinds_of_decay(
    experiment: Experiment,
) -> None:
    parts = [experiment.where("alpha_decay", decay) for decay in (1.0, 0.99)]
    parts.append(experiment.where("value.kind", "mlp"))
    for part in parts:
        with pytest.raises(NoResults, match="needs fnnq and mlp, and each value function with"):
            measure(part)


def test_results_without_snapshots_are_one_line(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write_results(tmp_path, ["fnnq", "mlp"])
    next(tmp_path.glob("extrapolation/*/0/snapshots.pt")).unlink()
    monkeypatch.setattr("sys.argv", ["extrapolation", "--results", str(tmp_path)])
    with pytest.raises(SystemExit):
        main()
    assert re.search(
        r"snapshots\.pt is missing; training with check", capsys.readouterr().err, re.MULTILINE
    )


def test_a_moment_without_an_evaluation_is_told() -> None:
    arguments: dict[str, Any] = {"weight": rules()}
    with pytest.raises(NoResults, match="fnnq was not evaluated after 7 situations"):
        learner(extrapolating(DOUBLE), **arguments).page(7)
