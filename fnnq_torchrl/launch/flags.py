"""The flags of a command, which are Hydra's: ``python -m fnnq_torchrl.train --hydra-help``."""

import re
import shlex
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import OverrideParseException

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.arguments import OneLineParser
from fnnq_torchrl.launch.composition import key_of

_SWEEPS = ("-m", "--multirun")

_DISTRUSTED = (
    "what a job has left is not to be trusted as configuration; "
    "type what is in its overrides.yaml instead"
)


def check_flags(program: str, arguments: Sequence[str]) -> None:
    """Refuse what Hydra would answer with a page or a traceback, or what could run foreign code.

    Args:
        program: as it was called, ``sys.argv[0]``.
        arguments: the others.

    Raises:
        ConfigError: a flag is in the wrong place, or not allowed; one line.
        SystemExit: there is no such flag, which is told.
    """
    # Hydra's parser takes its flags before or after the overrides, and not between them.
    for flag in _SWEEPS:
        if flag in arguments:
            place = arguments.index(flag)
            before, behind = arguments[:place], arguments[place + 1 :]
            if all(any("=" in each for each in side) for side in (before, behind)):
                others = [argument for argument in arguments if argument != flag]
                raise ConfigError(f"{flag} goes last; type {as_typed(program, *others, flag)}")
    given = OneLineParser(parents=[get_args_parser()], add_help=False).parse_args(arguments)
    if given.experimental_rerun is not None:
        raise ConfigError(
            "--experimental-rerun: reads a pickle, which can run any code; "
            "type what is in the job's .hydra/overrides.yaml instead"
        )
    for argument in (f"--config-name {given.config_name}", *given.overrides):
        if ".hydra" in re.split(r"[^\w.-]", argument):
            raise ConfigError(f"{argument}: {_DISTRUSTED}")
    for flag, directory in (
        ("--config-path", given.config_path),
        ("--config-dir", given.config_dir),
        *(("hydra.searchpath:", directory) for directory in _searched(given.overrides)),
    ):
        if directory is not None and ".hydra" in Path(directory).resolve().parts:
            raise ConfigError(f"{flag} {directory}: {_DISTRUSTED}")
    if given.resolve and not (given.cfg or given.help):
        raise ConfigError("--resolve: goes with --cfg job, --cfg hydra or --cfg all")


def _searched(overrides: Sequence[str]) -> Iterator[str]:
    """The directories that overrides have Hydra look for configuration in."""
    for override in overrides:
        if key_of(override) == "hydra.searchpath":
            with suppress(OverrideParseException):  # Hydra finds that out too
                value = OverridesParser.create().parse_override(override).value()
                for directory in value if isinstance(value, list) else [value]:
                    yield str(directory).removeprefix("file://")


def only_shows() -> bool:
    """Whether the flags ask for something to be shown, and nothing is to be run."""
    given, _ = get_args_parser().parse_known_args(sys.argv[1:])
    return bool(given.cfg or given.info or given.help or given.hydra_help)


def as_typed(program: str, *arguments: str) -> str:
    """A command as one would type it."""
    name = Path(program).name
    begin = f"python -m fnnq_torchrl.{Path(name).stem}" if name.endswith(".py") else name
    return f"{begin} {shlex.join(arguments)}"
