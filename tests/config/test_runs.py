"""The columns of a batch's runs."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fnnq_torchrl.config.runs import Runs
from fnnq_torchrl.config.schema import PER_RUN, Config
from tests.programs import config

CONFIG = config()
CONFIGS = st.builds(
    lambda lam, seed, num_seeds: replace(CONFIG, lam=lam, seed=seed, num_seeds=num_seeds),
    lam=st.floats(0, 1),
    seed=st.integers(0, 2**62),
    num_seeds=st.integers(1, 5),
)


@given(configs=st.lists(CONFIGS, min_size=1, max_size=5))
def test_a_batch_has_the_runs_of_all_its_jobs(configs: list[Config]) -> None:
    runs = Runs.of(configs)
    assert set(runs.columns) == set(PER_RUN)
    for key, column in runs.columns.items():
        of_each = [
            each.seed + run if key == "seed" else each.of_run(key)
            for each in configs
            for run in range(each.num_seeds)
        ]
        assert column.tolist() == of_each
        assert len(column) == len(runs)


def test_the_last_seeds_can_be_in_a_batch_too() -> None:
    configs = [replace(CONFIG, seed=2**63 - 1), replace(CONFIG, seed=0)]
    assert Runs.of(configs)["seed"].tolist() == [2**63 - 1, 0]


@given(configs=st.lists(CONFIGS, min_size=2, max_size=4), data=st.data())
def test_runs_are_found_among_others(configs: list[Config], data: st.DataObject) -> None:
    """Each run is found once, even if two runs are equal."""
    all_runs = Runs.of(configs)
    some = data.draw(st.permutations(configs))[: data.draw(st.integers(1, len(configs)))]
    runs = Runs.of(some)
    rows = runs.rows_among(all_runs.bits)
    assert rows is not None
    assert np.array_equal(all_runs.bits[rows], runs.bits)
    assert len(set(rows.tolist())) == len(rows)
    if len(runs) < len(all_runs):
        assert all_runs.rows_among(runs.bits) is None
