"""The README's example in Python: it works as it stands, and learns what the engine learns."""

import re
from dataclasses import replace
from pathlib import Path

import torch

from fnnq_torchrl.launch.composition import load_config
from tests.programs import advance, make_learner, make_runs

README = Path(__file__).parents[1] / "README.md"
RUNS, STEPS = 8, 130
"""More steps than an episode has, so that traces end."""


def example(steps: int) -> dict:
    """Run the example for so many steps, and return its variables."""
    (code,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    shorter = code.replace("range(1000)", f"range({steps})")
    assert shorter != code
    names: dict = {}
    exec(shorter, names)  # noqa: S102  # our own README
    return names


def test_the_example_learns_what_the_learning_step_learns() -> None:
    """To rounding: the optimiser adds up in another order. And with a constant α, as SGD has it."""
    weight = example(STEPS)["value"].weight.detach()
    assert weight.abs().sum(dim=(1, 2)).min() > 0
    config = replace(load_config("lam=0.2"), alpha_decay=1.0)
    runs = make_runs(config, RUNS)
    state = advance(make_learner(config, runs), runs, STEPS)
    torch.testing.assert_close(weight, state["weights", "weight"], rtol=1e-4, atol=1e-6)
