"""A run's identity: its configuration without the seed, and its seed."""

import pytest

from fnnq_torchrl.config.identity import JobRuns, RunsSoFar
from fnnq_torchrl.config.schema import PER_RUN
from tests.compositions import config_of

FROM_ONE = ("seed", "kappa", "adaptive_period", "adaptive_short", "adaptive_long")
"""Keys whose values must be at least 1, and the seed."""

BASE = JobRuns.of(config_of("num_seeds=3"))


@pytest.mark.parametrize(
    "override",
    ["seed=7", "num_seeds=9", "resume=never", "checkpoint.snapshots=true", "logger=tensorboard"],
)
def test_the_same_configuration(override: str) -> None:
    assert JobRuns.of(config_of(override)).configuration == BASE.configuration


@pytest.mark.parametrize(
    "override",
    [
        *(f"{key}=0.12" for key in PER_RUN if key not in FROM_ONE),
        *(f"{key}=3" for key in FROM_ONE if key != "seed"),
        *("trace=gradient", "situations=100", "env.speed_mps=0.2"),
    ],
)
def test_another_configuration(override: str) -> None:
    assert JobRuns.of(config_of(override)).configuration != BASE.configuration


def test_runs_are_new_once_per_configuration() -> None:
    so_far = RunsSoFar()
    assert so_far.add(JobRuns("a", range(3))) == [0, 1, 2]
    assert so_far.add(JobRuns("a", range(1, 4))) == [3]
    assert so_far.add(JobRuns("b", range(1, 4))) == [1, 2, 3]
    assert so_far.add(JobRuns("a", range(2))) == []
