"""Demonstrations: a run's observations and actions in its test, written for imitation."""

from pathlib import Path

from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.studies.rules.reading import Reading


def record(reading: Reading, path: Path) -> int:
    """Write a CSV file with a row for each step of the test: the observations and the action.

    Returns:
        The number of rows, without the header of names.

    Raises:
        OSError: if the file can't be written.
    """
    states, actions = reading.played.visited()
    names = [*reading.played.names, reading.chosen.rules.action.name]
    rows = zip(states.tolist(), actions.tolist(), strict=True)
    with atomic_write(path) as file:
        file.write(f"{','.join(names)}\n".encode())
        for state, action in rows:
            file.write(f"{','.join(map(repr, [*state, action]))}\n".encode())
    return len(states)
