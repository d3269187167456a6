"""Demonstrations: what a run sees and does in its test, as a file for others to imitate."""

from pathlib import Path

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.studies.rules.reading import Reading


def record(reading: Reading, path: Path) -> int:
    """Write a row for each step of the test: the observations, by their names, and the action.

    Returns:
        The number of rows.

    Raises:
        OSError: the file can't be written.
    """
    states, actions = reading.played.visited()
    names = [*reading.played.names, reading.chosen.rules.action.name]
    rows = zip(states.tolist(), actions.tolist(), strict=True)
    with atomic_write(path) as file:
        file.write(f"{','.join(names)}\n".encode())
        for state, action in rows:
            file.write(f"{','.join(map(repr, [*state, action]))}\n".encode())
    return len(states)
