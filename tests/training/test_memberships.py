"""Labels that a job places before it learns."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.memberships import (
    find_labels,
    gaps_in_words,
    visited_states,
    with_found_labels,
)
from fnnq_torchrl.training.policies import load_policy, load_rules
from tests.programs import config

CLUSTERED = ("value.membership=clustered", "value.warm_up=5", "value.labels_of_input=3")


def found(settings: Config) -> list[list[float]]:
    (job,) = with_found_labels([Job(settings, Path("job"))])
    assert job.config.value.membership == "paper"
    return job.config.value.inputs["bearing"]


@pytest.mark.parametrize("clustering", ["kmeans", "mixture"])
def test_labels_are_found_where_states_are_dense(clustering: str) -> None:
    rng = np.random.default_rng(0)
    places, spread = [-0.7, 0.1, 0.4], 0.02
    states = np.concatenate([rng.normal(place, spread, 400) for place in places])
    labels = find_labels("bearing", rng.permutation(states), 3, clustering)
    assert [numbers[0] for _, numbers in labels] == pytest.approx(places, abs=0.01)
    widths = [numbers[1] for _, numbers in labels]
    # By k-means: the mean distances to the neighbours, 0.8, 0.55 and 0.3, over √(8 ln 2) = 2.3548.
    expected = [0.3397, 0.2336, 0.1274] if clustering == "kmeans" else [0.08, 0.03, 0.03]
    assert widths == pytest.approx(expected, abs=0.012)
    assert find_labels("bearing", states, 1, clustering)[0][1][0] == pytest.approx(-0.07, abs=0.01)


def test_clusters_do_not_depend_on_the_jobs_seed() -> None:
    one, other = (config(*CLUSTERED, f"seed={seed}") for seed in (0, 7))
    assert found(one) == found(other)
    centres = [centre for centre, _ in found(one)]
    assert centres == sorted(centres)
    states = visited_states(one)["bearing"]
    assert -1 <= states.min() <= centres[0] < centres[-1] <= states.max() <= 1


def test_a_job_learns_with_the_labels_that_it_found(tmp_path: Path) -> None:
    first = tmp_path / "first"
    first.mkdir()
    small = config(*CLUSTERED, "situations=5", "num_seeds=2", "engine=eager")
    run_job(small, first)
    labels = [label.parameters for label in load_rules(first).states[0].labels]
    assert labels == [tuple(label) for label in found(small)]
    # The runs of such a job can be the source of visited states, too.
    again = replace(small, value=replace(small.value, visited=str(first)))
    assert found(again) != found(small)
    mixed = replace(small, value=replace(small.value, visited=str(tmp_path)))
    with pytest.raises(OSError, match=r"checkpoint\.pt"):
        found(mixed)


def test_a_damaged_source_of_states_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "checkpoint.pt").write_text("no")
    with pytest.raises(ConfigError, match=r"^value\.visited=.* is damaged, or not a checkpoint"):
        found(config(*CLUSTERED, f"value.visited={tmp_path}"))


def test_more_labels_than_states_are_refused() -> None:
    with pytest.raises(ConfigError, match=r"^value\.labels_of_input=3: must be at most 2, the"):
        find_labels("bearing", np.array([0.0, 1.0, 1.0]), 3, "kmeans")


def test_labels_that_are_not_found_yet_make_no_network() -> None:
    settings = config(*CLUSTERED)
    with pytest.raises(ConfigError, match=r"^value\.membership=clustered: a job finds its labels"):
        make_value_network(settings.value, None, 1)


def test_each_run_has_the_labels_that_it_learned(tmp_path: Path) -> None:
    learned = ("value.learn_memberships=true", "situations=10", "num_seeds=2", "engine=eager")
    run_job(config(*learned), tmp_path)
    states = np.linspace(-1, 1, 7)
    moved = []
    for seed in (0, 1):
        rules, network = load_rules(tmp_path, seed), load_policy(tmp_path, seed).value_network
        bearing = network.candidates.new_tensor(states).view(1, -1, 1)
        values = rules.action_values(bearing[0]).numpy()
        np.testing.assert_allclose(values, network(bearing)[0].numpy(), atol=1e-5)
        moved.append([label.parameters for label in rules.states[0].labels])
    assert moved[0] != moved[1]


def test_gaps_are_told_in_one_line() -> None:
    assert gaps_in_words(config()) is None
    assert gaps_in_words(config("value=mlp")) is None
    triangles = "value.inputs.bearing=[{triangle: [-2, -0.5, 0]}, {triangle: [0.1, 0.5, 1]}]"
    told = gaps_in_words(config(triangles))
    assert told is not None
    assert re.fullmatch(
        r"no label fires at bearing 0\S* to 0\.1, bearing 1: there the nearest label fires "
        r"\(value\.elsewhere\)",
        told,
    )
    assert "the value is 0" in (gaps_in_words(config(triangles, "value.elsewhere=zero")) or "")


def test_even_labels_take_no_labels_of_a_task() -> None:
    value = config("value.membership=even", "value.inputs=null", "value.action=null").value
    assert [centre for centre, _ in value.inputs["bearing"]] == pytest.approx([-1, -0.5, 0, 0.5, 1])
    assert value.action == value.inputs["bearing"]
    assert len(config("value.membership=even", "value.labels_of_action=3").value.action) == 3
