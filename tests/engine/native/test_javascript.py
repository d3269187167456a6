"""What JavaScript computes in Node.js is what torch computes, step by step."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.engine.graphs import leaves
from fnnq_torchrl.engine.loops import Step
from fnnq_torchrl.engine.native.javascript import ARRAYS, module
from fnnq_torchrl.engine.native.translation import written_out
from tests.programs import config, make_learner, make_runs

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="needs Node.js")

_MAIN = """
import fs from "fs";
import { step } from "./step.mjs";
const given = JSON.parse(fs.readFileSync("given.json"));
const leaf = given.leaves.map(([kind, of]) =>
    globalThis[kind].from(kind === "BigInt64Array" ? of.map(BigInt) : of.map(Number)));
const states = [];
for (let n = 0; n < given.steps; ++n) {
    step(leaf);
    states.push(leaf.map((array) => Array.from(array, (x) => String(x))));
}
console.log(JSON.stringify(states));
"""


def numbers(leaf: Tensor) -> list[str]:
    """Return the elements of a leaf's first run as JavaScript reads them."""
    one = leaf[..., 0].flatten()
    return [*map(str, (-one.int() if leaf.dtype is torch.bool else one).tolist())]


def in_javascript(
    directory: Path, step: Step, stays: TensorDictBase, state: TensorDictBase, steps: int
) -> list[list[Tensor]]:
    """Return the leaves of the first run's state after each step, computed by Node.js."""
    (directory / "step.mjs").write_text(module(written_out(step, stays, state)))
    given = [*leaves(stays).values(), *leaves(state).values()]
    (directory / "given.json").write_text(
        json.dumps({"steps": steps, "leaves": [[ARRAYS[one.dtype], numbers(one)] for one in given]})
    )
    (directory / "main.mjs").write_text(_MAIN)
    told = subprocess.run(
        ["node", "main.mjs"], cwd=directory, check=True, capture_output=True, text=True
    )
    first = len(leaves(stays))
    return [
        [torch.tensor([float(x) for x in leaf], dtype=torch.float64) for leaf in after[first:]]
        for after in json.loads(told.stdout)
    ]


@pytest.mark.parametrize(
    "overrides",
    [
        ("lam=0.8",),
        ("value=mlp", "value.widths=[32]", "exploration=boltzmann"),
        ("machine.dtype=float64", "variant=watkins", "trace=replacing"),
    ],
)
@torch.no_grad()
def test_a_run_learns_in_javascript(tmp_path: Path, overrides: tuple[str, ...]) -> None:
    of = config(*overrides)
    run = make_runs(of, 2)
    learner = make_learner(of, run)
    state: TensorDictBase = learner.begin(run)
    for computed in in_javascript(tmp_path, learner.step, run, state, 20):
        state = learner.step(run, state)
        for (name, leaf), ours in zip(leaves(state).items(), computed, strict=True):
            sign = -1 if leaf.dtype is torch.bool else 1
            theirs = sign * leaf[..., 0].flatten().double()
            assert torch.allclose(ours, theirs, rtol=1e-5, atol=1e-6), name


def test_every_operation_is_the_same(tmp_path: Path) -> None:
    """Whole numbers wrap, NaN stays, halves are rounded to even, and shifts keep the sign."""
    real = torch.tensor([[0.5, -1.5, 2.5, torch.nan, 3e38, -0.0, 1e-3]]).expand(2, -1)
    whole = torch.tensor([[2**31 - 1, -(2**31), 7, -7]], dtype=torch.int32).expand(2, -1)
    long = torch.tensor([[2**63 - 1, -(2**62), 5, -5]]).expand(2, -1)

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        x, n, k = stays["x"], stays["n"], stays["k"]
        x2 = torch.stack([x * 10, x.round(), x.floor(), x.abs().sqrt(), x.clamp(-1, 1)])
        n2 = torch.stack([n * 1664525 + 1013904223, n >> 3, -n, n ^ 5, n & 12])
        k2 = torch.stack([k * 3, k >> 40, k << 3, (k + 1).minimum(k), k.to(torch.int32).long()])
        return TensorDict(
            {
                "x": x2.movedim(0, 1),
                "n": n2.movedim(0, 1),
                "k": k2.movedim(0, 1),
                "p": (x > 0) & ~(x == 2.5) | x.isnan(),
                "f": torch.where(x > 0, k.sum(-1, keepdim=True).to(x.dtype), x.sin()),
            },
            state.batch_size,
        )

    stays = TensorDict({"x": real, "n": whole, "k": long}, [2])
    state = step(stays, stays).apply(torch.zeros_like)
    (computed,) = in_javascript(tmp_path, step, stays, state, 1)
    for (name, leaf), ours in zip(leaves(step(stays, state)).items(), computed, strict=True):
        sign = -1 if leaf.dtype is torch.bool else 1
        theirs = sign * leaf[..., 0].flatten().double()
        assert torch.allclose(ours, theirs, rtol=1e-6, atol=0, equal_nan=True), name
