"""The start of a visit to a page in Chromium, from a test."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
PYTHON = HERE / ".venv" / "bin" / "python"
"""The environment that `make browser` makes."""


def visited(visit: str, page: Path) -> dict[str, Any]:
    """Return what a visit to a page sees.

    Args:
        visit: the name of the program in this directory that visits the page.
        page: the page's file.
    """
    chromium = shutil.which("chromium") or shutil.which("google-chrome")
    if chromium is None:
        pytest.fail("Chromium is missing: apt-get install chromium", pytrace=False)
    done = subprocess.run(
        [PYTHON, HERE / visit, page, chromium], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    found: dict[str, Any] = json.loads(done.stdout)
    return found
