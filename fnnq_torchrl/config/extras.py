"""The optional libraries: the extras of pyproject.toml."""

import re
import shlex
from importlib.metadata import requires


def installing(extra: str) -> str:
    """Return the pip command that installs the libraries of an extra."""
    marker = re.compile(rf"""extra == ["']{re.escape(extra)}["']""")
    libraries = [
        requirement.partition(";")[0].strip()
        for requirement in requires("fnnq_torchrl") or []
        if marker.search(requirement)
    ]
    return f"pip install {shlex.join(libraries)}"
