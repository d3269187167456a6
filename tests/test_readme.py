"""The README: its example in Python works as it stands and learns what the engine learns."""

import re
from pathlib import Path

import pytest
import torch

from fnnq_torchrl.launch.composition import load_config
from tests.programs import advance, make_learner, make_runs

README = Path(__file__).parents[1] / "README.md"
RUNS, STEPS = 8, 130
"""Runs, and steps: more than an episode has, so that traces end and some runs decay their α."""


def example(steps: int) -> dict:
    """Run the example with the given number of steps, and return its variables by name."""
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    shorter = code.replace("range(3000)", f"range({steps})").replace("rollout(1000", "rollout(130")
    assert len(shorter) == len(code) - 2
    names: dict = {}
    exec(shorter, names)  # noqa: S102  # our own README
    return names


def test_the_example_learns_what_the_learning_step_learns(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The weights agree to rounding: the optimiser adds up in another order."""
    names = example(STEPS)
    weight = names["value"].weight.detach()
    assert weight.abs().sum(dim=(1, 2)).min() > 0
    assert names["alpha"].min() < 0.4
    runs = make_runs(load_config("lam=0.2"), RUNS)
    state = advance(make_learner(load_config("lam=0.2"), runs), runs, STEPS)
    torch.testing.assert_close(weight, state["weights", "weight"], rtol=1e-4, atol=1e-6)
    assert re.fullmatch(r"\d+% of the balls caught\n", capsys.readouterr().out)


def test_it_is_short() -> None:
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 130
