"""Print, explain and export the rules that a job of value=fnnq, fnnq_sum or fuzzy_q has learned.

    python -m fnnq_torchrl.rules run=DIR                       # the rules and the controller
    python -m fnnq_torchrl.rules run=DIR explain.bearing=0.3   # why it takes its action
    python -m fnnq_torchrl.rules run=DIR export=ctl.fll        # or .fis .c .onnx .pt2 .json .txt

seed=best chooses the run (or mean, or a run's seed). format=text may be markdown, csv or json.
controller=full or distilled and export_float=true need export=FILE. picture=FILE needs explain.….
record=FILE.csv writes the run's observations and actions in its test. own=true imports your own
classes. page=FILE.md compares the learned and the distilled controllers of all runs in a page.
"""

from pathlib import Path

from fnnq_torchrl.agent.rules import RulesError, explain
from fnnq_torchrl.agent.rules.errors import choices, shown
from fnnq_torchrl.launch.arguments import one_line_errors, read_words
from fnnq_torchrl.launch.words import truth
from fnnq_torchrl.studies.rules.job import BEST, Chosen, Job, choose, read_job
from fnnq_torchrl.studies.rules.page import write_faithfulness
from fnnq_torchrl.studies.rules.pictures import draw_explanation
from fnnq_torchrl.studies.rules.reading import read_run
from fnnq_torchrl.studies.rules.recording import record
from fnnq_torchrl.studies.rules.telling import FORMATS
from fnnq_torchrl.training.drawing import optional
from fnnq_torchrl.training.terminal import announce, say

_EXPLAIN = "explain."
_KEYS = (
    "run",
    "seed",
    "format",
    "export",
    "controller",
    "export_float",
    "record",
    "picture",
    "page",
    "own",
    _EXPLAIN,
)


def main() -> None:
    """Run the command. An error is one line on stderr and an exit status other than 0."""
    words = read_words("python -m fnnq_torchrl.rules", __doc__, _KEYS)
    with one_line_errors():
        _run(words)


def _run(words: dict[str, str]) -> None:
    job, chosen = chosen_run(words)
    form = words.get("format", "text")
    if form not in FORMATS:
        raise RulesError(f"format={shown(form)}: {choices(form, FORMATS)}")
    observation = {
        key.removeprefix(_EXPLAIN): _number(key, value)
        for key, value in words.items()
        if key.startswith(_EXPLAIN)
    }
    for key, others in (("controller", "export"), ("export_float", "export")):
        if key in words and others not in words:
            raise RulesError(f"{key}={words[key]}: needs {others}=FILE")
    if "picture" in words and not observation:
        raise RulesError(f"picture={words['picture']}: needs explain.…=NUMBER")
    if observation:
        explanation = explain(chosen.parts, observation)
        say(str(explanation))
        if "picture" in words:
            draw_explanation(explanation, Path(words["picture"]))
            announce(f"picture: {words['picture']}")
        else:
            picture = job.directory / "explanation.png"
            with optional(picture):
                draw_explanation(explanation, picture)
                announce(f"picture: {picture}")
    if "export" in words:
        floats = truth("export_float", words.get("export_float", "false"))
        controller = words.get("controller")
        for path in chosen.rules.export(words["export"], controller=controller, floats=floats):
            announce(f"written: {path}")
    if "record" in words:
        rows = record(read_run(job, chosen), Path(words["record"]))
        announce(f"written: {words['record']}, {rows:,} steps")
    if "page" in words:
        write_faithfulness(job, Path(words["page"]))
        announce(f"written: {words['page']}")
    if not observation and not {"export", "record", "page"} & {*words}:
        say(FORMATS[form](read_run(job, chosen)))


def chosen_run(words: dict[str, str]) -> tuple[Job, Chosen]:
    """Return the job and the run that ``run=DIR``, ``seed=…`` and ``own=…`` choose.

    Args:
        words: the command's arguments, by key.

    Raises:
        OSError, ValueError: as in :func:`.read_job` and :func:`.choose`, or ``run=`` is missing.
    """
    if "run" not in words:
        raise RulesError("run=DIR is missing, the directory of a finished job")
    own = truth("own", words.get("own", "false"))
    job = read_job(Path(words["run"]), own=own)
    return job, choose(job, words.get("seed", BEST))


def _number(key: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if number - number != 0:  # not a number, or infinite
        raise RulesError(f"{key}={shown(value)}: must be a finite number")
    return number
