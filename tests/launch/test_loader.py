"""Hydra's loader of files that are read and merged once: it composes what Hydra's own does."""

import json
from dataclasses import asdict, replace
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir
from omegaconf import DictConfig, OmegaConf

from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.launch.composition import VERSION_BASE, load_config, started_hydra


def composed(*overrides: str) -> DictConfig:
    with started_hydra():
        return compose("config", [*overrides], return_hydra_config=True)


@pytest.mark.parametrize(
    "overrides",
    [("lam=1",), ("task=chain", "value=table", "gamma=0.5"), ("+experiment=fig2",)],
    ids=" ".join,
)
def test_it_composes_what_hydra_does_and_changes_to_it_are_its_own(
    overrides: tuple[str, ...],
) -> None:
    with initialize_config_dir(str(config_directory()), "train", VERSION_BASE):
        expected = compose("config", [*overrides], return_hydra_config=True)
    for _ in range(2):
        found = composed("hydra.job.name=train", *overrides)
        found.hydra.overrides.hydra.remove("hydra.job.name=train")
        assert OmegaConf.to_container(found) == OmegaConf.to_container(expected)
        assert found._get_flag("struct")
        found.lam, found.hydra.job.name, found.env.kind = 0.123, "another", "nowhere"


def test_changes_to_a_configuration_reach_no_other_of_the_same_files() -> None:
    for value in ("fnnq", "table", "rbf"):
        sweep = composed("+experiment=decay", f"value={value}").hydra.sweeper.params
        assert sweep.alpha == "0.1,0.2,0.4,0.8"
        sweep.alpha = "7"


def test_a_file_that_changes_is_read_again(tmp_path: Path) -> None:
    preset = tmp_path / "experiment" / "mine.yaml"
    preset.parent.mkdir()
    words = (f"hydra.searchpath=[{tmp_path.as_uri()}]", "+experiment=mine")
    for lam in (0.5, 0.6):
        preset.write_text(f"# @package _global_\nlam: {lam}\n")
        assert [load_config(*words).lam, load_config(*words).lam] == [lam, lam]
    assert load_config().lam == 0.2


def test_what_is_put_into_hydras_store_is_not_kept(tmp_path: Path) -> None:
    job = load_config()
    for lam in (0.5, 0.6):
        path = tmp_path / f"{lam}" / ".hydra" / "config.yaml"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(asdict(replace(job, lam=lam))))
        assert load_config(f"from={tmp_path / str(lam)}").lam == lam
