"""The value functions that can take the fuzzy network's place."""

import math
import re
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from itertools import product
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import (
    MLPValue,
    TilesSumValue,
    TilesValue,
    ValueNetwork,
    make_value_network,
)
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.config.values import SCHEMAS
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.native import NativeLoop
from fnnq_torchrl.training.weights import load_checkpoint
from tests.compositions import config_of
from tests.oracles import approximators
from tests.oracles.fuzzy import value_of_rules
from tests.programs import SMALL_WORLD, advance, config, in_lanes, make_learner, make_runs

CANDIDATES = torch.linspace(-1, 1, 21, dtype=torch.float64)
RUNS = 3
MIXED = (
    "value.inputs.bearing=[[-0.5,0.4],{triangle:[-0.4,-0.1,0]},{trapezoid:[-0.2,0,0,0.1]},"
    "{bell:[0.2,0.1,2]},{sigmoid:[0.5,10]},{gaussian_two_sided:[0.3,0.1,0.4,0.2]}]"
)
GAPS = (
    "value.inputs.bearing=[{triangle:[-0.9,-0.5,0]},{trapezoid:[0.1,0.2,0.3,0.6]}]",
    "value.action=[{triangle:[-1,-0.7,-0.1]},{triangle:[0.1,1,1]}]",
)
MINIMUM, ZERO = "value.t_norm=minimum", "value.elsewhere=zero"
VARIANTS = {
    **{kind: (f"value={kind}",) for kind in SCHEMAS},
    "mlp": ("value=mlp", "value.widths=[6]"),
    "mlp_each": ("value=mlp", "value.widths=[6]", "value.outputs=each", "value.normalise=true"),
    "tiles": ("value=tiles", "value.tilings=4", "value.tiles=3"),
    "tiles_sum": ("value=tiles_sum", "value.tilings=4", "value.tiles=3"),
    "hashed": ("value=tiles", "value.tilings=4", "value.tiles=3", "value.memory=7"),
    "mixed": (MIXED,),
    "nearest": GAPS,
    "zero": (*GAPS, ZERO),
    "minimum": (MINIMUM,),
    "minimum_mixed": (MIXED, MINIMUM),
    "minimum_zero": (*GAPS, MINIMUM, ZERO),
    "learned": ("value.learn_memberships=true",),
    "rbf_mixed": ("value=rbf", MIXED),
    "table_zero": ("value=table", *GAPS, ZERO),
}
"""Overrides for each value function and its variants, by name."""

COMPILED = [
    # tests/engine/test_loops.py has fnnq, tiles and mlp.
    pytest.param(name, marks=[pytest.mark.long] * (name != "mixed"))
    for name in (*SCHEMAS, "mixed", "nearest", "minimum_zero", "learned")
]

IN_DOUBLE = ("alpha=0.1", "machine.dtype=float64")

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "values.md"

numbers = st.integers(-200, 200).map(lambda n: n / 101)  # the only border of cells or tiles is 0


def make(kind: str, *overrides: str) -> ValueNetwork:
    return with_random_weights(f"value={kind}", *overrides)


@cache
def with_random_weights(*overrides: str) -> ValueNetwork:
    """Return a network with random weights."""
    network = make_value_network(config_of(*overrides).value, CANDIDATES, RUNS)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weight in network.parameters():
            weight.normal_(generator=generator)
    return network


def q_of(network: ValueNetwork, bearing: float, action: float) -> list[float]:
    """Return Q(s, a) of each run."""
    s, a = (torch.full((RUNS, 1), x, dtype=torch.float64) for x in (bearing, action))
    return network(s, action=a).squeeze(-1).tolist()


def weights_of(network: ValueNetwork, run: int) -> dict[str, list]:
    return {name: weight[run].tolist() for name, weight in network.named_parameters()}


def by_labels(
    oracle: Callable[..., float], network: ValueNetwork, bearing: float, action: float
) -> list[float]:
    """Return each run's value in plain Python, from its weights and the default labels."""
    labels = config().value
    where = labels.inputs["bearing"], labels.action, bearing, action
    return [oracle(weights_of(network, run)["weight"], *where) for run in range(RUNS)]


@pytest.mark.parametrize("name", [name for name in VARIANTS if name != "fuzzy_q"])
@pytest.mark.parametrize("batch", [(), (4,), (4, 2)])
def test_a_candidate_has_the_value_of_that_action(name: str, batch: tuple[int, ...]) -> None:
    network = with_random_weights(*VARIANTS[name])
    generator = torch.Generator().manual_seed(1)
    bearing = torch.rand(RUNS, *batch, 1, generator=generator, dtype=torch.float64) * 3 - 1.5
    values = network(bearing)
    assert values.shape == (RUNS, *batch, 21)
    for number in (0, 7, 20):
        alone = network(bearing, action=CANDIDATES[number].expand_as(bearing))
        torch.testing.assert_close(alone, values[..., number : number + 1])


@given(numbers, numbers)
def test_radial_basis_functions(bearing: float, action: float) -> None:
    network = make("rbf")
    expected = by_labels(approximators.radial, network, bearing, action)
    assert q_of(network, bearing, action) == pytest.approx(expected, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize(
    "name",
    ["mixed", "nearest", "zero", "minimum", "minimum_mixed", "minimum_zero", "learned"],
)
@settings(max_examples=15)
@given(numbers, numbers)
def test_rules_of_any_labels_and_both_t_norms(name: str, bearing: float, action: float) -> None:
    network = with_random_weights(*VARIANTS[name])
    expected = [
        value_of_rules(
            network.weight[run].flatten().tolist(),
            (bearing, action),
            [[{kind: numbers} for kind, numbers in of] for of in network.labels_of(run)],
            "minimum" if MINIMUM in VARIANTS[name] else "product",
            "zero" if ZERO in VARIANTS[name] else "nearest",
        )
        for run in range(RUNS)
    ]
    assert q_of(network, bearing, action) == pytest.approx(expected, rel=1e-6, abs=1e-9)


@given(numbers, numbers.filter(bool))
def test_a_look_up_table(bearing: float, action: float) -> None:
    network = make("table")
    expected = by_labels(approximators.looked_up, network, bearing, action)
    assert q_of(network, bearing, action) == pytest.approx(expected, rel=1e-12)


def test_a_border_of_the_table_belongs_half_to_either_cell() -> None:
    network = make("table")
    for run, value in enumerate(q_of(network, 0.0, 0.0)):  # between the action labels −0.4 and 0.4
        row = weights_of(network, run)["weight"][2]
        assert value == pytest.approx((row[1] + row[2]) / 2)


@given(numbers, numbers)
def test_tile_coding(bearing: float, action: float) -> None:
    network = make("tiles")
    expected = [
        approximators.coded(
            weights_of(network, run)["weight"], [(-1, 1), (-1, 1)], 8, 8, bearing, action
        )
        for run in range(RUNS)
    ]
    assert q_of(network, bearing, action) == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_tiles_over_groups_of_inputs_add_up() -> None:
    spans = {"x": (-1, 1), "y": (0, 2)}
    network = TilesSumValue(spans, (-1, 1), [["x"], ["y"]], CANDIDATES, tilings=4, tiles=3, runs=1)
    weights = {}
    for name, part in zip(spans, network.parts, strict=True):
        with torch.no_grad():
            part.weight.normal_()
        weights[name] = part.weight[0].tolist()
    for x, y, action in ((-0.7, 0.1, 0.5), (0.3, 1.9, -1.0), (5.0, -3.0, 0.9)):
        at = [torch.tensor([[number]], dtype=torch.float64) for number in (x, y)]
        expected = sum(
            approximators.coded(weights[name], [spans[name], (-1, 1)], 4, 3, number, action)
            for name, number in (("x", x), ("y", y))
        )
        given = torch.tensor([[action]], dtype=torch.float64)
        assert network(*at, action=given).item() == pytest.approx(expected)


def test_hashed_tiles_share_the_weights_that_are_counted() -> None:
    """A tile's weight is found by its gradient; pairs of tiles are counted one by one."""
    inputs = {"x": (0, 3), "y": (0, 3)}
    candidates = torch.tensor([0.0, 1.0], dtype=torch.float64)
    network = TilesValue(inputs, None, candidates, tilings=1, tiles=3, memory=11)
    [places] = network._place(torch.arange(32, dtype=torch.int32).expand(1, -1)).tolist()
    assert network.weight.shape == (1, 11, 1)
    for i, j in product(range(3), repeat=2):
        at = [torch.tensor([[number + 0.5]], dtype=torch.float64) for number in (i, j)]
        for action, value in enumerate(network(*at)[0]):
            (slope,) = torch.autograd.grad(value, network.weight, retain_graph=True)
            assert slope.flatten().nonzero().item() == places[(4 * i + j) * 2 + action]
    shared = sum(places[i] == places[j] for i in range(32) for j in range(i))
    assert network.shared() == (32, 11, shared)
    assert shared > 0
    roomy = TilesValue(inputs, None, candidates, tilings=2, tiles=3, memory=32)
    assert roomy.weight.shape == (1, 4, 4, 2, 2)
    assert roomy.shared() == (64, 64, 0)


def test_a_hash_spreads_tiles_evenly() -> None:
    """The numbers of tiles of each weight are about Poisson's: variance 20 around a mean of 20."""
    inputs = dict.fromkeys("abcd", (0, 1))
    network = TilesValue(inputs, (0, 1), CANDIDATES[:2], tilings=2, tiles=6, memory=840)
    cells = torch.arange(7**5, dtype=torch.int32).expand(2, -1)
    for places in network._place(cells):
        counts = torch.bincount(places, minlength=840).double()
        assert len(counts) == 840
        assert counts.var().item() == pytest.approx(20, rel=0.25)
    first, second = network._place(cells)
    assert (first == second).double().mean().item() == pytest.approx(1 / 840, abs=0.001)


def test_tiles_share_less_the_farther_apart_they_are() -> None:
    network = make("tiles")
    for distance, tilings in ((0.0, 8), (0.03125, 7), (0.125, 4), (0.25, 0)):
        at = torch.tensor([[-1.0 + 1e-9], [-1.0 + 1e-9 + distance]], dtype=torch.float64)
        first, second = (network._tile(0, x.view(1)) for x in at)
        assert (first == second).sum() == tilings


@pytest.mark.parametrize("layer_norm", ["false", "true"])
@pytest.mark.parametrize(
    ("name", "activation"),
    [
        ("tanh", math.tanh),
        ("relu", lambda x: max(x, 0.0)),
        ("leaky_relu", lambda x: max(x, 0.01 * x)),
    ],
)
@settings(max_examples=10)
@given(numbers, numbers)
def test_a_perceptron(name, activation, layer_norm, bearing: float, action: float) -> None:
    network = make(
        "mlp", "value.widths=[4,3]", f"value.activation={name}", f"value.layer_norm={layer_norm}"
    )
    expected = []
    for run in range(RUNS):
        weights = weights_of(network, run)
        layers = [(weights[f"weight_{i}"], weights[f"bias_{i}"]) for i in range(3)]
        expected.append(
            approximators.perceptron(layers, activation, layer_norm == "true", bearing, action)
        )
    assert q_of(network, bearing, action) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_an_unknown_activation_is_refused() -> None:
    with pytest.raises(ValueError, match="must be one of tanh, relu, leaky_relu"):
        MLPValue(["bearing"], CANDIDATES, widths=[2], activation="sine")


@pytest.mark.parametrize(("sparsity", "zeros"), [(0.0, [0, 0]), (0.5, [1, 4]), (0.9, [1, 7])])
def test_a_perceptrons_start(sparsity: float, zeros: list[int]) -> None:
    network = MLPValue(
        ["bearing"], CANDIDATES, widths=[8, 500], activation="relu", sparsity=sparsity
    )
    start = network.start(torch.tensor([[3], [2**62], [3]]))
    for layer, inputs in enumerate((2, 8)):
        weight = start[f"weight_{layer}"]
        assert ((weight == 0).sum(-1) == zeros[layer]).all()
        assert weight.abs().max() <= 1 / math.sqrt(inputs)
        assert (start[f"bias_{layer}"] == 0).all()
        assert torch.equal(weight[0], weight[2])
        assert not torch.equal(weight[0], weight[1])
    # Not all units have their zeros at the same inputs; the other weights are uniform.
    weight = start["weight_1"][0]
    assert sparsity == 0 or len((weight == 0).unique(dim=0)) > 1
    drawn = weight[weight != 0] * math.sqrt(8)
    assert abs(drawn.mean()) < 5 / math.sqrt(3 * len(drawn))
    assert abs(drawn.square().mean() - 1 / 3) < 5 * math.sqrt(4 / 45 / len(drawn))


@pytest.mark.parametrize("name", VARIANTS)
def test_a_run_alone_is_the_run_in_a_batch(name: str) -> None:
    small = config("alpha=0.1", *VARIANTS[name])
    runs = make_runs(small, 2 * LANES, lam=torch.linspace(0, 1, 2 * LANES))
    alone = in_lanes(runs[37:38])
    together = advance(make_learner(small, runs), runs, 30)["weights"]
    single = advance(make_learner(small, alone), alone, 30)["weights"]
    for of, weight in together.items():
        assert torch.equal(weight[37], single[of][0])
        assert of == "seen_samples" or not torch.equal(weight[36], weight[37])


@pytest.mark.usefixtures("compiler")
@pytest.mark.parametrize("name", COMPILED)
def test_compiled_is_eager(name: str) -> None:
    agrees_with_the_compiled(config(*IN_DOUBLE, *VARIANTS[name]))


@pytest.mark.long
@pytest.mark.usefixtures("compiler")
def test_a_compiled_value_function_of_ones_own_is_eager(there: Path) -> None:
    agrees_with_the_compiled(fourier_config(there, *IN_DOUBLE, *SMALL_WORLD, "value.order=3"))


def agrees_with_the_compiled(small: Config) -> None:
    """Check that the eager learning step and its native loop learn the same weights."""
    runs = make_runs(small, LANES, lam=torch.linspace(0, 1, LANES))
    learner = make_learner(small, runs)
    expected = advance(learner, runs, 20)["weights"]
    loop = NativeLoop(
        lambda lanes: make_learner(small, runs[:lanes]).step, runs, learner.begin(runs)
    )
    running = loop(runs, learner.begin(runs))
    running.advance(20)
    for of, weight in expected.items():
        torch.testing.assert_close(running.state["weights", of], weight, rtol=1e-9, atol=1e-12)


def test_a_bearing_beyond_the_range_has_the_tile_at_the_edge() -> None:
    network = make("tiles")
    for edge, beyond in ((1.0, 1.5), (-1.0, -1.5)):
        assert q_of(network, edge, 0.3) == q_of(network, beyond, 0.3)


def test_far_from_every_centre_radial_basis_functions_are_zero() -> None:
    far: Tensor = make("rbf")(torch.full((RUNS, 1), 30.0, dtype=torch.float64))
    assert (far == 0).all()


@pytest.fixture(scope="module")
def with_fourier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a directory that has only the two files of the page in the documentation."""
    root = tmp_path_factory.mktemp("own")
    (root / "my_conf" / "value").mkdir(parents=True)
    for language, path in (("python", "fourier.py"), ("yaml", "my_conf/value/fourier.yaml")):
        (text,) = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)
        (root / path).write_text(text)
    return root


@pytest.fixture
def there(with_fourier: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.syspath_prepend(with_fourier)
    return with_fourier


def fourier_config(there: Path, *overrides: str) -> Config:
    searched = f"hydra.searchpath=[{(there / 'my_conf').as_uri()}]"
    return config_of(searched, "value=fourier", *overrides)


def test_its_candidates_have_the_values_of_those_actions(there: Path) -> None:
    settings = fourier_config(there)
    network = make_value_network(settings.value, make_candidates(settings), runs=4)
    generator = torch.Generator().manual_seed(0)
    network.weight.detach().normal_(generator=generator)
    bearing = torch.rand(4, 3, 1, generator=generator)
    alone = network(bearing, action=network.candidates[7].expand_as(bearing))
    torch.testing.assert_close(alone, network(bearing)[..., 7:8])


@pytest.mark.long  # tests/envs/test_own_world.py tries the same way with a world
def test_a_value_function_of_ones_own_is_a_file_and_a_yaml(with_fourier: Path) -> None:
    train = ("-m", "fnnq_torchrl.train", "--config-dir", "my_conf", "value=fourier")
    overrides = ("engine=eager", "value.order=2", "situations=5", "hydra.run.dir=job")
    subprocess.run([sys.executable, *train, *overrides], cwd=with_fourier, check=True)
    weights = load_checkpoint(with_fourier / "job" / "checkpoint.pt").weights
    assert weights["weight"].shape == (1, 9)
    assert (weights["weight"] != 0).all()


def test_its_mistakes_are_told_too(there: Path) -> None:
    with pytest.raises(ConfigError, match=r"^value\.order=0: must be a whole number >= 1$"):
        fourier_config(there, "value.order=0")
