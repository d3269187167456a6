"""Prior knowledge: start values of the runs, frozen rules, and the command's messages."""

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl import RuleBase, load_rules, rules
from fnnq_torchrl.agent.rules import Label, Variable, partition, sentences
from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.studies.prior.operator import demonstrate
from fnnq_torchrl.training.firing import FIRING, read_firing
from fnnq_torchrl.training.job import run_job
from fnnq_torchrl.training.jobs import TRAINING
from fnnq_torchrl.training.results import read_evaluations
from fnnq_torchrl.training.start import imported, read_start
from fnnq_torchrl.training.trainer import Trainer
from tests.commands import fnnq_train
from tests.compositions import config_of
from tests.programs import SMALL_WORLD, config, saved_training

FEW = ("situations=5", "num_seeds=3")
SENTENCES = """
if bearing is left and steer is hard_left then value is 0.25
if bearing is far_right and steer is right then value is -0.125
"""
QUIET = ("hydra/job_logging=none", "hydra/hydra_logging=none", "engine=eager")


@pytest.fixture
def prior(tmp_path: Path) -> Path:
    path = tmp_path / "prior.txt"
    path.write_text(SENTENCES)
    return path


@pytest.mark.parametrize("engine", ["eager", "compiled"])
def test_runs_start_from_the_file_and_frozen_rules_stay(
    prior: Path, engine: str, request: pytest.FixtureRequest
) -> None:
    if engine == "compiled":
        request.getfixturevalue("compiler")
    keys = ("rules.frozen=[left/hard_left,ahead]", "rules.count_firing=true", f"engine={engine}")
    trainer = Trainer.of(config(*FEW, f"rules.prior={prior}", *keys))
    trainer.learn()
    pages = trainer.ledger.book.pages["weights", "weight"]
    expected = torch.zeros(5, 4)
    expected[3, 0], expected[0, 2] = 0.25, -0.125
    assert torch.equal(pages[0], expected.expand(3, 5, 4))
    stay = torch.zeros(5, 4, dtype=torch.bool)
    stay[3, 0] = stay[2] = True
    assert torch.equal(pages[-1][:, stay], pages[0][:, stay])
    assert (pages[-1] != pages[0])[:, ~stay].all()
    # The firing strengths of a step sum to 1.
    steps = trainer.ledger.book.pages["steps"][-1]
    assert trainer.ledger.fired is not None
    torch.testing.assert_close(trainer.ledger.fired.sum((1, 2)), steps.float())


def test_nothing_known_is_nothing_changed() -> None:
    assert read_start(config_of()) is None
    assert read_start(replace(config_of(), rules=None)) is None
    learned = []
    for keys in ((), ("rules.frozen=[]", "rules.count_firing=true")):
        trainer = Trainer.of(config(*FEW, "engine=eager", *keys))
        trainer.learn()
        learned.append(trainer.weights["weight"])
    assert torch.equal(*learned)


def test_a_finished_job_is_gone_on_from(tmp_path: Path) -> None:
    job = config(*FEW, "engine=eager", "rules.count_firing=true")
    run_job(job, tmp_path)
    start = read_start(config(f"rules.prior={tmp_path}"))
    assert start is not None
    assert torch.equal(start.consequents, load_rules(tmp_path).consequents)
    fired = read_firing(tmp_path / FIRING, [3, 5, 4])
    steps = read_evaluations(tmp_path / "evaluations.csv").steps[:, -1]
    np.testing.assert_allclose(fired.sum((1, 2)), steps, rtol=1e-5)
    with pytest.raises(ValueError, match="is not a file of the firing strengths"):
        read_firing(tmp_path / FIRING, [4, 5, 4])


def test_what_a_run_recorded_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run_job(config(*FEW, "engine=eager"), tmp_path)
    path = tmp_path / "record.csv"
    monkeypatch.setattr(sys, "argv", ["rules", f"run={tmp_path}", "seed=1", f"record={path}"])
    rules.main()
    start = read_start(config(f"rules.demonstrations={path}"))
    assert start is not None
    followed = replace(load_rules(tmp_path), consequents=start.consequents)
    rows = [*csv.DictReader(path.read_text().splitlines())]
    states = torch.tensor([[float(row["bearing"])] for row in rows], dtype=torch.float64)
    actions = torch.tensor([float(row["steer"]) for row in rows], dtype=torch.float64)
    same = (followed.greedy(states) - actions).abs() < 1e-6
    assert float(same.double().mean()) >= 0.95
    # As with rules of actions, the best action of each state has the margin as its value.
    torch.testing.assert_close(start.consequents.amax(-1), torch.full((5,), 0.5).double())
    assert f"of {len(rows):,} steps" in start.told


def test_the_shipped_operator_is_the_studys() -> None:
    rows = np.loadtxt(config_directory() / "rules" / "operator.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(demonstrate(config_of().env), rows, atol=2e-3)


def test_a_changed_prior_is_another_training(prior: Path, tmp_path: Path) -> None:
    job = config(*FEW, "engine=eager", f"rules.prior={prior}")
    saved_training(tmp_path, job).save(Trainer.of(job).ledger, [])
    again = saved_training(tmp_path, job)
    again.read()
    assert again.restore(Trainer.of(job).ledger)
    prior.write_text(SENTENCES.replace("0.25", "0.26"))
    with pytest.raises(ConfigError, match="was saved with another configuration"):
        saved_training(tmp_path, job).read()


def test_a_saved_count_goes_on(tmp_path: Path) -> None:
    job = config(*FEW, "engine=eager", "rules.count_firing=true")
    trainer = Trainer.of(job)
    trainer.learn()
    saved_training(tmp_path, job).save(trainer.ledger, [])
    saved, ledger = saved_training(tmp_path, job), Trainer.of(job).ledger
    saved.read()
    assert saved.restore(ledger)
    assert trainer.ledger.fired is not None
    assert ledger.fired is not None
    assert torch.equal(ledger.fired, trainer.ledger.fired)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (("rules.prior=rogh.txt",), "no such file; shipped files: hopeful.txt, operator.csv"),
        (("rules.prior=.",), "has no checkpoint.pt"),
        (("rules.prior=bad.txt",), "bad.txt:2:35: 'hard_lft': no such label of steer; did you"),
        (("rules.prior=rules.csv",), "can't be read by its ending"),
        (("rules.demonstrations=rules.csv",), "rules.csv:2:1: steer 'left': expected a finite"),
        (("rules.frozen=[left/upwards]",), "a rule such as far_right/hard_left, with one of hard_"),
        (("rules.frozen=[lft]",), "did you mean left?"),
        (("rules.frozen=[left/left/left]",), "at most 2 labels joined by /"),
        (("rules=rough", "value=rbf"), "value.kind=rbf: must be fnnq"),
        (("rules.margin=0",), "rules.margin=0.0: must be a number in (0, inf)"),
        (("rules=rogh",), "rules=rogh: must be "),
        (
            ("rules.prior=other.txt", "value.inputs.bearing=[[0, 1], [1, 1]]"),
            "other.txt:1:1: another partition: its labels of bearing are left, the network's are",
        ),
        (("rules.prior=other.txt", "rules.frozen=[lft]"), "did you mean left?"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(
    overrides: tuple[str, ...],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bad.txt").write_text("\nif bearing is far_left then steer hard_lft\n")
    Path("other.txt").write_text(
        "input bearing\nlabel left gaussian 0 1\naction steer\nlabel right gaussian 0 1\n"
        "if bearing is left and steer is right then value is 1\n"
    )
    Path("rules.csv").write_text("bearing,steer\n0.5,left\n")
    assert fnnq_train(*SMALL_WORLD, *QUIET, *overrides, "hydra.run.dir=job") == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert words in told
    left = {path.name for path in Path("job").rglob("*") if path.is_file()}
    assert not left - {"config.yaml", "hydra.yaml", "overrides.yaml"}
    assert TRAINING not in left


@pytest.mark.long
def test_a_sweep_over_priors_tells_mistakes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    sweep = ("-m", *SMALL_WORLD, *QUIET, *FEW, "hydra.sweep.dir=sweep")
    assert fnnq_train(*sweep, "rules.prior=null,missing.txt") == 2
    assert "missing.txt: there is no such file" in capsys.readouterr().err
    assert not [*Path("sweep").rglob("summary.json")]
    assert fnnq_train(*sweep[:-1], "hydra.sweep.dir=all", "rules=none,rough,operator") == 0
    before = [
        read_evaluations(Path("all", str(job), "evaluations.csv")).catches[:, 0].tolist()
        for job in range(3)
    ]
    assert before[0] != before[1] == before[2]


def test_a_network_of_triangles_and_minima_takes_its_like(tmp_path: Path) -> None:
    triangles = "value.inputs.bearing=[{triangle: [-2, -1, 0.5]}, {triangle: [-0.5, 1, 2]}]"
    job = config(triangles, "value.t_norm=minimum", "action.candidates=5")
    consequents = torch.arange(8, dtype=torch.float64).view(2, 4) / 8
    system = RuleBase(partition(job.value, job.env), "value", consequents, "minimum")
    path = tmp_path / "other.fll"
    system.export(path)
    told = config(triangles, "value.t_norm=minimum", f"rules.prior={path}")
    start = read_start(told)
    assert start is not None
    assert torch.equal(start.consequents, consequents)
    with pytest.raises(ConfigError, match=r"other\.fll:\d+:\d+: its t_norm .*=minimum changes"):
        read_start(config(triangles, f"rules.prior={path}"))
    record = tmp_path / "record.csv"
    bearings = torch.linspace(-0.9, 0.9, 19, dtype=torch.float64)
    actions = system.greedy(bearings.unsqueeze(-1)).tolist()
    rows = zip(bearings.tolist(), actions, strict=True)
    record.write_text("bearing,steer\n" + "".join(f"{x},{a}\n" for x, a in rows))
    followed = read_start(
        config(triangles, "value.t_norm=minimum", f"rules.demonstrations={record}")
    )
    assert followed is not None
    assert "in 100% of 19 steps" in followed.told


@pytest.mark.parametrize("ending", [".txt", ".json", ".fll", ".fis"])
def test_a_system_brings_its_labels_along(ending: str, tmp_path: Path) -> None:
    path, directory = other_system().export(tmp_path / f"other{ending}")[0], tmp_path / "job"
    directory.mkdir()
    keys = ("engine=eager", f"rules.prior={path}", "rules.frozen=[low]")
    run_job(config(*FEW, *keys), directory)
    path.unlink()  # the job has no need of it any more
    learned = load_rules(directory, 1)
    assert learned.same_partition(other_system().inputs)
    assert (learned.t_norm, learned.elsewhere) == ("minimum", "zero")
    low = [row["value"] for row in learned.table() if row["bearing"] == "low"]
    assert low == pytest.approx([1 / 8] * 3)
    trainer = Trainer.of(config(*FEW, "engine=eager", f"rules.prior={directory}"))
    assert trainer.config.value.names["bearing"] == ["low", "high"]
    assert trainer.config.value.t_norm == "minimum"


def other_system() -> RuleBase:
    """Two labels of the bearing and three of the action, none of them the paper's."""
    low, high = Label("low", "triangle", (-2.0, -1.0, 0.5)), Label("high", "sigmoid", (0.1, 9.0))
    steer = [Label(f"a{i}", "gaussian", (i - 1.0, 0.25)) for i in range(3)]
    inputs = (Variable("bearing", (low, high), -1, 1), Variable("steer", tuple(steer), -1, 1))
    consequents = torch.full((2, 3), 1 / 8, dtype=torch.float64)
    return RuleBase(inputs, "value", consequents, "minimum", "zero")


def test_definitions_above_a_few_sentences_count(tmp_path: Path) -> None:
    text = sentences.write(other_system()).split("\n\n")[0]
    path = tmp_path / "few.txt"
    path.write_text(f"{text}\nif bearing is low then steer a2\n")
    for keys in ((), ("value.inputs=null", "value.action=null")):
        told = imported(config(f"rules.prior={path}", *keys))
        assert told.value.inputs["bearing"] == [{"triangle": [-2, -1, 0.5]}, {"sigmoid": [0.1, 9]}]
        assert told.value.action == [[-1, 0.25], [0, 0.25], [1, 0.25]]
        start = read_start(told)
        assert start is not None
        assert start.consequents.tolist() == [[0, 0.375, 0.5], [0, 0, 0]]


def test_inputs_of_a_file_are_the_worlds_in_its_order(tmp_path: Path) -> None:
    labels = (Label("near", "gaussian", (0.1, 0.2)), Label("far", "gaussian", (0.9, 0.4)))
    names = ("sonar_right_m", "sonar_left_m", "steer")
    inputs = tuple(Variable(name, labels) for name in names)
    (path,) = RuleBase(inputs, "q", torch.rand(2, 2, 2)).export(tmp_path / "q.json")
    told = imported(config_of("task=wander", f"rules.prior={path}"))
    assert [*told.value.inputs] == [*names[:2]]
    path.write_text(path.read_text().replace("sonar_left_m", "sonar_lft_m"))
    with pytest.raises(ConfigError, match=r"q\.json:2\d:3: 'sonar_lft_m': .*mean sonar_left_m\?$"):
        imported(load_config("task=wander", f"rules.prior={path}"))
    path.write_text("if sonar_left_m is near then steer left\n")
    path = path.rename(tmp_path / "q.txt")
    with pytest.raises(ConfigError, match=r"defines no labels, and value\.inputs or"):
        imported(load_config("task=wander", f"rules.prior={path}", "value.inputs=null"))
