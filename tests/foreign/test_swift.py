"""SwiftTD beside its authors' program, on the same stream of features and rewards.

The program computes in float32, we in float64. Where it departs from the paper's listing, we follow
the listing (`fnnq_torchrl.equations.step_size.swift`): its version for all features agrees with the
listing if no feature is 0, and its version for binary features as long as no step would correct
more than η, and no trace is cut. Its lower limit of the step sizes has no effect: with a larger
meta step size than here, a step size falls until the program's predictions are NaN.
"""

from pathlib import Path

import numpy as np
import pytest
import torch

from fnnq_torchrl.equations.step_size import Swift, swift

from .readers import Numbers, python

pytestmark = pytest.mark.foreign

FEATURES, STEPS = 7, 400
GAMMA, LAM, ALPHA, THETA, DECAY = 0.9, 0.8, 0.05, 0.001, 0.9

DENSE = """
import swifttd
td = swifttd.SwiftTDNonSparse({count}, {lam}, {alpha}, {gamma}, 0.0, {eta}, {decay}, {theta}, 1e-10)
y = np.array([td.step(row[1:].tolist(), row[0]) for row in x])
"""
BINARY = """
import swifttd
td = swifttd.SwiftTDBinaryFeatures(
    {count}, {lam}, {alpha}, {gamma}, 0.0, {eta}, {decay}, {theta}, 1e-10
)
y = np.array([td.step(np.flatnonzero(row[1:]).tolist(), row[0]) for row in x])
"""


def stream(*, binary: bool) -> Numbers:
    """Return a reward and the features that follow it, for each step."""
    random = np.random.default_rng(5)
    features = random.normal(size=(STEPS, FEATURES))
    if binary:
        features = (features > 0).astype(float)
    rewards = features[:, 0] - 2 * features[:, 1] + random.normal(size=STEPS) / 2
    return np.column_stack([rewards, features])


def theirs(script: str, eta: float, x: Numbers, directory: Path) -> Numbers:
    numbers = {"lam": LAM, "alpha": ALPHA, "gamma": GAMMA, "decay": DECAY, "theta": THETA}
    return python(script.format(count=FEATURES, eta=eta, **numbers), directory / "stream", x)


def ours(eta: float, x: Numbers) -> tuple[Numbers, int]:
    """Return the predictions, and the number of steps that would have corrected more than η."""

    def real(number: float) -> torch.Tensor:
        return torch.tensor([number], dtype=torch.float64)

    numbers = {
        key: real(value)
        for key, value in {
            "meta_step_size": THETA,
            "eta": eta,
            "eta_min": 1e-10,
            "eta_decay": DECAY,
        }.items()
    }
    features = torch.from_numpy(x[:, 1:]).unsqueeze(-1)
    w = torch.zeros_like(features[0])
    state, z = Swift().start(real(ALPHA), [w]), w
    predictions, last, above = [0.0], real(0.0), 0
    for phi, after, reward in zip(features, features[1:], x[1:, 0], strict=False):
        value, ahead = (w * phi).sum(0), (w * after).sum(0)
        error = reward + GAMMA * ahead - value
        above += bool((state["log_alpha"][0].exp() * phi**2).sum() > eta)
        ((direction, z),), state = swift(
            state, [z], [phi], real(GAMMA * LAM), error, value - last, numbers
        )
        w, last = w + direction, ahead
        predictions.append(ahead.item())
    return np.array(predictions), above


@pytest.mark.parametrize("eta", [0.1, 0.8])
def test_with_all_features_the_predictions_are_theirs(eta: float, tmp_path: Path) -> None:
    x = stream(binary=False)
    predictions, above = ours(eta, x)
    assert above > 10 or eta == 0.8
    np.testing.assert_allclose(predictions, theirs(DENSE, eta, x, tmp_path), rtol=0, atol=5e-5)
    assert np.abs(predictions).max() > 1


def test_with_binary_features_they_agree_until_a_step_would_correct_too_much(
    tmp_path: Path,
) -> None:
    x = stream(binary=True)
    predictions, above = ours(0.8, x)
    assert above == 0
    np.testing.assert_allclose(predictions, theirs(BINARY, 0.8, x, tmp_path), rtol=0, atol=5e-5)
    few, above = ours(0.1, x)
    assert above > 10
    assert np.abs(few - theirs(BINARY, 0.1, x, tmp_path)).max() > 0.01
