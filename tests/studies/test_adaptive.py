import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fnnq_torchrl.studies.adaptive.command import main
from fnnq_torchrl.studies.adaptive.page import write_page
from fnnq_torchrl.studies.adaptive.scheme import held_back, read_scheme
from fnnq_torchrl.studies.adaptive.weights import Weights, weights_part
from fnnq_torchrl.studies.experiments import Experiment, Job, NoResults
from tests.experiment_files import (
    EXPERIMENTS,
    Settings,
    grid,
    invent_experiment,
    write_experiment,
)

ALPHAS = "0.1,0.2,0.4"
JOBS = [
    *grid({"step_size": "decay,obgd,alpha_bound", "alpha": ALPHAS, "lam": "0.2,0.8"}),
    *grid({"alpha": ALPHAS, "lam": "0.2,0.8"}, "step_size=constant", "alpha_decay=1"),
]
STABILITY = grid(
    # Under value.layer_norm, 1 is True and the empty text is False.
    {"value.layer_norm": "1,", "step_size": "constant,obgd", "alpha": ALPHAS},
    *("value=mlp", "lam=0.8", "alpha_decay=1"),
)


SARSA = ("alpha_decay=1", "variant=sarsa")
STEP_SIZES = EXPERIMENTS["step_sizes"]
META = [
    *grid({"step_size": "tidbd", "meta_step_size": "0,0.5", "lam": "0.2,0.8"}, "alpha_decay=1"),
    *grid(
        {"step_size": "swift", "meta_step_size": "0,0.5", "lam": "0.2,0.8"}, *SARSA, "trace=dutch"
    ),
]
CAR = [
    *grid({"step_size": "constant,tidbd", "alpha": ALPHAS}, *SARSA, "trace=replacing"),
    *grid({"step_size": "constant,swift", "alpha": ALPHAS}, *SARSA, "trace=dutch"),
]


def level(settings: Settings) -> float:
    """Return a score: ObGD is best for every α, a constant α is worst, the α bound equals decay.

    TIDBD is as good as ObGD, and learns nothing if its meta step size is large.
    """
    if settings["step_size"] in ("obgd", "tidbd"):
        return 4.5 if settings["meta_step_size"] < 0.5 else 0.0
    return 4.0 - 5 * abs(settings["alpha"] - 0.2) - 2 * (settings["step_size"] == "constant")


def invented(name: str, jobs: list[tuple[str, ...]], runs: int = 60) -> Experiment:
    return invent_experiment(name, jobs, level, runs)


@pytest.fixture(scope="module")
def adaptive() -> Experiment:
    return invented("adaptive", JOBS)


@pytest.fixture(scope="module")
def stability() -> Experiment:
    return invented("stability", STABILITY)


OF_WEIGHTS = {"step_sizes": STEP_SIZES, "meta_step_sizes": META, "step_sizes_car": CAR}


@pytest.fixture(scope="module")
def of_weights() -> dict[str, Experiment]:
    return {name: invented(name, jobs) for name, jobs in OF_WEIGHTS.items()}


@pytest.fixture(scope="module")
def weights(of_weights: dict[str, Experiment]) -> Weights:
    return weights_part(*of_weights.values())


def test_the_best_alpha_is_chosen_by_one_half_and_judged_by_the_other(adaptive: Experiment) -> None:
    scheme = read_scheme(adaptive, "decay", 0.2)
    scores = [
        adaptive.job(step_size="decay", lam=0.2, alpha=alpha).evaluations.mean_score
        for alpha in (0.1, 0.2, 0.4)
    ]
    assert scheme.best_alpha == 0.2
    assert scheme.at_best.tolist() == scores[1][30:].tolist()
    np.testing.assert_allclose(scheme.over_alphas, sum(scores) / 3)
    assert scheme.spread.value == pytest.approx((scores[1] - scores[2])[30:].mean())
    assert scheme.spread.low < scheme.spread.value < scheme.spread.high
    assert scheme.diverged == {0.1: 0, 0.2: 0, 0.4: 0}


def with_steps(experiment: Experiment, step_size: str, alpha: float, factor: int) -> Experiment:
    """Return the results after multiplying the steps of one α's runs with λ = 0.8 by a factor."""

    def changed(job: Job) -> Job:
        of_job = (job.settings["step_size"], job.settings["alpha"], job.settings["lam"])
        if of_job != (step_size, alpha, 0.8):
            return job
        evaluations = job.evaluations
        return replace(job, evaluations=replace(evaluations, steps=factor * evaluations.steps))

    return Experiment(experiment.name, [changed(job) for job in experiment.jobs])


def test_an_alpha_bound_that_was_never_below_alpha_is_told(
    adaptive: Experiment, stability: Experiment, weights: Weights
) -> None:
    assert held_back(adaptive, 0.8) == []
    assert write_page(adaptive, stability, weights).count("The α bound was never below α here") == 2
    changed = with_steps(adaptive, "alpha_bound", 0.4, 2)
    assert (held_back(changed, 0.2), held_back(changed, 0.8)) == ([], [0.4])
    page = write_page(changed, stability, weights)
    assert page.count("The α bound was never below α here") == 1
    assert "The α bound was below α with α = 0.4. With the others its runs are those" in page


def test_the_page_says_what_the_results_say(
    adaptive: Experiment, stability: Experiment, weights: Weights
) -> None:
    page, _, perceptron = write_page(adaptive, stability, weights).partition("## With a multilayer")
    answer, _, page = page.partition("## What is compared")
    rows = re.findall(r"^\| ([^|]+) \| -?(\d\.\d\d) \| -?(\d\.\d\d) \|", answer, re.MULTILINE)
    scores = {name: (float(untuned), float(tuned)) for name, untuned, tuned in rows}
    # All scores are some 10 % below their level, since learning takes time.
    assert scores["decaying α"] < scores["ObGD"]
    assert scores["constant α"] < scores["decaying α"] == scores["α bound"]
    best = max(scores["ObGD"], scores["TIDBD"], scores["Swift-Sarsa"])
    assert "* **Ball, λ = 0.8.** An untuned α does best with " in answer
    assert f"({best[0]:.2f}; decaying α: {scores['decaying α'][0]:.2f})" in answer
    assert list(scores)[-2:] == ["true online Sarsa(λ)", "Swift-Sarsa"]
    layers = answer.partition("* **Perceptrons.** With normalised layers ObGD scores ")[2]
    assert re.match(r"\d\.\d\d untuned, a constant α \d\.\d\d \(more\)\. .*\(more\)\.", layers)
    assert "Diverged runs, over all α: 0 of 180 with constant α, 0 of 180 with ObGD." in layers
    assert len(re.findall(r"^\| ObGD .* more \| .* more \|", page, re.MULTILINE)) == 2
    assert len(re.findall(r"^\| α bound .* same \| .* same \|", page, re.MULTILINE)) == 2
    assert len(re.findall(r"^\| constant α .* less \| .* less \|", page, re.MULTILINE)) == 2
    assert page.count("| decaying α | 0.00 | 0.2 |") == 2
    assert page.count("No run diverged.") == 2
    perceptron, _, per_weight = perceptron.partition("## With a step size")
    assert len(re.findall(r"^\| ObGD .* more \| .* more \|", perceptron, re.MULTILINE)) == 2
    assert "with α from 0.1 to 0.4 and 60 seeds each" in " ".join(perceptron.split())
    assert weights.text in f"## With a step size{per_weight}"
    assert "nan" not in answer + page + perceptron
    assert "{" not in answer + page + perceptron


def test_the_part_on_step_sizes_per_weight_says_what_the_results_say(weights: Weights) -> None:
    # The levels are 3.5 and 3.0 for decaying α, and 4.5 for TIDBD.
    rules, true_online = weights.ball[0.2]
    assert (rules.reference, true_online.reference) == ("decay", "constant")
    assert rules.over_alphas["constant"].high < 0 < rules.over_alphas["tidbd"].low
    assert list(true_online.schemes) == ["constant", "swift"]
    assert [list(each.at_best) for each in weights.car] == [["tidbd"], ["swift"]]
    # TIDBD's score falls from 4.5 to 0, and a run's mean score is somewhat below its level.
    of_meta = re.search(r"TIDBD (\d\.\d\d), Swift-Sarsa 0\.0\d catches\.$", weights.sensitivity)
    assert of_meta
    assert 3.5 < float(of_meta[1]) < 4.5
    assert weights.text.count("True online Sarsa(λ):") == 3
    assert "| TIDBD, λ = 0.2 | 4." in weights.text
    assert "nan" not in weights.text
    assert "{" not in weights.text


def test_diverged_runs_are_shown_by_alpha(
    adaptive: Experiment, stability: Experiment, weights: Weights
) -> None:
    of_job = {"step_size": "constant", "alpha": 0.4, "value.layer_norm": False}
    job = stability.job_with(of_job)
    diverged = np.zeros_like(job.evaluations.diverged)
    diverged[:7, -1] = True
    worse = replace(job, evaluations=replace(job.evaluations, diverged=diverged))
    jobs = [worse if each is job else each for each in stability.jobs]
    page = write_page(adaptive, Experiment("stability", jobs), weights)
    assert (
        "| diverged, of 60 runs | α = 0.1 | α = 0.2 | α = 0.4 |\n| --- | --- | --- | --- |\n"
        "| constant α | 0 | 0 | 7 |\n| ObGD | 0 | 0 | 0 |\n"
    ) in page
    assert "Diverged runs, over all α: 7 of 180 with constant α, 0 of 180 with ObGD." in page


def test_the_command(
    adaptive: Experiment,
    stability: Experiment,
    of_weights: dict[str, Experiment],
    weights: Weights,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = {"adaptive": adaptive, "stability": stability, **of_weights}
    command = "fnnq_torchrl.studies.adaptive.command"
    monkeypatch.setattr(f"{command}.newest_experiment", lambda root, name: found[name])
    monkeypatch.setattr(f"{command}.weights_part", lambda *read: weights)
    monkeypatch.setattr(f"{command}.draw", lambda what, where: where.mkdir(parents=True))
    to = tmp_path / "docs"
    monkeypatch.setattr("sys.argv", ["adaptive", "--to", str(to)])
    main()
    assert (to / "adaptive.md").read_text() == write_page(adaptive, stability, weights)


def test_what_is_missing_is_one_line(
    tmp_path: Path,
    stability: Experiment,
    weights: Weights,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("sys.argv", ["adaptive", "--results", str(tmp_path)])
    with pytest.raises(SystemExit):
        main()
    assert re.search(
        r"adaptive has no finished results: .*=adaptive$", capsys.readouterr().err, re.MULTILINE
    )
    few = invented("adaptive", JOBS, runs=3)
    with pytest.raises(ValueError, match=r"^3 runs are too few: half of them choose"):
        write_page(few, stability, weights)
    write_experiment(tmp_path / "adaptive" / "2026-01-02_03-04-05", JOBS[:1], level, runs=3)
    with pytest.raises(SystemExit):
        main()
    assert re.search(
        r"stability has no finished results: .*=stability$", capsys.readouterr().err, re.MULTILINE
    )


def test_a_missing_job_is_told(tmp_path: Path, stability: Experiment, weights: Weights) -> None:
    with pytest.raises(NoResults, match=r"0 jobs with step_size=constant lam=0\.8 alpha=0\.4"):
        write_page(invented("adaptive", JOBS[:-1], runs=4), stability, weights)
