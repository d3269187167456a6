"""The page's second part: the claims about Q(λ) in general, from invented results."""

import re
from math import log2
from pathlib import Path

import numpy as np
import pytest
import torch

from envs.classic.chain import right_action
from envs.classic.schemas import ChainConfig
from fnnq_torchrl.studies.chain import exact_values, not_learned, steps_to_learn, value_error
from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.reproduction.claims import Expected
from fnnq_torchrl.studies.reproduction.command import main
from fnnq_torchrl.studies.reproduction.general import (
    GENERAL_EXPERIMENTS,
    GENERAL_FIGURES,
    HEADING,
    with_general,
    write_general,
)
from fnnq_torchrl.studies.reproduction.general_claims import GENERAL_CLAIMS
from fnnq_torchrl.studies.reproduction.general_details import expected_growth
from fnnq_torchrl.studies.reproduction.quantities import SCORE, STEPS
from fnnq_torchrl.studies.reproduction.sides import Best, Change, One
from fnnq_torchrl.studies.reproduction.verdicts import Verdict, verdict
from fnnq_torchrl.studies.statistics import Interval
from tests.small_world_files import RUNS


@pytest.fixture(scope="module")
def general(experiments: dict[str, Experiment]) -> dict[str, Experiment]:
    return {name: experiments[name] for name in GENERAL_EXPERIMENTS}


@pytest.fixture(scope="module")
def part(general: dict[str, Experiment]) -> str:
    return write_general(general)


def test_the_values_of_the_chain_solve_bellmans_equations() -> None:
    world = ChainConfig("chain", 100, length=4, choices=3, setback=2, goal_reward=2.0)
    values, gamma = exact_values(world, 0.9), 0.9
    best = [*values.max(axis=1), 0.0]
    for place in range(1, 5):
        right = int(right_action(torch.tensor(float(place)), 3))
        for action in range(3):
            after = place + 1 if action == right else max(place - 2, 1)
            reward = 2.0 if after == 5 else 0.0
            assert values[place - 1, action] == pytest.approx(reward + gamma * best[after - 1])


def test_the_steps_to_learn_end_with_the_last_wrong_action(general: dict[str, Experiment]) -> None:
    """Run i has 2 + i wrong situations, each of n + n² steps without traces."""
    job = general["chain"].job_with({"env.length": 5, "lam": 0, "trace": "gradient"})
    np.testing.assert_array_equal(steps_to_learn(job), (2 + np.arange(RUNS)) * 30)
    assert not_learned(job) == 0


def test_the_error_of_the_values_is_theirs(general: dict[str, Experiment]) -> None:
    values = general["sensitivity_values"]
    job = values.job(variant="peng", lam=0.5, epsilon=0.6)
    np.testing.assert_allclose(value_error(job), 0.3, rtol=1e-6)
    assert not value_error(values.job(variant="watkins", lam=0.5, epsilon=0.6)).any()


def test_a_side_is_a_job_a_change_or_the_best_of_several(general: dict[str, Experiment]) -> None:
    chain, where = general["chain"], {"trace": "gradient", "env.length": 5}
    one = One({"lam": 0}).measured(chain, where, STEPS)
    assert one.words == "λ = 0"
    np.testing.assert_allclose(one.runs, np.log2((2 + np.arange(RUNS)) * 30))
    change = Change({"env.length": 5}, "lam", 0, 0.2)
    change_of = change.measured(chain, {"trace": "gradient"}, STEPS)
    assert change_of.words == "states = 5, from λ = 0 to λ = 0.2"
    np.testing.assert_allclose(change_of.runs, log2(15 / 30))
    explored = general["best_exploration"]
    best = Best({"exploration": "boltzmann"}, "temperature").measured(explored, {}, SCORE)
    assert best.runs.size == RUNS // 2
    scores = {
        job.settings["temperature"]: SCORE.of(job)
        for job in explored.where("exploration", "boltzmann").jobs
    }
    chosen = max(scores, key=lambda key: scores[key][: RUNS // 2].mean())
    assert best.words == f"Boltzmann at its best, temperature = {chosen:g}"
    np.testing.assert_array_equal(best.runs, scores[chosen][RUNS // 2 :])
    with pytest.raises(NoResults, match="has no jobs with additive noise"):
        Best({"exploration": "noise"}, "noise_std").measured(explored, {}, SCORE)


def test_a_small_difference_is_one_in_the_quantitys_own_unit() -> None:
    assert verdict(0.02, 0.05, Expected.MORE, 0.01) is Verdict.HOLDS
    assert verdict(0.002, 0.05, Expected.MORE, 0.01) is Verdict.BARELY
    assert Verdict.BARELY.words("0.01") == "holds, perhaps by less than 0.01"
    assert STEPS.show_difference(Interval(-1.0, -2.0, 0.0)) == "× 0.5 [0.25, 1]"


@pytest.mark.parametrize(("steps", "grows"), [(1, True), (2, True), (3, False)])
def test_the_weight_grows_in_short_episodes_only(steps: int, grows: bool) -> None:
    """By hand: a small α multiplies it by 1 + α(0.225 − 0.05(2·steps − 1))/2 in an episode."""
    growth = expected_growth(1e-6, 0.95, steps) / 1e-6
    assert growth == pytest.approx((0.225 - 0.05 * (2 * steps - 1)) / 2, rel=1e-3)
    assert (growth > 0) == grows


def test_the_part_has_every_claim_and_what_the_results_say(part: str) -> None:
    for claim in GENERAL_CLAIMS:
        assert part.count(f"«{claim.words}»") == 2
    verdicts = re.findall(r"\*\*Over all seeds: (.*)\.\*\*", part)
    assert len(verdicts) == 4
    assert verdicts[2:] == ["holds", "holds"]
    assert "| states = 5, " not in part
    # Traces save (n + 2n) of (n + n²) steps: × 3/41 with n = 40, and × 1/2 with n = 5.
    assert "| × 0.0732 [0.0732, 0.0732] | × 0.5 [0.5, 0.5] | × 0.146 [0.146, 0.146] |" in part
    assert "| one Gaussian, λ = 0 | 100 % [100, 100] | 0 % [0, 0] |" in part
    assert set(re.findall(r"\(figures/(.*)\.png\)", part)) == GENERAL_FIGURES.keys()
    for table in re.findall(r"(?:^\|.*\n)+", part, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert not re.search(r"nan|{|†", part)


def test_the_part_replaces_its_predecessor() -> None:
    page = f"# First\n\nwords\n\n{HEADING}\n\nold\n"
    new = f"{HEADING}\n\nnew\n"
    assert with_general(page, new) == f"# First\n\nwords\n\n{new}"
    assert with_general("# First\n\nwords\n", new) == f"# First\n\nwords\n\n{new}"


def test_the_command_writes_the_part_alone(
    experiments: dict[str, Experiment],
    tmp_path: Path,
    part: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    drawn: list[str] = []
    command = "fnnq_torchrl.studies.reproduction.command"
    monkeypatch.setattr(f"{command}.newest_experiment", lambda root, name: experiments[name])
    monkeypatch.setattr(f"{command}.draw", lambda figures, to: drawn.extend(figures))
    words = ["reproduction", "--general", "--to", str(tmp_path)]
    monkeypatch.setattr("sys.argv", words)
    with pytest.raises(SystemExit):
        main()
    assert re.search(r"No such file .*reproduction\.md", capsys.readouterr().err, re.MULTILINE)
    (tmp_path / "reproduction.md").write_text("# First\n")
    main()
    assert (tmp_path / "reproduction.md").read_text() == f"# First\n\n{part}"
    assert drawn == [*GENERAL_FIGURES]
