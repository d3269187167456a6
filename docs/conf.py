"""Sphinx's configuration of the documentation: ``make docs`` writes the site to docs/_site."""

import re
import sys
import tomllib
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "extensions"))

from configuration import anchor  # noqa: E402

project = "fnnq_torchrl"
author = "the fnnq_torchrl authors"
with (ROOT / "pyproject.toml").open("rb") as file:
    version = release = tomllib.load(file)["project"]["version"]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "configuration",
    "mathml",
]
exclude_patterns = ["_site"]
highlight_language = "text"

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

napoleon_use_ivar = True
autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"

html_theme = "furo"
html_title = f"fnnq_torchrl {version}"
html_math_renderer = "mathml"
html_copy_source = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_copyright = False

_ELSEWHERE = {
    "../README.md#in-python": "quickstart.md#in-python",
    "../README.md": "index.md",
    "../conf": "configuration.md",
    "../CONTRIBUTING.md": "contributing.md",
    "../CHANGELOG.md": "changelog.md",
}
"""The pages of the site for links to files outside docs/."""


def _link_inside(app: Sphinx, page: str, source: list[str]) -> None:
    """Replace links to files outside docs/ by links to pages of the site."""

    def inside(link: re.Match[str]) -> str:
        target = link[1]
        if target.startswith("../conf/"):
            return f"](configuration.md#{anchor(target.removeprefix('../'))})"
        return f"]({_ELSEWHERE.get(target, target)})"

    source[0] = re.sub(r"\]\((\.\./[^)\s]*)\)", inside, source[0])


def _bars(app: Sphinx, what: str, name: str, of: object, options: object, lines: list[str]) -> None:
    """Escape the bars of |x| in docstrings: they would begin a substitution."""
    for number, line in enumerate(lines):
        parts = re.split(r"(``.*?``)", line)
        parts[::2] = (text.replace("|", r"\|") for text in parts[::2])
        lines[number] = "".join(parts)


def setup(app: Sphinx) -> None:
    """Register the changes to the sources."""
    app.connect("autodoc-process-docstring", _bars)
    app.connect("source-read", _link_inside)
