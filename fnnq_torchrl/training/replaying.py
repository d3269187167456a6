"""The actions of a learned controller for each row of recorded sensor readings."""

import csv
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TextIO

import torch

from envs.robot.kinematics import wheel_speeds
from envs.robot.scene import SceneConfig
from envs.robot.schemas import FollowBallConfig
from fnnq_torchrl.agent.values import ValueNetwork
from fnnq_torchrl.config.schema import Config, ConfigError

Rows = list[dict[str, str]]
"""The rows of a log, each a mapping from column names to the texts in the file."""


def read_log(path: Path, names: Sequence[str]) -> Rows:
    """Read a CSV file with a header.

    Args:
        path: the file to read.
        names: the columns of finite numbers that the file must have; other columns are allowed.

    Raises:
        ConfigError: if a column is missing, there is no row, or a reading isn't a finite number.
            The message names the place.
        OSError: if the file can't be read.
    """
    with open(path, newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file)
        columns = reader.fieldnames or []
        if missing := [name for name in names if name not in columns]:
            raise ConfigError(
                f"{path}: there is no column {missing[0]}; the controller needs {', '.join(names)}"
            )
        rows = [*reader]
    if not rows:
        raise ConfigError(f"{path}: there is no row of readings")
    for number, row in enumerate(rows, start=2):
        for name in names:
            try:
                fine = isfinite(float(row[name]))
            except (TypeError, ValueError):
                fine = False
            if not fine:
                given = f"{path}: line {number}: {name}={row[name]}"
                raise ConfigError(f"{given}: must be a finite number")
    return rows


@torch.no_grad()
def greedy_actions(network: ValueNetwork, rows: Rows) -> list[float]:
    """Return the greedy action in each row (:meth:`.ValueNetwork.greedy`).

    Args:
        network: the value network of a single run.
        rows: the log, with a column for each input of the network.
    """
    like = network.candidates
    seen = [
        like.new_tensor([float(row[name]) for row in rows]).view(1, -1, 1)
        for name in network.in_keys
    ]
    actions: list[float] = network.greedy(*seen).flatten().tolist()
    return actions


def write_actions(file: TextIO, config: Config, rows: Rows, actions: Sequence[float]) -> None:
    """Write the log with a further column ``action``, and for robots both wheels' speeds in m/s.

    Args:
        file: the open file to write to.
        config: the job's configuration.
        rows: the log.
        actions: the action of each row.
    """
    named = [{"action": action} | _wheels(config, action) for action in actions]
    writer = csv.DictWriter(file, [*rows[0], *named[0]], extrasaction="ignore")
    writer.writeheader()
    writer.writerows(row | told for row, told in zip(rows, named, strict=True))


def _wheels(config: Config, action: float) -> dict[str, float]:
    """Return both wheels' speeds in m/s; nothing if the world has no robot with wheels."""
    world = config.env
    if isinstance(world, SceneConfig):
        speed_mps = world.robot.speed_mps
    elif isinstance(world, FollowBallConfig):
        speed_mps = world.speed_mps
    else:
        return {}
    speeds = wheel_speeds(torch.tensor(action, dtype=torch.float64), speed_mps)
    return dict(zip(("left_mps", "right_mps"), map(float, speeds), strict=True))
