"""The paper's world, and policies that drive its robot."""

from collections.abc import Callable

import pytest
import torch
from tensordict.nn import TensorDictModule
from torch import Tensor

from envs.robot.schemas import FollowBallConfig, FollowOneSideConfig
from tests.compositions import config_of


@pytest.fixture(scope="session")
def world() -> FollowBallConfig:
    """The default world."""
    return config_of().env


@pytest.fixture(scope="session")
def one_side() -> FollowOneSideConfig:
    """The world whose balls start on one side, and later on the other."""
    return config_of("env=follow_one_side").env


@pytest.fixture(scope="session")
def wander() -> TensorDictModule:
    """Return a policy of random actions, drawn from the run's own random numbers."""
    return policy(lambda bearing, chance: 2 * chance - 1)


@pytest.fixture(scope="session")
def follow() -> TensorDictModule:
    """Return a policy that steers noisily to the ball, with catches after various times."""
    return policy(lambda bearing, chance: (chance - 0.5 - 5 * bearing).clamp(-1, 1))


@pytest.fixture(scope="session")
def straight() -> TensorDictModule:
    """Return a policy that drives straight on."""
    return policy(lambda bearing, chance: torch.zeros_like(bearing))


def policy(choose: Callable[[Tensor, Tensor], Tensor]) -> TensorDictModule:
    return TensorDictModule(choose, in_keys=["bearing", "chance"], out_keys=["action"])
