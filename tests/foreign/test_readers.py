"""Other programs compute the same numbers from our files as we do."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl import RuleBase, load_config
from fnnq_torchrl.agent.rules import Label, Variable, partition

from .readers import (
    Numbers,
    compiled,
    cpp_fuzzylite,
    octave,
    onnxruntime,
    pyfuzzylite,
)

pytestmark = pytest.mark.foreign

POINTS = 10_000
BY_EVALFIS = 50
"""The points that Octave's slow `evalfis` gets."""

KINDS = (
    Label("sinking", "sigmoid", (-0.6, -9.0)),
    Label("three", "triangle", (-0.9, -0.5, 0.1)),
    Label("four", "trapezoid", (-0.4, -0.2, 0.3, 0.6)),
    Label("round", "bell", (0.2, 0.3, 2.5)),
    Label("wide", "gaussian_two_sided", (0.3, 0.2, 0.5, 0.3)),
    Label("rising", "sigmoid", (0.7, 12.0)),
)
STEPS = (
    Label("low", "triangle", (-1.0, -1.0, 0.0)),
    Label("middle", "triangle", (-1.0, 0.0, 1.0)),
    Label("high", "trapezoid", (0.0, 0.8, 1.0, 1.0)),
)


def rule_base(name: str) -> RuleBase:
    """Return random rules on the paper's labels, or on labels of every kind with either t-norm.

    One of the latter has the name of a FuzzyLite function.
    """
    random = torch.Generator().manual_seed(3)
    if name == "paper":
        config = load_config()
        inputs = partition(config.value, config.env)
    else:
        steer = Variable("steer", STEPS, -1, 1)
        inputs = (Variable("bearing", KINDS, -1, 1), Variable("speed", STEPS, -1, 1), steer)
    shape = [len(variable.labels) for variable in inputs]
    consequents = torch.randn(shape, generator=random, dtype=torch.float64)
    return RuleBase(inputs, "value", consequents, "minimum" if name == "minimum" else "product")


def points_of(rules: RuleBase, seed: int = 5) -> Numbers:
    """Return ten thousand points in the ranges, with the corners and the labels' parameters."""
    count = len(rules.inputs)
    special = [-1.0, 1.0, 0.0] + [
        number
        for variable in rules.inputs
        for label in variable.labels
        for number in label.parameters
        if -1 <= number <= 1
    ]
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * count), axis=-1).reshape(-1, count)
    random = np.random.default_rng(seed)
    chosen = random.choice(special, (2_000, count))
    return np.concatenate(
        [corners, chosen, random.uniform(-1, 1, (POINTS - len(corners) - 2_000, count))]
    )


def ours(rules: RuleBase, points: Numbers) -> Numbers:
    return rules.evaluate(torch.from_numpy(points)).numpy()


@pytest.fixture(params=["paper", "product", "minimum"])
def rules(request: pytest.FixtureRequest) -> RuleBase:
    return rule_base(request.param)


def test_fll_in_python(rules: RuleBase, tmp_path: Path) -> None:
    """Far outside the ranges, the value is that of the nearest point inside."""
    (file,) = rules.export(tmp_path / "q.fll")
    points = points_of(rules)
    np.testing.assert_allclose(pyfuzzylite(file, points), ours(rules, points), atol=1e-9)
    far = 100 * points[-200:]
    inside = ours(rules, far.clip(-1, 1))
    np.testing.assert_allclose(pyfuzzylite(file, far), inside, atol=1e-9)


@pytest.mark.parametrize("ending", [".fll", ".fis"])
def test_fll_and_fis_in_cpp(rules: RuleBase, ending: str, tmp_path: Path) -> None:
    """C++ fuzzylite drops rules that fire below 1e-6."""
    (file,) = rules.export(tmp_path / f"q{ending}")
    points = points_of(rules)
    given = cpp_fuzzylite(file, points)
    np.testing.assert_allclose(given, ours(rules, points), rtol=0, atol=1e-5)
    if ending == ".fll":
        far = 100 * points[-200:]
        inside = ours(rules, far.clip(-1, 1))
        np.testing.assert_allclose(cpp_fuzzylite(file, far), inside, rtol=0, atol=1e-5)


def test_fis_in_octave(rules: RuleBase, tmp_path: Path) -> None:
    """The toolkit refuses vertical sides and fractional slopes."""
    slanted = {
        (-1.0, -1.0, 0.0): (-2.0, -1.0, 0.0),
        (0.0, 0.8, 1.0, 1.0): (0.0, 0.8, 1.0, 2.0),
        (0.2, 0.3, 2.5): (0.2, 0.3, 2.0),
    }
    inputs = tuple(
        replace(
            each,
            labels=tuple(
                replace(label, parameters=slanted.get(label.parameters, label.parameters))
                for label in each.labels
            ),
        )
        for each in rules.inputs
    )
    rules = replace(rules, inputs=inputs)
    (file,) = rules.export(tmp_path / "q.fis")
    points = points_of(rules)
    given = octave(file, points, BY_EVALFIS)
    np.testing.assert_allclose(given, ours(rules, points), rtol=0, atol=1e-9)


def test_the_distilled_controller_in_fuzzylite_octave_onnx_and_c(tmp_path: Path) -> None:
    rules = rule_base("paper")
    distilled, points = rules.controller().distilled, points_of(rules)[:, :1]
    expected = distilled.evaluate(torch.from_numpy(points)).numpy()
    by_octave = partial(octave, whole=BY_EVALFIS)
    for ending, reader in ((".fll", pyfuzzylite), (".fis", by_octave), (".onnx", onnxruntime)):
        (file,) = rules.export(tmp_path / f"d{ending}", controller="distilled")
        np.testing.assert_allclose(reader(file, points), expected, atol=1e-9)
    source, _ = rules.export(tmp_path / "d.c", controller="distilled")
    given = compiled("gcc", source, "d_output(x)", points)
    np.testing.assert_allclose(given, expected, atol=1e-9)


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("floats", [False, True])
def test_c(rules: RuleBase, compiler: str, floats: bool, tmp_path: Path) -> None:
    """Q agrees far outside the ranges too, and the greedy action agrees except at ties."""
    source, _ = rules.export(tmp_path / "ctl.c", floats=floats)
    real, precision = ("float", 1e-4) if floats else ("double", 1e-9)
    points = points_of(rules)
    points[-100:] *= 30
    states, last = points[:, :-1], points.shape[1] - 1
    q = compiled(compiler, source, f"ctl_q(x, x[{last}])", points, real)
    np.testing.assert_allclose(q, ours(rules, points), atol=precision)
    values = rules.action_values(torch.from_numpy(states))
    first, second = values.topk(2).values.T
    clear = (first - second > precision).numpy()
    greedy = compiled(compiler, source, "ctl_greedy(x)", states, real)
    expected = rules.greedy(torch.from_numpy(states)).numpy()
    np.testing.assert_allclose(greedy[clear], expected[clear], atol=1e-6)
    assert clear.mean() > 0.9


@pytest.mark.parametrize("floats", [False, True])
def test_onnx(rules: RuleBase, floats: bool, tmp_path: Path) -> None:
    points = points_of(rules)
    states, actions = points[:, :-1], points[:, -1:]
    (file,) = rules.export(tmp_path / "q.onnx", floats=floats)
    precision = 1e-4 if floats else 1e-9
    q = onnxruntime(file, states, actions)
    np.testing.assert_allclose(q, ours(rules, points), atol=precision)
    (file,) = rules.export(tmp_path / "greedy.onnx", controller="full", floats=floats)
    first, second = rules.action_values(torch.from_numpy(states)).topk(2).values.T
    clear = (first - second > precision).numpy()
    expected = rules.greedy(torch.from_numpy(states)).numpy()
    np.testing.assert_allclose(onnxruntime(file, states)[clear], expected[clear], atol=1e-6)


@pytest.mark.parametrize("elsewhere", ["zero", "nearest"])
def test_gaps_between_labels(elsewhere: str, tmp_path: Path) -> None:
    """FuzzyLite has one value for all gaps; C computes what the network does."""
    low = Label("low", "triangle", (-0.9, -0.5, -0.1))
    high = Label("high", "trapezoid", (0.2, 0.3, 0.5, 0.8))
    inputs = (Variable("bearing", (low, high), -1, 1), Variable("steer", STEPS, -1, 1))
    random = torch.Generator().manual_seed(3)
    consequents = torch.randn(2, 3, generator=random, dtype=torch.float64)
    rules = RuleBase(inputs, "value", consequents, elsewhere=elsewhere)
    points = points_of(rules)
    source, _ = rules.export(tmp_path / "ctl.c")
    q = compiled("gcc", source, "ctl_q(x, x[1])", points)
    np.testing.assert_allclose(q, ours(rules, points), rtol=0, atol=1e-9)
    if elsewhere == "zero":
        (file,) = rules.export(tmp_path / "q.fll")
        np.testing.assert_allclose(pyfuzzylite(file, points), ours(rules, points), atol=1e-9)
        given = cpp_fuzzylite(file, points)
        np.testing.assert_allclose(given, ours(rules, points), rtol=0, atol=1e-5)
