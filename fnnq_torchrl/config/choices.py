"""The YAML files of ``conf/``, which are the choices that each of its groups has."""

from pathlib import Path


def config_directory() -> Path:
    """``fnnq_torchrl/conf``, where the wheel puts it, or else the checkout's top-level ``conf``."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "conf"
    return installed if installed.is_dir() else package.parent / "conf"


def choices_of(group: str) -> list[str]:
    """The names of a group's files, in their order; none, if there is no such group.

    A file whose name begins with ``_`` is a part of others.
    """
    return sorted(path.stem for path in (config_directory() / group).glob("[!_]*.yaml"))
