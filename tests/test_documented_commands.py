"""Every command of the README and the other pages can be typed, or its page says what it needs."""

import re
import shlex
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from fnnq_torchrl.launch.launcher import Multirun
from fnnq_torchrl.training import job as job_module
from tests.commands import fnnq_train

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/*.md"))]
PROGRAMS = ("python", "fnnq-train", "make", "pip", "wandb", "mlflow", "tensorboard")

NEEDS = {
    "wandb": "extra `wandb`",
    "mlflow": "`pip install mlflow`",
    "tensorboard": "extra `tensorboard`",
    "apt-get": "Debian",
    "cat": "Debian",
    "mkdir": "Debian",
    "su": "Debian",
}
"""Programs that aren't installed with this package, and the words by which a page says so."""


class Command(NamedTuple):
    """A command of a page, and the line below it if the page shows its output."""

    page: str
    words: tuple[str, ...]
    output: str


def commands(page: Path) -> Iterator[Command]:
    text = page.read_text(encoding="utf-8")
    name = str(page.relative_to(ROOT))
    for language, block in re.findall(r"^```(\w*)\n(.*?)^```", text, re.M | re.S):
        if language not in ("", "bash", "console"):
            continue
        block = re.sub(r"<<END\n.*?^END$", "", block, flags=re.M | re.S)  # a file's content
        lines = block.replace("\\\n", " ").splitlines()
        shown = any(line.startswith("$ ") for line in lines)
        for line, below in zip(lines, [*lines[1:], ""], strict=True):
            if shown and not line.startswith("$ "):
                continue
            if line.startswith("$ ") or line.partition(" ")[0] in (*PROGRAMS, *NEEDS):
                words = shlex.split(line.removeprefix("$ "), comments=True)
                yield Command(name, tuple(words), below if shown else "")
    spans = re.findall(r"`([^`\n]+)`", re.sub(r"^```.*?^```", "", text, flags=re.M | re.S))
    for span in spans:
        if span.startswith(tuple(f"{program} " for program in PROGRAMS)):
            yield Command(name, tuple(shlex.split(span)), "")


ALL = list(dict.fromkeys(command for page in PAGES for command in commands(page)))
TRAIN = [each for each in ALL if "fnnq_torchrl.train" in each.words or "fnnq-train" in each.words]
OTHERS = [each for each in ALL if each not in TRAIN]


def ids(command: Command) -> str:
    return f"{command.page}: {' '.join(command.words)}"


def test_the_pages_have_commands() -> None:
    assert len(TRAIN) > 15
    assert len(OTHERS) > 30


@pytest.mark.parametrize("command", TRAIN, ids=ids)
def test_a_training_can_be_started(
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(job_module, "run_job", lambda config, directory: 1.0)
    monkeypatch.setattr(
        job_module, "run_batches", lambda batches, **others: ([1.0] * len(b) for b in batches)
    )
    monkeypatch.setattr(Multirun, "_write_whole", lambda self, first: None)
    program = next(word for word in command.words if word in ("fnnq_torchrl.train", "fnnq-train"))
    words = command.words[command.words.index(program) + 1 :]
    arguments = [word for word in words if "=" in word or word in ("-m", "--config-dir")]
    if "--config-dir" in arguments:  # a directory that the reader makes from the page's YAML
        page = (ROOT / command.page).read_text(encoding="utf-8")
        assert page.count("my_conf") > 1
        return
    if "hydra/sweeper=optuna" in arguments:
        pytest.importorskip("optuna", minversion="5")
        arguments.append("hydra.sweeper.n_trials=2")
    if "hydra.launcher.cluster=slurm" in arguments:
        arguments.append("hydra.launcher.cluster=none")
    status = fnnq_train(*arguments)
    told = capsys.readouterr().err
    if "there is no such file" in told or "No module named" in told:  # a file of the reader's
        own = [word.partition("=")[2].partition(":")[0] for word in arguments]
        assert any(name and name in told for name in own), told
        assert status == 2
        return
    if status == 2:
        assert told == f"{command.output}\n"
    assert status in ([0, 2] if command.output else [0]), told


@pytest.mark.parametrize("command", OTHERS, ids=ids)
def test_another_command_is_known(
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    program, *arguments = command.words
    page = (ROOT / command.page).read_text(encoding="utf-8")
    if program == "make":
        targets = re.findall(r"^([a-z0-9-]+):.*## ", (ROOT / "Makefile").read_text(), re.M)
        assert arguments[0] in targets
    elif program == "pip":
        if "mlflow" in arguments or arguments[0] != "install":
            return  # another package
        project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        assert "-e" in arguments, "this package is in no index"
        for extra in re.findall(r"\[(.*?)\]", " ".join(arguments)):
            assert {*extra.split(",")} <= {*project["optional-dependencies"]}
    elif program in NEEDS:
        assert NEEDS[program] in page
    elif arguments[1].startswith("benchmarks."):
        assert (ROOT / f"{arguments[1].replace('.', '/')}.py").is_file()
    else:
        assert (program, arguments[0]) == ("python", "-m")
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [arguments[1], *arguments[2:]])
        with pytest.raises(SystemExit) as end:
            __import__(arguments[1], fromlist=["main"]).main()
        told = f"{capsys.readouterr().err}{end.value.code}"
        # The arguments are understood; only the results are missing here.
        assert any(
            words in told
            for words in (
                "there is no such directory",
                "No such file",
                "has no finished results",
                "run=… is missing",
            )
        ), told
