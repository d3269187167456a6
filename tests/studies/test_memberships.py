import re
from pathlib import Path

import numpy as np
import pytest

from fnnq_torchrl.studies.experiments import NoResults
from fnnq_torchrl.studies.memberships.command import main
from fnnq_torchrl.studies.memberships.page import better_words, write_page
from fnnq_torchrl.studies.memberships.sources import Source, read_sources
from fnnq_torchrl.studies.statistics import Interval
from tests.experiment_files import Settings, grid, invent_experiment, write_experiment

ALPHAS = "0.1,0.2,0.4"
JOBS = [
    *grid({"alpha": ALPHAS}),
    *grid({"alpha": ALPHAS}, "value.membership=even"),
    *grid({"alpha": ALPHAS}, "value.learn_memberships=1"),
]


def level(settings: Settings) -> float:
    """Return a score: labels learned by gradient are best, and even labels are worst."""
    better = settings["value"]["learn_memberships"] - (settings["value"]["membership"] == "even")
    return 4.0 + 0.5 * better - 5 * abs(settings["alpha"] - 0.2)


def invented(name: str, score: float, labels: int, clustered: bool = False) -> Source:
    scores = np.random.default_rng(len(name)).normal(score, 0.1, 40)
    return Source(name, clustered, [[0.0, 0.1]] * labels, 0.2, scores, 80, [0.2, 0.4], 0)


def test_sources_are_read_from_jobs() -> None:
    experiment = invent_experiment("memberships", JOBS, level, runs=20)
    sources = read_sources(experiment)
    assert [each.name for each in sources] == ["by hand", "even", "by hand, then by gradient"]
    for each, jobs in zip(sources, (JOBS[:3], JOBS[3:6], JOBS[6:]), strict=True):
        assert (each.count, each.best_alpha, each.alphas) == (5, 0.2, [0.1, 0.2, 0.4])
        best = experiment.jobs[JOBS.index(jobs[1])]
        assert each.scores.tolist() == best.evaluations.mean_score[10:].tolist()
    assert sources[1].labels[0][0] == -1


def test_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_experiment(tmp_path / "memberships" / "2026-01-02_03-04-05", JOBS, level, runs=4)
    to = tmp_path / "docs"
    to.mkdir()
    monkeypatch.setattr("sys.argv", ["memberships", "--results", str(tmp_path), "--to", str(to)])
    main()
    assert "over 4 seeds of each choice" in (to / "memberships.md").read_text()
    monkeypatch.setattr("sys.argv", ["memberships", "--results", str(to)])
    with pytest.raises(SystemExit):
        main()
    assert re.search(
        r"memberships has no finished results: .*=memberships$",
        capsys.readouterr().err,
        re.MULTILINE,
    )


def test_the_page_says_what_the_results_say() -> None:
    sources = [
        invented("by hand", 4.0, 5),
        invented("even", 4.5, 5),
        invented("k-means, random play", 4.3, 5, clustered=True),
        invented("by hand, then by gradient", 4.6, 5),
        invented("even", 3.0, 3),
        invented("k-means, random play", 2.5, 3, clustered=True),
    ]
    page = write_page(sources)
    assert "rather than the paper's labels **holds**: at" in page
    assert "rather than gradient learning of them **does not hold**: at" in page
    assert "score more than they do in 0 of 2 comparisons" in page
    assert "With 3 labels, compared with *evenly spaced*: k-means, random play: worse." in page
    assert page.index("## With 3 labels") < page.index("## With 5 labels")
    for table in re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert "nan" not in page
    with pytest.raises(NoResults, match="to compare with those from k-means, random play"):
        write_page(sources[-1:])


@pytest.mark.parametrize(
    ("low", "high", "words"),
    [
        (0.2, 0.3, "better"),
        (-0.3, -0.2, "worse"),
        (-0.05, 0.05, "the same to within 0.1 catches"),
        (0.05, 0.3, "better, perhaps by less than 0.1 catches"),
        (-0.3, -0.05, "worse, perhaps by less than 0.1 catches"),
        (-0.3, 0.3, "neither clearly better nor worse nor the same"),
    ],
)
def test_a_difference_in_words(low: float, high: float, words: str) -> None:
    assert better_words(Interval((low + high) / 2, low, high)) == words
