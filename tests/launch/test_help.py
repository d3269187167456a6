"""The help page."""

from dataclasses import asdict

import pytest
import yaml

from fnnq_torchrl.config.checking import flat
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.launch.help import help_page

OF_GROUPS = ("step_size", "alpha_decay", "adaptive")
"""Keys that only files of groups set; the page shows those groups."""


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("COLUMNS", "80")
    return help_page()


def test_every_key_of_the_learner_and_the_runs_is_there_with_its_default(page: str) -> None:
    config = flat(asdict(load_config()))
    shown = {
        key: value
        for line in page.splitlines()
        if line.startswith("  ") and "=" in (word := line.split()[0])
        for key, value in [word.split("=")]
        if key in config and value
    }
    keys = [key for key in config if "." not in key and key not in OF_GROUPS]
    assert shown.keys() == {*keys, "checkpoint.every_s", "checkpoint.snapshots", "logger.video"}
    for key, value in shown.items():
        assert config[key] == yaml.safe_load(value), key


@pytest.mark.parametrize(
    "words",
    [
        "λ in [0, 1]; a step decays the trace by γλ.",  # after the key
        "boltzmann: a candidate with",  # above the key
        "seconds from one save to the next",
        "value=                     fnnq, fnnq_sum, fuzzy_q, mlp, rbf, table,",
        "+experiment=               adaptive, best_exploration",
    ],
)
def test_meaning_and_choices(page: str, words: str) -> None:
    assert words in page


def test_as_wide_as_the_terminal(page: str) -> None:
    keys = page[page.index("Keys: ") : page.index("Flags")]
    assert max(map(len, keys.splitlines())) <= 80


def test_nothing_is_swept_by_a_preset_that_isnt_an_experiment(page: str) -> None:
    assert "_paper" not in page
