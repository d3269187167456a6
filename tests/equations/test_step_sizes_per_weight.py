"""The rules with a step size for each weight: by hand, beside slow twins, while learning."""

import math
from itertools import islice
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor

from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.equations.names import PER_WEIGHT
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import (
    Step,
    auto_tidbd,
    autostep,
    idbd,
    make_step_size,
    swift,
    tidbd,
)
from fnnq_torchrl.equations.traces import Correction
from tests.agent.test_learning_step import mdp_learner
from tests.oracles.random_mdp import ACTIONS, STATES, Walk
from tests.oracles.step_sizes import TWINS, sarsa
from tests.programs import advance, config, in_lanes, make_learner, make_runs


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def column(*values: float) -> Tensor:
    return real(*values).unsqueeze(-1)


LN2 = real(2.0).log().item()
CLOSE: dict[str, float] = {"rtol": 1e-14, "atol": 1e-15}


def test_idbd_by_hand() -> None:
    # θδxh = ln 2 doubles both step sizes, ¼. Then 1 − αx² = 1 − ½·1 and αδx = ½·2.
    # The second has 1 − αx² = 1 − ½·16, which is below 0.
    beta, h = idbd(
        column(0.25, 0.25).log(), column(LN2, LN2 / 4), column(1.0, 4.0), real(2.0), real(0.5)
    )
    torch.testing.assert_close(beta.exp(), column(0.5, 0.5), **CLOSE)
    torch.testing.assert_close(h, column(LN2 / 2 + 1, 4.0), **CLOSE)


def test_tidbd_by_hand() -> None:
    # As IDBD, but with z = 1.5 and Δw = 3 in the memory: 1 − ½·1·1.5 and ½·3. The second weight
    # has z = 4, and 1 − ½·1·4 is below 0.
    beta, h = tidbd(
        column(0.25, 0.25).log(),
        column(LN2, LN2),
        column(1.0, 1.0),
        column(1.5, 4.0),
        real(2.0),
        column(3.0, 3.0),
        real(0.5),
    )
    torch.testing.assert_close(beta.exp(), column(0.5, 0.5), **CLOSE)
    torch.testing.assert_close(h, column(LN2 / 4 + 1.5, 1.5), **CLOSE)


def test_autostep_by_hand() -> None:
    # δxh = 1 and −2. The first scale grows to 1; the second stays near 4: 4 + ½·4(2 − 4)/4.
    # So α = ½·exp(ln 2·1) = 1 and ½·exp(−ln 2·2/3); M = 1·1 + ½·2^(−2/3)·4 divides both.
    state = {
        "alpha": [column(0.5, 0.5)],
        "memory": [column(1.0, -1.0)],
        "scale": [column(0.0, 4.0)],
    }
    after = autostep(state, [column(1.0, 2.0)], real(1.0), real(LN2), real(4.0))
    grown = column(1.0, 0.5 * 2 ** (-2 / 3))
    alpha = grown / (1 + 4 * grown[1])
    torch.testing.assert_close(after["scale"][0], column(1.0, 3.0), **CLOSE)
    torch.testing.assert_close(after["alpha"][0], alpha, **CLOSE)
    kept = column(1.0, -1.0) * (1 - alpha * column(1.0, 4.0))
    torch.testing.assert_close(after["memory"][0], kept + alpha * column(1.0, 2.0), **CLOSE)


@pytest.mark.parametrize(("z", "bound"), [(0.0, 1.5), (2.0, 1.0)])
def test_auto_tidbd_by_hand(z: float, bound: float) -> None:
    # δ′dh = −2 and 0. The first scale grows to 2 and its α from ½ to ½·exp(ln 2·1) = 1. The second
    # scale is 0, so its α stays ½. M = 1·1·1.5 − ½·½·z divides both.
    state = {
        "log_alpha": [column(0.5, 0.5).log()],
        "memory": [column(1.0, 0.0)],
        "scale": [column(0.0, 0.0)],
    }
    after = auto_tidbd(
        state,
        [column(1.0, 0.0)],
        [column(-1.0, 0.5)],
        [column(1.5, z)],
        real(2.0),
        [column(3.0, 0.25)],
        real(LN2),
        real(10.0),
    )
    torch.testing.assert_close(after["scale"][0], column(2.0, 0.0), **CLOSE)
    alpha = column(1 / bound, 0.5 / bound)
    torch.testing.assert_close(after["log_alpha"][0].exp(), alpha, **CLOSE)
    # 1 − α·1.5 is 0 or below, so only the change stays.
    torch.testing.assert_close(after["memory"][0], alpha * column(3.0, 0.25), **CLOSE)


@pytest.mark.parametrize(
    ("theta", "lowest", "alpha"),
    [(0.001, 1e-10, math.exp(0.001 * 3 * 7 * 64) / 64), (0.01, 1e-10, 0.5), (0.001, 0.1, 0.1)],
)
def test_swift_by_hand(theta: float, lowest: float, alpha: float) -> None:
    # One weight, α = ¼, φ = 2: τ = 1, above η = ½, so zᵟ = ½·¼·2 = ¼ and α falls to ¼ε⁴.
    # γλ = ½, z = 1: ½ is left, b = 1, so z = ½ + ¼·0; p = ½·2 + 3·2 = 7.
    state = {
        "log_alpha": [column(0.25).log()],
        "memory": [column(1.0)],
        "last_memory": [column(3.0)],
        "memory_trace": [column(1.0)],
        "slope_trace": [column(2.0)],
    }
    numbers = {
        "meta_step_size": real(theta),
        "eta": real(0.5),
        "eta_min": real(lowest),
        "eta_decay": real(0.5),
    }
    ((direction, z),), after = swift(
        state, [column(1.0)], [column(2.0)], real(0.5), real(3.0), real(0.1), numbers
    )
    # Δw = 3.1·½ − 0.1·¼; h, h_old and z̄ are forgotten, so h = −czᵟ.
    torch.testing.assert_close(direction, column(1.55 - 0.025), **CLOSE)
    assert z.item() == 0.5
    # α = ¼ε⁴ = 1/64 is then learned, between η_min and η.
    torch.testing.assert_close(after["log_alpha"][0].exp(), column(alpha), rtol=1e-13, atol=0)
    torch.testing.assert_close(after["memory"][0], column(-0.025), **CLOSE)
    assert [after[key][0].item() for key in ("last_memory", "memory_trace", "slope_trace")] == [
        0.0,
        0.0,
        7.0,
    ]


@pytest.mark.long
def test_idbd_halves_the_error_of_lms_on_suttons_tracking_task() -> None:
    """Follow 5 of 20 inputs, one of whose signs turns every 20 examples (Sutton 1992, section 4).

    The paper reports mean squared errors of 1.5 for IDBD and of 3.5 for LMS at its best α, and
    optimal step sizes of about 0.13 for the 5 inputs and 0 for the others.
    """
    generator = torch.Generator().manual_seed(0)
    inputs, runs, examples, after = 20, 10, 30_000, 20_000
    zeros = torch.zeros(inputs, runs, dtype=torch.float64)
    signs = zeros.clone()
    signs[:5] = 1
    by_idbd, by_lms = zeros, zeros
    beta, h = zeros + real(0.05).log(), zeros
    errors = torch.zeros(2, runs).double()
    for example in range(examples):
        if example % 20 == 0:
            turned = torch.randint(5, (1, runs), generator=generator)
            signs.scatter_(0, turned, -signs.gather(0, turned))
        x = torch.randn(inputs, runs, generator=generator, dtype=torch.float64)
        idbds, lms = (((signs - w) * x).sum(0) for w in (by_idbd, by_lms))
        if example >= after:
            errors += torch.stack([idbds, lms]).square()
        beta, h = idbd(beta, h, x, idbds, real(0.01))
        by_idbd = by_idbd + beta.exp() * idbds * x
        by_lms = by_lms + 0.035 * lms * x
    found = errors.mean(1) / (examples - after)
    assert found.tolist() == pytest.approx([1.5, 3.5], rel=0.07)
    alphas = beta.exp().mean(1)
    assert alphas[:5].tolist() == pytest.approx([0.13] * 5, rel=0.1)
    assert alphas[5:].max() < 0.02


NUMBERS = {"meta_step_size": 0.02, "tau": 50.0, "eta": 0.3, "eta_min": 1e-3, "eta_decay": 0.9}


def twin_of(name: str, count: int, lam: float, alpha: float, gamma: float) -> Any:
    numbers = {key: NUMBERS[key] for key in make_step_size(name).numbers}
    return TWINS[name](count, alpha=alpha, gamma=gamma, lam=lam, **numbers)


@pytest.mark.parametrize("lam", [0.0, 0.8])
@pytest.mark.parametrize("name", PER_WEIGHT)
def test_td_by_features_is_the_papers_listing(name: str, lam: float) -> None:
    """Predict a noisy stream of features in two tensors of weights, beside the twin."""
    generator = torch.Generator().manual_seed(3)
    count, gamma, alpha, steps = 6, 0.7, 0.1, 120
    features = torch.randn(steps + 1, count, generator=generator, dtype=torch.float64)
    features[:, 1] = (features[:, 1] > 0).double()  # this feature is often 0
    rewards = features[1:] @ real(1, -1, 0.5, 0, 0, 0)
    rule = Rule("sarsa", "dutch" if name == "swift" else "gradient")
    step_size, twin = make_step_size(name), twin_of(name, count, lam, alpha, gamma)
    numbers = {key: real(value) for key, value in NUMBERS.items()}
    parts = (slice(0, 2), slice(2, 6))
    weights = [torch.zeros(2, 1).double(), torch.zeros(4, 1).double()]
    traces, state = [w.clone() for w in weights], step_size.start(real(alpha), weights)
    alphas, last = real(alpha), real(0.0)
    for t in range(steps):
        x, after, done = features[t], features[t + 1], t % 40 == 39
        w = torch.cat(weights).squeeze(-1)
        value, ahead = w @ x, w @ after
        error = (rewards[t] + gamma * ahead - value).view(1)
        credit = rule.credit(
            error,
            error,
            real(gamma * lam),
            None,
            real(float(not done)),
            correction=Correction(alphas, value - last),
        )
        slopes = [(gamma * after - x)[part].unsqueeze(-1) for part in parts]
        gradients = [x[part].unsqueeze(-1) for part in parts]
        step = Step(rule.trace, traces, gradients, credit, lambda slopes=slopes: slopes)
        credited, sizes, alphas, state = step_size.update(alphas, numbers, state, step)
        weights = [
            weight + size * direction
            for weight, size, (direction, _) in zip(weights, sizes, credited, strict=True)
        ]
        traces, last = [z for _, z in credited], ahead
        twin.step(x.tolist(), rewards[t].item(), after.tolist(), done)
        learned = torch.cat(weights).squeeze(-1)
        torch.testing.assert_close(learned, real(*twin.weights), rtol=1e-9, atol=1e-11)
    own = state["alpha"] if "alpha" in state else [beta.exp() for beta in state["log_alpha"]]
    torch.testing.assert_close(alphas, torch.cat([*own]).mean(0))
    assert alphas != alpha


@pytest.mark.parametrize("lam", [0.0, 0.8])
@pytest.mark.parametrize("name", PER_WEIGHT)
@torch.no_grad()
def test_a_table_learns_as_by_the_papers_listing(name: str, lam: float) -> None:
    runs, steps, alpha, gamma, epsilon = 2, 80, 0.2, 0.9, 0.3
    columns = {"seed": torch.arange(runs), "situations": torch.full((runs,), steps)}
    shared = {"lam": lam, "alpha": alpha, "alpha_decay": 1.0, "gamma": gamma, "epsilon": epsilon}
    shared |= NUMBERS
    columns |= {
        key: torch.full((runs,), value, dtype=torch.float64) for key, value in shared.items()
    }
    run = TensorDict({key: value.unsqueeze(-1) for key, value in columns.items()}, [runs])
    rule = Rule("sarsa", "dutch" if name == "swift" else "gradient")
    state = advance(mdp_learner(runs, rule, name), run, steps)
    for i in range(runs):
        twin = twin_of(name, STATES * ACTIONS, lam, alpha, gamma)
        *_, expected = islice(sarsa(Walk(i), STATES, ACTIONS, twin, epsilon), steps)
        learned = state["weights", "weight"][i].flatten()
        torch.testing.assert_close(learned, real(*expected), rtol=1e-9, atol=1e-11)
    assert (state["alpha"] != alpha).all()


def fitting(name: str) -> tuple[str, ...]:
    """Return overrides with which a rule works, and learns much in few steps."""
    return (f"step_size={name}", "alpha=0.05", "meta_step_size=0.05", "lam=0.8")


@pytest.mark.parametrize("dtype", ["float32", "float64"])
@pytest.mark.parametrize("name", PER_WEIGHT)
@torch.no_grad()
def test_a_run_alone_is_the_run_in_a_batch(name: str, dtype: str) -> None:
    settings = config(*fitting(name), f"machine.dtype={dtype}")
    runs = LANES + 8
    numbers = {key: getattr(settings, key) for key in make_step_size(name).numbers}
    apart = {
        key: torch.linspace(0.5, 1.0, runs, dtype=torch.float64) * value
        for key, value in numbers.items()
    }
    many = make_runs(settings, runs, **apart)
    together, alone = (
        advance(make_learner(settings, run), run, 50)
        for run in (in_lanes(many), in_lanes(many[9:10]))
    )
    assert together.keys() == alone.keys()
    for key in ("alpha", "weights", "trace", "step_size"):
        assert (together[key][9] == alone[key][0]).all(), key


@pytest.mark.parametrize("name", PER_WEIGHT)
@torch.no_grad()
def test_every_number_of_a_rule_acts_on_its_run_alone(name: str) -> None:
    # Eight tiles fire at once, so that swift's steps would correct more than η.
    settings = config(*fitting(name), "value=tiles", "eta=0.06", "eta_min=0.0499", "tau=20")
    numbers = make_step_size(name).numbers
    base = make_runs(settings, len(numbers) + 1)
    changed = base.clone()
    for lane, key in enumerate(numbers):
        changed[key][lane] *= 0.9
    learner = make_learner(settings, base)
    before, after = (advance(learner, run, 80)["weights", "weight"] for run in (base, changed))
    differs = (before != after).flatten(1).any(1).tolist()
    assert differs == [True] * len(numbers) + [False]
