"""The part of the report that replays a run's test: films, and the rules that fire."""

from collections.abc import Sequence
from dataclasses import asdict
from math import ceil
from pathlib import Path
from typing import Any

import torch

from envs.robot.drawing import Shot
from envs.shapes import DrawnShot, Look, Shape
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.studies.report.charts import Missing, number_of
from fnnq_torchrl.studies.rules.job import Chosen, read_job
from fnnq_torchrl.studies.rules.reading import Reading, read_run
from fnnq_torchrl.training.watching import Film, play
from fnnq_torchrl.training.weights import load_checkpoint

_SITUATIONS = 8
_MOST = 500
"""The largest number of a situation's steps that are shown; of longer ones every second, or so."""

_LEAST = 0.01
"""The least firing strength that is shown."""

_STILL = "half_size_m", "walls", "radius_m", "track_width_m", "discs", "boxes", "view_rad"
"""The fields of a shot that stay the same from a situation's start to its end."""


def drives_of(
    directory: Path, seed: int, config: Config, chosen: Chosen | None, *, own: bool
) -> dict[str, Any]:
    """Return the replay of a run's test, as plain data for the page.

    Args:
        directory: the job's directory.
        seed: the run's seed.
        config: the job's configuration.
        chosen: the run's rules, if it has any.
        own: True to import the user's own classes.

    Returns:
        ``films``: for ``before`` and ``after`` learning, the situations with their shots; only if
        the world has a drawing. ``told``: for each situation after learning, the observation and
        the action of each step and the rules that fired; ``names`` of the observations and the
        action, and ``score`` in words; only with rules. ``why``: the reason why there are no films.
        Each situation also has its number of ``steps`` and its ``success``; every ``every``-th
        step is there.

    Raises:
        OSError, ValueError: if the job's files can't be read, or are damaged.
        Missing: if the job plays no tests, or there is nothing to show.
    """
    if not config.evaluation.tests:
        raise Missing("The job plays no tests (evaluation=none), so there is nothing to replay.")
    found: dict[str, Any] = {"films": None, "why": "", "told": None, "names": [], "score": ""}
    number = min(_SITUATIONS, config.evaluation.tests)
    try:
        found["films"] = _films(directory, seed, config, number)
    except ConfigError as error:  # the world has no drawing
        found["why"] = f"{error}."
    if chosen is not None:
        reading = read_run(read_job(directory, own=own), chosen)
        found["told"] = [_told(reading, situation) for situation in range(number)]
        found["score"] = (
            f"{reading.score_words.capitalize()}: {reading.full_score:g} by the best action, "
            f"{reading.distilled_score:g} by the distilled controller."
        )
        found["names"] = [*reading.played.names, chosen.rules.action.name]
    elif found["films"] is None:
        raise Missing(f"{found['why']}")
    return found


def _films(directory: Path, seed: int, config: Config, number: int) -> dict[str, Any]:
    checkpoint = load_checkpoint(directory / "checkpoint.pt")
    return {
        name: [_film(film) for film in play(config, checkpoint, [seed], number, learned=learned)[0]]
        for name, learned in (("after", True), ("before", False))
    }


def _film(film: Film) -> dict[str, Any]:
    shown = [*film[: -1 : _every(len(film) - 1)], film[-1]]
    drawn = [shot for shot in shown if isinstance(shot, DrawnShot)]
    pictures = _of_shapes(drawn) if drawn else _from_above(shown)
    return _ending(film[-1].success, len(film) - 1) | pictures


def _ending(success: bool, steps: int) -> dict[str, Any]:
    return {"success": success, "steps": steps, "every": _every(steps)}


def _every(steps: int) -> int:
    return max(1, ceil(steps / _MOST))


def _of_shapes(film: list[DrawnShot]) -> dict[str, Any]:
    """Return a film as shapes, each with the number of its look and its places."""
    looks: dict[Look, int] = {}

    def plain(shape: Shape) -> list[Any]:
        return [looks.setdefault(shape.look, len(looks)), _rounded(shape.places)]

    last = film[-1]
    trail = last.trail(film)
    found = {
        "limits": _rounded(last.limits()),
        "still": [*map(plain, last.still())],
        "shots": [
            [*map(plain, shot.moving(film[: number + 1]))] for number, shot in enumerate(film)
        ],
        "trail": None if trail is None else plain(trail),
        "trail_shots": last.trail_shots,
    }
    usual = asdict(Look())
    differences = [
        {name: value for name, value in asdict(look).items() if value != usual[name]}
        for look in looks
    ]
    return found | {"looks": differences}


def _from_above(film: Sequence[Any]) -> dict[str, Any]:
    shots = [shot for shot in film if isinstance(shot, Shot)]
    first = asdict(shots[0])
    return {
        "still": {name: _rounded(first[name]) for name in _STILL},
        "kinds": [kind for *_, kind in first["balls"]],
        "shots": [_shot(shot) for shot in shots],
    }


def _shot(shot: Shot) -> dict[str, Any]:
    told: dict[str, Any] = {
        "pose": _rounded(shot.pose),
        "balls": [_rounded(ball[:3]) for ball in shot.balls],
    }
    if shot.bearing_rad is not None:
        told["bearing"] = number_of(shot.bearing_rad)
    if shot.beams:
        told["beams"] = [_rounded(beam) for beam in shot.beams]
    return told


def _told(reading: Reading, situation: int) -> dict[str, Any]:
    """Return a situation's observations, actions and firing strengths, step by step."""
    played = reading.played
    before = played.before[:, 0, situation][played.counts[:, 0, situation]]
    points = torch.cat([before[name] for name in (*played.names, "action")], dim=-1).double()
    columns = [*played.names, reading.chosen.rules.action.name]
    firing = torch.cat(
        [
            part.firing(points[:, [columns.index(each.name) for each in part.inputs]]).flatten(1)
            for part in reading.chosen.parts
        ],
        dim=-1,
    )
    success = bool(played.after["success"][len(points) - 1, 0, situation])
    shown = slice(None, None, _every(len(points)))
    return _ending(success, len(points)) | {
        "seen": [_rounded(point) for point in points[shown].tolist()],
        "fired": [
            [[rule, round(row[rule], 3)] for rule in range(len(row)) if row[rule] >= _LEAST]
            for row in firing[shown].tolist()
        ],
    }


def _rounded(value: Any) -> Any:
    """Return nested sequences of numbers with their digits after the third one cut."""
    if isinstance(value, str | bool) or value is None:
        return value
    if isinstance(value, Sequence):
        return [_rounded(each) for each in value]
    return round(float(value), 3)
