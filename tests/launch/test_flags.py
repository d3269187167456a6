"""Flags and overrides in any order."""

from itertools import chain, permutations

import pytest

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.flags import hydra_arguments


@pytest.mark.parametrize(
    "flag",
    [["-m"], ["--cfg", "job"], ["-c", "job"], ["--cfg=job"], ["--config-dir", "my"]],
    ids=str,
)
def test_a_flag_may_stand_anywhere(flag: list[str]) -> None:
    alone = vars(hydra_arguments(flag))
    for order in permutations([flag, ["lam=0.2"], ["+experiment=fig2"], ["--seed=3"]]):
        given = vars(hydra_arguments([*chain.from_iterable(order)]))
        typed = [word.removeprefix("--") for words in order if words != flag for word in words]
        assert given == alone | {"overrides": typed, "parser": given["parser"]}


@pytest.mark.parametrize("override", ["lam=0.2", "value=mlp", "env.speed_mps=1", "hydra.mode=RUN"])
def test_two_dashes_before_a_key_are_taken_off(override: str) -> None:
    assert hydra_arguments([f"--{override}"]).overrides == [override]


def test_flags_of_hydra_stay_flags() -> None:
    given = hydra_arguments(["--config-dir=my", "--package=env", "--cfg=job"])
    assert (given.config_dir, given.package, given.cfg) == ("my", "env", "job")
    assert given.overrides == []


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--lam", "0.2"], "--lam: there is no such flag; keys are typed as in lam=0.2, and "),
        (["lam=0.2", "-x"], "-x: there is no such flag; "),
        (["--cfg", "nope"], "argument --cfg/-c: invalid choice: "),
        (["lam=0.2", "--config-dir"], "argument --config-dir/-cd: expected one argument"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, list) else "",
)
def test_a_flag_that_cant_be_read_is_one_line(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        hydra_arguments(arguments)
    line = capsys.readouterr().err
    assert (ended.value.code, line.count("\n")) == (2, 1)
    assert line.startswith(told)


def test_flags_that_exclude_each_other() -> None:
    with pytest.raises(ConfigError, match=r"^--multirun and --cfg exclude each other$"):
        hydra_arguments(["lam=0.1,0.2", "-m", "--cfg", "job"])
