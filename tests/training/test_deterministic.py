"""Learning and its test run in torch's deterministic mode."""

from collections.abc import Iterator

import pytest
import torch

from fnnq_torchrl.training.trainer import Trainer
from tests.programs import config


@pytest.fixture(autouse=True)
def deterministic() -> Iterator[None]:
    before = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(True)
    yield
    torch.use_deterministic_algorithms(before)


@pytest.mark.parametrize(("engine", "dtype"), [("eager", "float64"), ("compiled", "float32")])
def test_twice_the_same(engine: str, dtype: str, compiler: None) -> None:
    keys = (f"engine={engine}", f"machine.dtype={dtype}", "situations=5", "num_seeds=2")
    first, second = (Trainer.of(config(*keys)) for _ in range(2))
    for trainer in (first, second):
        trainer.learn()
    assert first.weights["weight"].dtype == getattr(torch, dtype)
    assert first.weights["weight"].any()
    assert torch.equal(first.weights["weight"], second.weights["weight"])
    assert (first.evaluate().catches == second.evaluate().catches).all()
