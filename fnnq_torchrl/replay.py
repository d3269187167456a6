"""Run a job's controller on a log: ``python -m fnnq_torchrl.replay log=FILE run=DIR``.

Keys, each as key=value:

    log   a CSV file with a column for each observation that the controller uses, by its name
    run   the directory of a finished job
    seed  the seed of one of the job's runs (default: the best run)
    to    the CSV to write, the log with the actions (default: LOG-actions.csv beside the log)
"""

import sys
from pathlib import Path

from fnnq_torchrl.launch.arguments import one_line_errors
from fnnq_torchrl.launch.words import parse, whole


def main() -> None:
    """Run the command; an error is one line on stderr and an exit status other than 0."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        sys.stdout.write(__doc__ or "")
        return
    defaults = {"log": "", "run": "", "seed": "", "to": ""}
    with one_line_errors():
        sys.stdout.write(f"{replay(defaults | parse(sys.argv[1:], defaults, ['log', 'run']))}\n")


def replay(given: dict[str, str]) -> Path:
    """Write the log with the controller's actions.

    Args:
        given: a value for every key of the command.

    Returns:
        The path of the file that was written.

    Raises:
        ConfigError: if a value isn't allowed, or the log has wrong columns or readings.
        OSError: if a file can't be read or written.
        ValueError: if the job's checkpoint is damaged or has no run with this seed.
    """
    seed = whole(given, "seed", 0) if given["seed"] else None
    # Imported after the checks, because importing torch takes seconds.
    from io import StringIO

    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.files.atomic import atomic_write
    from fnnq_torchrl.training.policies import best_seed, load_policy
    from fnnq_torchrl.training.replaying import greedy_actions, read_log, write_actions
    from fnnq_torchrl.training.weights import load_checkpoint

    run, log = Path(given["run"]), Path(given["log"])
    checkpoint = load_checkpoint(run / "checkpoint.pt")
    network = load_policy(run, best_seed(run) if seed is None else seed).value_network
    rows = read_log(log, network.in_keys)
    text = StringIO(newline="")
    write_actions(text, to_config(checkpoint.config), rows, greedy_actions(network, rows))
    to = Path(given["to"]) if given["to"] else log.with_name(f"{log.stem}-actions.csv")
    with atomic_write(to) as file:
        file.write(text.getvalue().encode())
    return to


if __name__ == "__main__":
    main()
