"""Run a controller over recorded readings: ``python -m fnnq_torchrl.replay log=FILE run=DIR``.

Keys, each as key=value:

    log   a CSV file with a column for each input of the controller, named as its observations
    run   the directory of a finished job
    seed  of one of its runs (default: the first)
    to    the CSV to write: the log with the actions (default: beside the log, with -actions)
"""

import sys
from pathlib import Path

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.words import parse, whole


def main() -> None:
    """Read ``sys.argv``; a mistake is one line on stderr and status 2."""
    if {"-h", "--help"} & {*sys.argv[1:]}:
        sys.stdout.write(__doc__ or "")
        return
    defaults = {"log": "", "run": "", "seed": "", "to": ""}
    try:
        sys.stdout.write(f"{replay(parse(sys.argv[1:], defaults, ['log', 'run']))}\n")
    except (ConfigError, OSError, ValueError) as error:
        sys.stderr.write(f"{' '.join(str(error).split())}\n")
        sys.exit(2)


def replay(given: dict[str, str]) -> Path:
    """Write what the controller does, and return the file.

    Args:
        given: a value for every key.

    Raises:
        ConfigError, OSError, ValueError: something can't be read or written.
    """
    seed = whole(given, "seed", 0) if given["seed"] else None
    # After the checks: torch takes seconds to import.
    from io import StringIO

    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.files.atomic import atomic_write
    from fnnq_torchrl.training.policies import load_policy
    from fnnq_torchrl.training.replaying import greedy_actions, read_log, write_actions
    from fnnq_torchrl.training.weights import load_checkpoint

    run, log = Path(given["run"]), Path(given["log"])
    checkpoint = load_checkpoint(run / "checkpoint.pt")
    network = load_policy(run, int(checkpoint.seed[0]) if seed is None else seed).value_network
    rows = read_log(log, network.in_keys)
    text = StringIO(newline="")
    write_actions(text, to_config(checkpoint.config), rows, greedy_actions(network, rows))
    to = Path(given["to"]) if given["to"] else log.with_name(f"{log.stem}-actions.csv")
    with atomic_write(to) as file:
        file.write(text.getvalue().encode())
    return to


if __name__ == "__main__":
    main()
