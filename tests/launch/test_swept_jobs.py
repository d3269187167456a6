"""Jobs composed together equal those that Hydra composes one by one."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from hydra.core.config_loader import ConfigLoader
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.utils import setup_globals
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, open_dict, read_write

from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.schema import PER_RUN, ConfigError
from fnnq_torchrl.launch import command as cli  # noqa: F401  # registers what conf/config.yaml refers to
from fnnq_torchrl.launch.composition import started_hydra
from fnnq_torchrl.launch.swept_jobs import SweptJob, compose_jobs
from fnnq_torchrl.training.jobs import RESULTS


class Hydra:
    """The part of a multirun before the launcher begins."""

    def __init__(self, directory: Path) -> None:
        hydra = GlobalHydra.instance().hydra
        assert hydra is not None
        self.loader: ConfigLoader = hydra.config_loader
        self.directory = directory
        self.master = hydra.compose_config(
            config_name="config",
            overrides=[f"hydra.sweep.dir={directory}"],
            run_mode=RunMode.MULTIRUN,
            from_shell=False,
        )
        setup_globals()
        HydraConfig.instance().set_config(self.master)

    def jobs(self, *job_overrides: str, first: int = 0) -> list[SweptJob]:
        return compose_jobs(self.loader, self.master, [o.split() for o in job_overrides], first, {})

    def composed(self, number: int, overrides: str) -> DictConfig:
        """Return one job as Hydra's own launcher composes it."""
        node = self.loader.load_sweep_config(self.master, overrides.split())
        with read_write(node.hydra), open_dict(node.hydra.job):
            node.hydra.job.id = node.hydra.job.num = number
        with read_write(node.hydra):
            node.hydra.runtime.output_dir = str(self.directory / str(number))
        return node


@pytest.fixture
def hydra(tmp_path: Path) -> Iterator[Hydra]:
    with started_hydra():
        yield Hydra(tmp_path / "sweep")


SWEEP = [
    "lam=0 seed=3",
    "lam=0.4 seed=4",
    "seed=5",
    "lam=1e-3 alpha=.5 epsilon=1 alpha_decay=0.9 gamma=0 num_seeds=12",
    "trace=gradient lam=0.5",
    "alpha=${lam} lam=0.1",
    "alpha=${lam} lam=0.3",
    "++lam=0.7 seed=1",
    "seed=1 seed=2",
]


def test_they_are_what_hydra_composes(hydra: Hydra) -> None:
    for job, overrides in zip(hydra.jobs(*SWEEP, first=7), SWEEP, strict=True):
        theirs = hydra.composed(job.number, overrides)
        task = OmegaConf.masked_copy(theirs, [key for key in theirs if key != "hydra"])
        hydra_node = OmegaConf.masked_copy(theirs, "hydra")
        assert job.config == to_config(task)
        node = job.node()
        with read_write(node.hydra):  # as `run_job` does
            node.hydra.runtime.output_dir = str(job.directory)
        assert OmegaConf.to_yaml(node) == OmegaConf.to_yaml(theirs)
        assert job.directory == hydra.directory / str(job.number)

        job.write_configuration()
        folder = job.directory / ".hydra"
        assert (folder / "config.yaml").read_text() == OmegaConf.to_yaml(task)
        assert (folder / "hydra.yaml").read_text() == OmegaConf.to_yaml(hydra_node)
        assert (folder / "overrides.yaml").read_text() == OmegaConf.to_yaml(
            theirs.hydra.overrides.task
        )
        assert {path.name for path in folder.iterdir()} == {
            "config.yaml",
            "hydra.yaml",
            "overrides.yaml",
        }


def test_hydra_composes_once_for_jobs_that_differ_in_numbers(
    hydra: Hydra, monkeypatch: pytest.MonkeyPatch
) -> None:
    composed = []
    load = hydra.loader.load_sweep_config

    def counted(master: DictConfig, overrides: list[str]) -> DictConfig:
        composed.append(overrides)
        return load(master, overrides)

    monkeypatch.setattr(hydra.loader, "load_sweep_config", counted)
    hydra.jobs(*[f"lam={lam} seed={seed}" for lam in (0, 0.4) for seed in range(50)])
    assert composed == [["lam=0", "seed=0"]]
    composed.clear()
    from_one = ["kappa", "adaptive_period", "adaptive_short", "adaptive_long"]
    numbers = [key for key in PER_RUN[1:] if key not in from_one]
    hydra.jobs(
        *(
            " ".join(
                [
                    *(f"{key}={value}" for key in numbers),
                    *(f"{key}={4 * value}" for key in from_one),
                    f"seed={seed}",
                ]
            )
            for seed, value in enumerate((0.5, 0.75))
        )
    )
    assert len(composed) == 1


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        (["hydra.sweep.subdir=lam${lam}_${seed}"], ["lam0.0_3", "lam0.4_4"]),
        (
            ["hydra.sweep.subdir=${hydra.job.override_dirname}"],
            ["lam=0,seed=3", "lam=0.4,seed=4"],
        ),
        (
            [
                "hydra.sweep.subdir=x${hydra.job.num}_${hydra.job.override_dirname}",
                "hydra.job.config.override_dirname.kv_sep=",
                "hydra.job.config.override_dirname.exclude_keys=[seed]",
            ],
            ["x0_lam0", "x1_lam0.4"],
        ),
    ],
)
def test_directories_may_be_named_after_the_job(
    hydra: Hydra, settings: list[str], names: list[str]
) -> None:
    with read_write(hydra.master.hydra):
        hydra.master.hydra.overrides.hydra.extend(settings)
    jobs = hydra.jobs(*SWEEP[:2])
    assert [job.directory.name for job in jobs] == names
    for job, overrides in zip(jobs, SWEEP[:2], strict=True):
        theirs = hydra.composed(job.number, overrides).hydra.job.override_dirname
        assert job.node().hydra.job.override_dirname == theirs


@pytest.mark.parametrize(
    ("bad", "line"),
    [
        ("lam=1.5", "lam=1.5: must be a number in [0, 1]"),
        ("seed=1.5", "seed=1.5: must be a whole number >= 0"),
        (f"seed={2**63}", f"seed={2**63}: must be at most 2**63 - 1"),
        ("lamm=1", "lamm=1: there is no lamm; did you mean lam?"),
        ("situations=7", "situations=7: must be a whole multiple of evaluation.every=5"),
    ],
)
def test_a_bad_job_says_which_it_is(hydra: Hydra, bad: str, line: str) -> None:
    with pytest.raises(ConfigError) as refused:
        hydra.jobs("seed=1", f"gamma=0.5 {bad}", "seed=2", first=3)
    assert str(refused.value).startswith(f"job 4 (gamma=0.5 {bad}): {line}")


def finish(job: SweptJob) -> None:
    for name in RESULTS:
        assert not job.is_finished()
        (job.directory / name).touch()


def test_a_saved_configuration_may_be_written_otherwise(hydra: Hydra) -> None:
    (job,) = hydra.jobs("lam=0.4")
    assert not job.is_finished()
    job.write_configuration()
    assert not job.is_finished()
    finish(job)
    assert job.is_finished()
    saved = job.directory / ".hydra" / "config.yaml"
    saved.write_text("# by hand\n" + saved.read_text().replace("lam: 0.4", "lam: 4.0e-1"))
    assert job.is_finished()
    saved.write_text(saved.read_text().replace("speed_mps: 0.3", "speed_mps: 0.4"))
    with pytest.raises(ConfigError, match=r"env\.speed_mps=0\.4, not env\.speed_mps=0\.3; name"):
        job.is_finished()


def test_a_saved_configuration_may_be_saved_otherwise(hydra: Hydra) -> None:
    (job,) = hydra.jobs("lam=0.4")
    job.write_configuration()
    (again,) = hydra.jobs("lam=0.4 resume=never checkpoint.every_s=7")
    assert not again.is_finished()
    finish(job)
    assert again.is_finished()


def test_a_job_without_the_snapshots_that_it_is_to_leave_isnt_finished(hydra: Hydra) -> None:
    (job,) = hydra.jobs("lam=0.4")
    job.write_configuration()
    finish(job)
    (again,) = hydra.jobs("lam=0.4 checkpoint.snapshots=true")
    assert job.is_finished()
    assert not again.is_finished()
    (job.directory / "snapshots.pt").touch()
    assert again.is_finished()


@pytest.mark.parametrize("left", ["", "\0\0\0", "lam: [0", "lam"])
def test_a_configuration_that_a_crash_has_left_is_none(hydra: Hydra, left: str) -> None:
    (job,) = hydra.jobs("lam=0.4")
    job.write_configuration()
    finish(job)
    (job.directory / ".hydra" / "config.yaml").write_text(left)
    assert not job.is_finished()
