"""Parses a command line into Hydra's flags and overrides."""

from argparse import Namespace
from collections.abc import Sequence

from hydra._internal.utils import get_args_parser

from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.launch.arguments import OneLineParser

_EXCLUSIVE = ("run", "multirun", "cfg", "info", "shell_completion", "hydra_help")
"""The flags that choose what the command does; only one may be given."""


def hydra_arguments(typed: Sequence[str]) -> Namespace:
    """Return the flags and the overrides of a command line, typed in any order.

    ``--lam=0.2`` is taken as the override ``lam=0.2``, because sweep services write overrides like
    this. Hydra's own flags, such as ``--cfg=job``, stay flags.

    Args:
        typed: the arguments of the command.

    Raises:
        ConfigError: if two flags exclude each other, or ``--resolve`` is given without ``--cfg``.
        SystemExit: if a flag is unknown or lacks its value; one line has been printed.
    """
    parser = OneLineParser(parents=[get_args_parser()], add_help=False, conflict_handler="resolve")
    parser.add_argument("--version", action="store_true")  # ours, not Hydra's
    arguments = [
        argument.removeprefix("--")
        if argument.startswith("--")
        and "=" in argument
        # The parser returns arguments that are not flags.
        and parser.parse_known_args([argument])[1]
        else argument
        for argument in typed
    ]
    given, unknown = parser.parse_known_intermixed_args(arguments)
    if unknown:
        parser.error(
            f"{' '.join(unknown)}: there is no such flag; keys are typed as in lam=0.2, "
            "and --help lists both"
        )
    chosen = [name for name in _EXCLUSIVE if getattr(given, name)]
    if len(chosen) > 1:
        words = " and ".join(f"--{name.replace('_', '-')}" for name in chosen)
        raise ConfigError(f"{words} exclude each other")
    if given.resolve and not given.cfg:
        raise ConfigError("--resolve needs --cfg, whose values it resolves")
    given.parser = parser
    return given
