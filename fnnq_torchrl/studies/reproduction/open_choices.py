"""The section of the page on the choices that the paper leaves open."""

import numpy as np

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.figures.job_words import change_words
from fnnq_torchrl.studies.measures import MEASURES
from fnnq_torchrl.studies.statistics import bootstrap_interval, paired_difference
from fnnq_torchrl.training.pictures.words import setting_words

from .claims import Expected
from .markdown import interval_words, table
from .verdicts import MATTERS, Verdict, verdict


def open_choices_section(choices: Experiment) -> str:
    """Return the section on the choices that the paper leaves open."""
    measure = MEASURES["mean_score"].of
    without, with_lam = min(choices.values("lam")), max(choices.values("lam"))
    base = [job for job in choices.jobs if change_words(choices, job, "lam") == "default"]
    scores = {
        (change_words(choices, job, "lam"), job.settings["lam"]): measure(job.evaluations)
        for job in choices.jobs
    }
    rows = []
    sizes: dict[Verdict, list[str]] = {each: [] for each in Verdict}
    for name in dict.fromkeys(name for name, _ in scores):
        ours = scores[name, with_lam]
        moved = paired_difference(ours, scores["default", with_lam])
        gained = paired_difference(ours, scores[name, without])
        if name != "default":
            sizes[verdict(moved.mean.low, moved.mean.high, Expected.SAME)].append(name)
        rows.append(
            [
                name,
                interval_words(bootstrap_interval(np.mean, ours)),
                "" if name == "default" else interval_words(moved.mean, signed=True),
                "" if name == "default" else f"{moved.effect:+.2f}",
                interval_words(gained.mean, signed=True),
                f"{gained.effect:+.2f}",
            ]
        )
    lam, none = setting_words("lam", with_lam), setting_words("lam", without)
    head = ["choice", f"mean score with {lam}", "moves it by", "d", f"{lam} against {none}", "d"]
    seeds = min(job.evaluations.runs for job in base)
    told = [
        f"* {start}: {'; '.join(sizes[which])}\n"
        for which, start in (
            (Verdict.FAILS, f"by {MATTERS} catches or more"),
            (Verdict.HOLDS, "by less than that"),
            (Verdict.OPEN, "can't be told"),
        )
        if sizes[which]
    ]
    return (
        "## What the paper leaves open\n\n"
        "The paper gives no figure for the robot's speed V₀, the sensor's noise, the number of "
        "candidate actions and the decay of α. It calls the labels' second number a variance, and "
        "step h has two readings. A choice other than the default moves the mean score with "
        f"{lam}\n\n{''.join(told)}\n"
        f"The table has one choice in each row, with the defaults for all others, over {seeds:,} "
        "seeds:\n\n" + table(head, rows) + "\n"
        "![Mean score with each choice](figures/open_choices.png)\n"
    )
