"""The committed pages have the texts of their templates."""

import re
from pathlib import Path
from string import Formatter

import pytest

from benchmarks.peers.page import _TEMPLATE as PEERS
from fnnq_torchrl.studies.adaptive.page import _PAGE as ADAPTIVE
from fnnq_torchrl.studies.extrapolation.page import _PAGE as EXTRAPOLATION
from fnnq_torchrl.studies.memberships.page import _PAGE as MEMBERSHIPS
from fnnq_torchrl.studies.reproduction.page import _BEGINNING
from fnnq_torchrl.studies.reproduction.readings import _READINGS

DOCS = Path(__file__).parents[2] / "docs"


def fixed_parts(template: str) -> list[str]:
    """Return the texts between a template's fields."""
    return [text for text, *_ in Formatter().parse(template) if text]


@pytest.mark.parametrize(
    ("page", "templates"),
    [
        ("reproduction", [_BEGINNING, _READINGS]),
        ("adaptive", [ADAPTIVE]),
        ("extrapolation", [EXTRAPOLATION]),
        ("memberships", [MEMBERSHIPS]),
        ("peers", [re.sub(r"\$(\w+)", r"{\1}", PEERS.template)]),
    ],
)
def test_a_committed_page_is_what_its_template_writes(page: str, templates: list[str]) -> None:
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    at = 0
    for part in [part for template in templates for part in fixed_parts(template)]:
        found = text.find(part, at)
        assert found >= 0, part
        at = found + len(part)
