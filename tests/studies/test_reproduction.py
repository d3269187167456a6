import re
from math import nan
from pathlib import Path

import numpy as np
import pytest

from fnnq_torchrl.studies.experiments import Experiment, NoResults
from fnnq_torchrl.studies.figures.gallery import FIGURES as GALLERY
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.reproduction.claims import CLAIMS, Claim, Comparison, Expected
from fnnq_torchrl.studies.reproduction.command import main
from fnnq_torchrl.studies.reproduction.general import GENERAL_EXPERIMENTS
from fnnq_torchrl.studies.reproduction.page import EXPERIMENTS, FIGURES, write_page
from fnnq_torchrl.studies.reproduction.pool import Pool, default_settings
from fnnq_torchrl.studies.reproduction.verdicts import (
    Verdict,
    compare,
    quick_verdict,
    together,
    verdict,
    verdict_shares,
)
from tests.experiment_files import EXPERIMENTS as INVENTED
from tests.experiment_files import LAMS as ALL_LAMS
from tests.experiment_files import Level, Settings, grid, invent_experiment, paper_level

LAMS = ALL_LAMS.split(",")
HOLDS, BARELY, PART = Verdict.HOLDS, Verdict.BARELY, Verdict.PART
FAILS, OPEN = Verdict.FAILS, Verdict.OPEN


@pytest.fixture(scope="module")
def pool(experiments: dict[str, Experiment]) -> Pool:
    default = default_settings(experiments["fig3_large"], {"lam": 0.2})
    return Pool(default, (experiments[name] for name in EXPERIMENTS))


@pytest.mark.parametrize(
    ("low", "high", "more", "less", "same", "other"),
    [
        (0.05, 0.30, BARELY, FAILS, OPEN, OPEN),
        (0.15, 0.30, HOLDS, FAILS, FAILS, HOLDS),
        (0.01, 0.05, BARELY, FAILS, HOLDS, FAILS),
        (-0.05, 0.05, FAILS, FAILS, HOLDS, FAILS),
        (-0.20, 0.05, FAILS, OPEN, OPEN, OPEN),
        (-0.20, 0.20, OPEN, OPEN, OPEN, OPEN),
        (-0.30, -0.15, FAILS, HOLDS, FAILS, HOLDS),
        (0.0, 0.0, FAILS, FAILS, HOLDS, FAILS),
        (nan, nan, OPEN, OPEN, OPEN, OPEN),
    ],
)
def test_what_an_interval_says(
    low: float, high: float, more: Verdict, less: Verdict, same: Verdict, other: Verdict
) -> None:
    found = [verdict(low, high, each) for each in Expected]
    assert found == [more, less, same, other]


def test_a_claim_is_as_good_as_its_worst_part() -> None:
    assert together([HOLDS, HOLDS]) is HOLDS
    assert together([HOLDS, BARELY]) is BARELY
    assert together([BARELY, OPEN]) is OPEN
    assert together([OPEN, FAILS, HOLDS]) is PART
    assert together([FAILS, BARELY]) is PART
    assert together([OPEN, FAILS]) is FAILS


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.words)
def test_every_claim_can_be_judged(claim: Claim, pool: Pool) -> None:
    assert quick_verdict(pool, claim, {})[1] == 110
    for comparison in claim.comparisons:
        assert comparison.measure in MEASURES


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.words)
def test_the_papers_own_words_are_in_its_section(claim: Claim) -> None:
    assert 10 < len(claim.words) < 90
    assert re.match("section 3|conclusion", claim.place)


LAM_MATTERS = Comparison("mean_score", {"lam": 0.4}, {"lam": 0.1}, Expected.LESS)


def test_a_comparison_is_of_the_same_seeds(pool: Pool) -> None:
    found = compare(pool, LAM_MATTERS, {}, 22)
    ours, theirs = (
        MEASURES["mean_score"].of(pool.job({"lam": lam}).evaluations)[:22] for lam in (0.4, 0.1)
    )
    assert found.runs == 22
    assert found.difference.mean.value == pytest.approx((ours - theirs).mean())
    assert (found.ours.value, found.theirs.value) == (ours.mean(), theirs.mean())
    assert found.verdict is HOLDS
    assert compare(pool, LAM_MATTERS, {}, None).runs == 110
    assert compare(pool, LAM_MATTERS, {"trace": "gradient"}, None).runs == 12


def test_other_seeds_are_no_pairs() -> None:
    experiment = invent_experiment("fig2", grid({"lam": "0.1,0.4"}), paper_level, 3)
    experiment.jobs[0].evaluations.seed[0] = 7
    pool = Pool(default_settings(experiment, {"lam": 0.2}), [experiment])
    with pytest.raises(NoResults, match="different seeds"):
        compare(pool, LAM_MATTERS, {}, None)


def test_what_was_not_run_is_told(pool: Pool) -> None:
    with pytest.raises(NoResults, match=r"no results with λ = 0\.35, step h by gradient"):
        pool.job({"lam": 0.35, "trace": "gradient"})


def test_the_largest_of_equal_jobs_is_taken(pool: Pool) -> None:
    # Six experiments have the default configuration, with λ = 0.2; the largest has 110 runs.
    assert pool.job({}).evaluations.runs == 110
    assert pool.job({"alpha": 0.1}).evaluations.runs == 12
    assert {"trace": "gradient", "lam": 0.8} in pool.changes()


def test_the_shares_are_over_samples_of_the_papers_size(pool: Pool) -> None:
    claim = Claim("", "", "", (LAM_MATTERS,))
    samples, shares = verdict_shares(pool, claim, 22)
    assert samples == 5
    assert shares == {HOLDS: 1.0, BARELY: 0.0, PART: 0.0, FAILS: 0.0, OPEN: 0.0}
    samples, shares = verdict_shares(pool, claim, 2)  # from two runs Student's t can tell little
    assert samples == 55
    assert sum(shares.values()) == pytest.approx(1)
    assert shares[OPEN] > 0.1


@pytest.fixture(scope="module")
def page(experiments: dict[str, Experiment]) -> str:
    return write_page({name: experiments[name] for name in EXPERIMENTS + GENERAL_EXPERIMENTS})


def test_the_page_has_every_claim_with_both_verdicts(page: str) -> None:
    for claim in CLAIMS:
        assert page.count(f"«{claim.words}»") == 2  # in the summary, and in a section
    sentences = re.findall(r"\*\*Over 22 seeds: (.*); over 110: (.*)\.\*\*", page)
    assert len(sentences) == len(CLAIMS)
    assert sentences[2] == ("holds", "holds")
    assert "\n* can't be told: step h by gradient (12 seeds)\n" in page
    assert page.startswith("# What of the paper holds\n\nThe paper makes 9 claims")


def test_the_page_has_every_open_choice(page: str) -> None:
    for choice in ("V₀ = 0.2 m/s", "sensor noise = 0.05 rad", "candidate actions = 101"):
        assert f"\n| {choice} |" in page
    for choice in ("second number of a label = σ²", "step h by gradient", "decay of α = 1"):
        assert f"\n| {choice} |" in page


def test_tables_are_whole_and_no_number_is_missing(page: str) -> None:
    tables = re.findall(r"(?:^\|.*\n)+", page, re.MULTILINE)
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert "nan" not in page
    assert "{" not in page


def test_the_pages_numbers_are_the_files(page: str, experiments: dict[str, Experiment]) -> None:
    job = experiments["traces"].job(trace="gradient", lam=0.7)
    (row,) = re.findall(r"\| final score, gradient \|(.*)\|", page)
    shown = float(row.split("|")[LAMS.index("0.7")].split("[")[0])
    assert shown == pytest.approx(job.evaluations.final_score.mean(), abs=0.005)
    # With γλ = 0.76, the steps are α(‖f‖² + γλ/(1 − γλ)) and α‖f‖²/(1 − γλ).
    steps = re.findall(r"\| (output|gradient), ‖f‖² = ([\d.]+) \|(.*)\|", page)
    assert len(steps) == 4
    for trace, norm, cells in steps:
        ratio = 0.76 / 0.24
        exact = float(norm) + ratio if trace == "output" else float(norm) / 0.24
        assert float(cells.split("|")[LAMS.index("0.8")]) == pytest.approx(0.4 * exact, abs=0.02)


def test_every_picture_is_drawn(page: str) -> None:
    assert set(re.findall(r"\(figures/(.*)\.png\)", page)) == FIGURES.keys()
    assert FIGURES.keys() == GALLERY.keys() - {
        "adaptive",
        "stability",
        "step_sizes",
    }  # are on another page


def test_the_command(
    experiments: dict[str, Experiment], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = "fnnq_torchrl.studies.reproduction.command"
    drawn: dict[str, Experiment] = {}
    monkeypatch.setattr(f"{command}.newest_experiment", lambda root, name: experiments[name])
    monkeypatch.setattr(f"{command}.write_page", lambda taken: ", ".join(taken))
    monkeypatch.setattr(f"{command}.draw", lambda figures, to: drawn.update(figures))
    monkeypatch.setattr("sys.argv", ["reproduction", "--to", str(tmp_path)])
    main()
    names = EXPERIMENTS + GENERAL_EXPERIMENTS
    assert (tmp_path / "reproduction.md").read_text() == ", ".join(names)
    assert {name: experiment.name for name, experiment in drawn.items()} == FIGURES


def test_what_was_never_run_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["reproduction", "--results", str(tmp_path)])
    with pytest.raises(SystemExit):
        main()
    assert re.search(
        r"fig2_large has no finished results: .*=fig2_large$", capsys.readouterr().err, re.MULTILINE
    )


def unlike_the_paper(settings: Settings) -> float:
    return 2.0 + 2 * settings["lam"]


@pytest.mark.parametrize(
    ("level", "expected"),
    [(paper_level, HOLDS), (unlike_the_paper, FAILS)],
    ids=["like the paper", "unlike it"],
)
def test_a_claim_fails_where_the_runs_say_so(level: Level, expected: Verdict) -> None:
    experiment = invent_experiment("fig2", INVENTED["fig2"], level, 60)
    pool = Pool(default_settings(experiment, {"lam": 0.2}), [experiment])
    [degrades] = [claim for claim in CLAIMS if "degrades" in claim.words]
    assert quick_verdict(pool, degrades, {}) == (expected, 60)
    assert np.isfinite(compare(pool, degrades.comparisons[0], {}, None).difference.effect)
