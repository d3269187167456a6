import re
from pathlib import Path

import numpy as np
import pytest

from fnnq_torchrl.adaptive.__main__ import main
from fnnq_torchrl.adaptive.page import write_page
from fnnq_torchrl.adaptive.scheme import read_scheme
from fnnq_torchrl.experiments import Experiment, NoResults, newest_experiment

from .experiment_files import Settings, grid, write_experiment

ALPHAS = "0.1,0.2,0.4"
JOBS = [
    *grid({"step_size": "decay,obgd,alpha_bound", "alpha": ALPHAS, "lam": "0.2,0.8"}),
    *grid({"alpha": ALPHAS, "lam": "0.2,0.8"}, "step_size=constant", "alpha_decay=1"),
]


def level(settings: Settings) -> float:
    """With ObGD α doesn't matter, and it is best; a constant is worst; the α bound is decay's."""
    if settings["step_size"] == "obgd":
        return 4.5
    return 4.0 - 5 * abs(settings["alpha"] - 0.2) - 2 * (settings["step_size"] == "constant")


def invented(directory: Path, jobs: list[tuple[str, ...]] = JOBS, runs: int = 60) -> Experiment:
    write_experiment(directory / "adaptive" / "2026-01-02_03-04-05", jobs, level, runs)
    return newest_experiment(directory, "adaptive")


@pytest.fixture(scope="module")
def experiment(tmp_path_factory: pytest.TempPathFactory) -> Experiment:
    return invented(tmp_path_factory.mktemp("outputs"))


def test_the_best_alpha_is_chosen_by_one_half_and_judged_by_the_other(
    experiment: Experiment,
) -> None:
    scheme = read_scheme(experiment, "decay", 0.2)
    scores = [
        experiment.job(step_size="decay", lam=0.2, alpha=alpha).evaluations.mean_score
        for alpha in (0.1, 0.2, 0.4)
    ]
    assert scheme.best_alpha == 0.2
    assert scheme.at_best.tolist() == scores[1][30:].tolist()
    np.testing.assert_allclose(scheme.over_alphas, sum(scores) / 3)
    assert scheme.spread == pytest.approx(scores[1].mean() - scores[2].mean())


def test_the_page_says_what_the_results_say(experiment: Experiment) -> None:
    page = write_page(experiment)
    sentences = dict(re.findall(r"\* \*\*(.*)\*\*, against the paper's: (.*)", page))
    assert sentences["ObGD"].startswith("each at its best α, it scores more; over all α, more.")
    assert "Its spread is 0.00 catches, the paper's" in sentences["ObGD"]
    assert sentences["constant α"].startswith("each at its best α, it scores less; over all")
    assert "scores the same, to within 0.1" in sentences["α bound"]
    assert page.count("| decaying α | 0.2 |") == 2
    assert "nan" not in page
    assert "{" not in page


def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    experiment = invented(tmp_path, runs=4)
    to = tmp_path / "docs"
    monkeypatch.setattr(
        "fnnq_torchrl.adaptive.__main__.draw", lambda what, where: where.mkdir(parents=True)
    )
    monkeypatch.setattr("sys.argv", ["adaptive", "--results", str(tmp_path), "--to", str(to)])
    main()
    assert (to / "adaptive.md").read_text() == write_page(experiment)


def test_what_is_missing_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["adaptive", "--results", str(tmp_path)])
    with pytest.raises(SystemExit, match=r"adaptive has no finished results: .*=adaptive$"):
        main()
    with pytest.raises(NoResults, match=r"^adaptive has 3 seeds, too few to choose"):
        write_page(invented(tmp_path, runs=3))


def test_a_missing_job_is_told(tmp_path: Path) -> None:
    with pytest.raises(NoResults, match=r"0 jobs with step_size=constant lam=0\.8 alpha=0\.4"):
        write_page(invented(tmp_path, JOBS[:-1], runs=4))
