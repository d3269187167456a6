"""Write a report on a job, a sweep or an experiment: one HTML file that opens from disk.

    python -m fnnq_torchrl.report run=DIR               # writes DIR/report.html
    python -m fnnq_torchrl.report run=DIR to=FILE.html

The page needs no network. It has the learning curves, the configurations with their differences,
what the best run has learned, a replay of its test, and the commands that train the jobs again.
own=true imports your own classes.
"""

from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.arguments import one_line_errors, read_words
from fnnq_torchrl.launch.words import truth
from fnnq_torchrl.studies.results.collect import collect
from fnnq_torchrl.studies.results.command import tell_left_out
from fnnq_torchrl.training.terminal import announce

REPORT = "report.html"
"""The name of the file in the directory of the job, the sweep or the experiment."""


def main() -> None:
    """Run the command. An error is one line on stderr and an exit status other than 0."""
    words = read_words("python -m fnnq_torchrl.report", __doc__, ("run", "to", "own"))
    with one_line_errors():
        announce(f"report: {write_report(words)}")


def write_report(words: dict[str, str]) -> Path:
    """Write the report.

    Args:
        words: the values of the command's keys; ``run`` is needed.

    Returns:
        The path of the file.

    Raises:
        ConfigError: if a value isn't allowed, or the extra ``report`` isn't installed.
        NoResults: if there are no results.
        OSError: if the file can't be written.
    """
    if "run" not in words:
        raise ConfigError("run=… is missing, the directory of a job, a sweep or an experiment")
    run, own = Path(words["run"]), truth("own", words.get("own", "false"))
    results = collect([run], own=own)
    tell_left_out(results.left_out)
    # Imported after the checks, because importing torch takes seconds.
    from fnnq_torchrl.files.atomic import atomic_write
    from fnnq_torchrl.studies.report.page import make_report

    page = make_report(run, results, own=own)
    to = Path(words.get("to", run / REPORT))
    with atomic_write(to) as file:
        file.write(page.encode())
    return to
