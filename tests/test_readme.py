"""The README's example in Python works as it stands, for fewer steps."""

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_example_learns():
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    shorter = code.replace("range(1000)", "range(121)")
    assert shorter != code
    names = {}
    exec(shorter, names)  # noqa: S102  # our own README
    weight = names["value"].weight
    assert weight.abs().sum(dim=(1, 2)).min() > 0
