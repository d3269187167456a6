"""The choices of each group of the configuration: the YAML files of ``conf/``."""

from pathlib import Path


def config_directory() -> Path:
    """Return the wheel's ``fnnq_torchrl/conf`` if it exists, else the checkout's ``conf``."""
    package = Path(__file__).resolve().parents[1]
    installed = package / "conf"
    return installed if installed.is_dir() else package.parent / "conf"


def choices_of(group: str) -> list[str]:
    """Return the sorted names of a group's files; none for an unknown group."""
    return sorted(path.stem for path in (config_directory() / group).glob("*.yaml"))
