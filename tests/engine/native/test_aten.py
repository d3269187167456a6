"""Each operation that the native loop writes in C++ equals torch's own."""

from collections.abc import Callable

import pytest
import torch
import torch.nn.functional as F
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.native import NativeLoop, Unsupported, arrays, expressions, translation

pytestmark = pytest.mark.usefixtures("compiler")

N = 6
SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, -2.5, 1e-3, torch.inf, -torch.inf, torch.nan, 3.5, -3.5)
Function = Callable[[Tensor, Tensor, Tensor, Tensor], Tensor]

# x and y are real, k and m are whole numbers from 1 to N − 1; all are [lanes, N], one run a row.
UNARY = (
    "abs acos asin atan ceil cos cosh erf exp expm1 floor isfinite isinf isnan log log1p neg "
    "reciprocal round rsqrt sigmoid sign sin sinc sinh sqrt square tan tanh trunc relu"
)
BINARY = "add sub mul div atan2 maximum minimum eq ne lt le gt ge pow logaddexp"
DIFFERENTIABLE = (
    "tanh sigmoid relu silu leaky_relu gelu softplus softmax layer_norm bmm cumsum table "
    "selected reshaped cat stack amax exp where"
)

REAL: dict[str, Function] = {
    **{name: lambda x, y, k, m, name=name: getattr(torch, name)(x) for name in UNARY.split()},
    **{name: lambda x, y, k, m, name=name: getattr(torch, name)(x, y) for name in BINARY.split()},
    "silu": lambda x, y, k, m: F.silu(x),
    "softplus": lambda x, y, k, m: F.softplus(x),
    "leaky_relu": lambda x, y, k, m: F.leaky_relu(x),
    "gelu": lambda x, y, k, m: F.gelu(x),
    "pow 2": lambda x, y, k, m: x**2,
    "pow 3": lambda x, y, k, m: x**3,
    "pow 0.5": lambda x, y, k, m: x**0.5,
    "pow -1": lambda x, y, k, m: x**-1,
    "remainder": lambda x, y, k, m: torch.remainder(x, 0.75),
    "remainder of multiples": lambda x, y, k, m: torch.remainder(k * 0.1, 0.1) < 0.1,
    "rounded twice": lambda x, y, k, m: ((x * y + x) - (x * y + x).floor()) * 0 + (x * y + x),
    "remainder of a negative": lambda x, y, k, m: torch.remainder(x, -0.75),
    "rsub": lambda x, y, k, m: 1 - x,
    "add alpha": lambda x, y, k, m: torch.add(x, y, alpha=0.3),
    "addcmul": lambda x, y, k, m: torch.addcmul(x, x, y, value=0.5),
    "clamp": lambda x, y, k, m: x.clamp(-0.5, 0.7),
    "clamp min": lambda x, y, k, m: x.clamp(min=y),
    "where": lambda x, y, k, m: torch.where(x > y, x, 3.0),
    "where broadcast": lambda x, y, k, m: torch.where(x[:, :1] > 0, x, y),
    "masked_fill": lambda x, y, k, m: x.masked_fill(y > 0, -7.0),
    "logic": lambda x, y, k, m: ((x > 0) & (y > 0)) | ~(x > 1) ^ (y < 0),
    "bool to real": lambda x, y, k, m: (x > 0).to(x.dtype) + (y > 0),
    "real to bool": lambda x, y, k, m: x.bool(),
    "to float": lambda x, y, k, m: x.float(),
    "to double": lambda x, y, k, m: x.double() + 1,
    "softmax": lambda x, y, k, m: x.softmax(-1),
    "log_softmax": lambda x, y, k, m: x.log_softmax(-1),
    "logsumexp": lambda x, y, k, m: x.logsumexp(-1, keepdim=True),
    "layer_norm": lambda x, y, k, m: F.layer_norm(x, [N]),
    "sum": lambda x, y, k, m: x.sum(-1, keepdim=True),
    "mean": lambda x, y, k, m: x.mean(-1, keepdim=True),
    "mean of some": lambda x, y, k, m: x.view(-1, 2, 3).mean(1),
    "sum of all but the runs": lambda x, y, k, m: x.view(-1, 2, 3).sum((1, 2)).unsqueeze(-1),
    "norm": lambda x, y, k, m: torch.linalg.vector_norm(x, dim=-1, keepdim=True),
    "max": lambda x, y, k, m: torch.cat([x.max(-1, keepdim=True).values, x.min(-1)[0][:, None]], 1),
    "max's place": lambda x, y, k, m: x.max(-1, keepdim=True).indices,
    "argmin": lambda x, y, k, m: y.argmin(-1, keepdim=True),
    "var": lambda x, y, k, m: x.var(-1, keepdim=True),
    "prod": lambda x, y, k, m: x.prod(-1, keepdim=True),
    "amax": lambda x, y, k, m: x.amax(-1, keepdim=True),
    "amin": lambda x, y, k, m: x.amin(-1, keepdim=True),
    "argmax": lambda x, y, k, m: y.argmax(-1, keepdim=True),
    "any": lambda x, y, k, m: (x > 1).any(-1, keepdim=True),
    "all": lambda x, y, k, m: (x > -1).all(-1, keepdim=True),
    "cumsum": lambda x, y, k, m: x.cumsum(-1),
    "bmm": lambda x, y, k, m: x.view(-1, 2, 3) @ y.view(-1, 3, 2),
    "einsum": lambda x, y, k, m: torch.einsum("bij,bkj->bik", x.view(-1, 2, 3), y.view(-1, 2, 3)),
    "reshaped": lambda x, y, k, m: x.view(-1, 2, 3).transpose(1, 2).reshape(-1, 6),
    "permuted": lambda x, y, k, m: x.view(-1, 2, 3).permute(2, 0, 1).flip(0).movedim(1, 0),
    "selected": lambda x, y, k, m: x[:, 2:5:2] + y[:, -1:] + x[:, 1, None],
    "cat": lambda x, y, k, m: torch.cat([x, y[:, :2]], -1),
    "stack": lambda x, y, k, m: torch.stack([x, y], 1),
    "split": lambda x, y, k, m: sum(x.split([2, 2, 2], -1)),
    "expanded": lambda x, y, k, m: x.unsqueeze(1).expand(-1, 2, -1) * y[:, :2, None],
    "made anew": lambda x, y, k, m: x + torch.arange(N) + torch.full_like(y, 2) + x.new_zeros(N),
    "table": lambda x, y, k, m: torch.linspace(-1, 1, N, dtype=x.dtype)[k[:, :1]],
    "table of booleans": lambda x, y, k, m: ~torch.tensor([True, False] * 3)[k],
    "table of infinities": lambda x, y, k, m: torch.tensor([0.0, -0.0, torch.inf] * 2)[k],
    "table of large numbers": lambda x, y, k, m: (torch.arange(N) + 2**60)[k],
    "table from the end": lambda x, y, k, m: torch.linspace(-1, 1, N)[-k],
    "index of a later dimension": lambda x, y, k, m: x[:, :3, None].expand(-1, 3, 4)[:, [0, 2]],
    "index_select": lambda x, y, k, m: x.index_select(1, torch.tensor([3, 0, 3])),
    "repeat": lambda x, y, k, m: x.repeat(1, 2),
    "pad": lambda x, y, k, m: F.pad(x, (1, 2), value=7.0),
    "gather": lambda x, y, k, m: x.gather(-1, k),
    "index": lambda x, y, k, m: torch.linspace(0, 3, 2 * N).view(N, 2)[k[:, 0]],
    "gather from merged dimensions": lambda x, y, k, m: x.view(-1, 2, 3).flatten(1).gather(1, k),
    "gather of what is computed": lambda x, y, k, m: (x * y).view(-1, 3, 2).flatten(1).gather(1, k),
    "gather by a narrow index": lambda x, y, k, m: x.gather(1, k.int().long()),
    "scatter": lambda x, y, k, m: x.scatter(-1, k, y),
    "scatter into merged dimensions": lambda x, y, k, m: (
        torch.zeros_like(x).scatter(1, k, y).view(-1, 2, 3).transpose(1, 2) + x.view(-1, 3, 2)
    ),
    "scatter_add": lambda x, y, k, m: x.scatter_add(-1, k, y),
}
WHOLE: dict[str, Function] = {
    "arithmetic": lambda x, y, k, m: k * m - k + 3 * m,
    "logic": lambda x, y, k, m: (k & m) | (k ^ 5) + ~m,
    "left shift": lambda x, y, k, m: k << 3,
    "right shift": lambda x, y, k, m: (k - 3) >> 1,
    "of booleans": lambda x, y, k, m: ((k > 2) * (m > 2)) + ((k > 3) >= (m > 1)),
    "cumsum of booleans": lambda x, y, k, m: (k > 2).cumsum(-1),
    "absolute": lambda x, y, k, m: (k - 3).abs(),
    "compared": lambda x, y, k, m: (k > m) | (k == 2),
    "compared to a real": lambda x, y, k, m: k > 2.5,
    "where": lambda x, y, k, m: torch.where(k > m, k, -m),
    "wraps": lambda x, y, k, m: k.int() * 1664525 * m.int() + 1013904223,
    "narrowed": lambda x, y, k, m: ((k << 40) + k * 2**31).int(),
    "to real": lambda x, y, k, m: k.to(x.dtype) / m,
    "maximum": lambda x, y, k, m: torch.maximum(k, m) - torch.minimum(k, m),
    "sum": lambda x, y, k, m: k.sum(-1, keepdim=True),
    "least": lambda x, y, k, m: k * 0 - 2**63,
}
# For these operations torch's results at infinities and NaN differ from processor to processor.
OPEN = {"gelu", "silu", "softplus", "softmax", "log_softmax", "logsumexp", "logaddexp"}
OPEN |= {"layer_norm", "var", "norm", "remainder", "pow"}
GRADIENTS: dict[str, Function] = {name: REAL[name] for name in DIFFERENTIABLE.split()}
GRADIENTS |= {name: function for name, function in REAL.items() if name.startswith("gather")}


def data(dtype: torch.dtype) -> TensorDict:
    generator = torch.Generator().manual_seed(3)
    x, y = torch.randn(2, LANES, N, dtype=dtype, generator=generator).mul(2)
    special = torch.tensor(SPECIAL, dtype=dtype)
    x[: len(SPECIAL)] = special.unsqueeze(-1)
    y[: len(SPECIAL)] = torch.cat([special, special])[: len(SPECIAL) + N - 1].unfold(0, N, 1)[
        torch.arange(len(SPECIAL)) % 12
    ]
    k, m = torch.randint(1, N, (2, LANES, N), generator=generator)
    return TensorDict({"x": x, "y": y, "k": k, "m": m}, [LANES])


def carried_out(functions: dict[str, Function], stays: TensorDict) -> tuple[TensorDictBase, ...]:
    """Return the functions' results for the data ``stays``, by the native loop and by torch."""

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        args = [stays[key] for key in ("x", "y", "k", "m")]
        return TensorDict({key: f(*args) for key, f in functions.items()}, state.batch_size)

    with torch.no_grad():
        expected = step(stays, stays)
        running = NativeLoop(lambda lanes: step, stays, expected)(
            stays, expected.apply(torch.zeros_like)
        )
    running.advance(1)
    return running.state, expected


def assert_all_close(
    computed: TensorDictBase, expected: TensorDictBase, dtype: torch.dtype
) -> None:
    # The C library's vector functions have errors of up to 4 units in the last place. Sums may be
    # in any order, and their terms may cancel.
    limit = 32 * torch.finfo(dtype).eps
    tolerance = {"rtol": limit, "atol": limit}
    for key, values in expected.items():
        limits = tolerance if values.dtype is dtype else {"rtol": 0, "atol": 0}
        if values.is_floating_point() and values.dtype is not dtype:
            limits = {"rtol": 1e-6, "atol": 1e-6}
        torch.testing.assert_close(
            computed[key],
            values,
            equal_nan=True,
            msg=lambda text, key=key: f"{key}: {text}",
            **limits,
        )


@pytest.fixture(params=["written out", "in loops"])
def size(request, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dimensions of which each number is written out, or, from three numbers on, loops."""
    if request.param == "in loops":
        monkeypatch.setattr(expressions, "LARGE", 3)
        monkeypatch.setattr(arrays, "LARGE", 3)


@pytest.mark.usefixtures("size")
@pytest.mark.parametrize(
    "dtype", [torch.float32, pytest.param(torch.float64, marks=pytest.mark.long)], ids=str
)
def test_operations_do_what_torch_does(dtype: torch.dtype) -> None:
    functions = REAL | {f"whole: {name}": function for name, function in WHOLE.items()}
    stays = data(dtype)
    computed, expected = carried_out(functions, stays)
    finite = (stays["x"].isfinite() & stays["y"].isfinite()).all(-1)
    assert_all_close(computed.exclude(*OPEN), expected.exclude(*OPEN), dtype)
    assert_all_close(computed.select(*OPEN)[finite], expected.select(*OPEN)[finite], dtype)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64], ids=str)
def test_sums_are_taken_in_order(dtype: torch.dtype) -> None:
    """The native loop's order is fixed, so that a run's bits don't depend on its batch."""
    terms = torch.tensor([1e9, 1.0, -1e9], dtype=dtype)
    stays = TensorDict({"terms": terms.expand(LANES, 3)}, [LANES])
    state = TensorDict({"sum": torch.zeros(LANES, dtype=dtype)}, [LANES])

    def step(stays: TensorDictBase, state: TensorDictBase) -> TensorDict:
        return TensorDict({"sum": stays["terms"].sum(-1)}, state.batch_size)

    running = NativeLoop(lambda lanes: step, stays, state)(stays, state)
    running.advance(1)
    first, second, third = terms
    assert (running.state["sum"] == first + second + third).all()


@pytest.mark.usefixtures("size")
def test_gradients_are_torchs() -> None:
    def slope(function: Function) -> Function:
        def gradient(x: Tensor, y: Tensor, k: Tensor, m: Tensor) -> Tensor:
            with torch.enable_grad():
                w = x.detach().requires_grad_()
                total = (function(w, y, k, m) * 0.5).sum() + (w * 0).sum()
            return torch.autograd.grad(total, w)[0]

        return gradient

    stays = data(torch.float64)[len(SPECIAL) :]
    stays = torch.cat([stays, stays])[:LANES]
    functions = {name: slope(function) for name, function in GRADIENTS.items()}
    assert_all_close(*carried_out(functions, stays), torch.float64)


WITHOUT_TRANSLATION: dict[str, Function] = {
    "half precision": lambda x, y, k, m: x.half().float(),
    "shift by what is computed": lambda x, y, k, m: k << m,
    "decimals": lambda x, y, k, m: x.round(decimals=2),
    "in place": lambda x, y, k, m: (x + 1).add_(y),
    "sort": lambda x, y, k, m: x.sort(-1).values,
    "division of whole numbers": lambda x, y, k, m: k // m,
    "floor division": lambda x, y, k, m: torch.div(x, y, rounding_mode="floor"),
    "remainder of whole numbers": lambda x, y, k, m: k % m,
    "power of whole numbers": lambda x, y, k, m: k.pow(m),
    "two indices": lambda x, y, k, m: torch.linspace(0, 1, N * N).view(N, N)[k[:, 0], m[:, 0]],
}


@pytest.mark.parametrize("name", WITHOUT_TRANSLATION)
def test_what_has_no_translation_is_said(name: str) -> None:
    with pytest.raises(Unsupported, match="no translation for"):
        carried_out({name: WITHOUT_TRANSLATION[name]}, data(torch.float32))


def test_a_step_of_too_many_operations_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(translation, "_MOST", 1_000)

    def large(x: Tensor, y: Tensor, k: Tensor, m: Tensor) -> Tensor:
        return (
            x[:, :, None, None, None] * y[:, None, :, None, None]
            + torch.arange(20.0)[:, None] * torch.ones(20, 20)
        ).sum((1, 2, 3, 4))[:, None]

    with pytest.raises(Unsupported, match="more than 1,000 scalar operations"):
        carried_out({"it": large}, data(torch.float32))
