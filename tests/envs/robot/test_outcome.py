"""The two ends of a situation and their rewards."""

import math

import pytest
import torch

from envs.robot import outcome

RULES = {
    "catch_distance_m": 0.25,
    "time_limit_steps": 120,
    "catch_reward": 1.0,
    "miss_reward": -0.5,
}
FAR, NEAR = 2.0, 0.1


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize(
    ("east_m", "north_m", "step", "reward", "terminated"),
    [
        (FAR, 0, 1, 0, False),
        (FAR, 0, 119, 0, False),
        (FAR, 0, 120, -0.5, True),  # the time limit
        (FAR, 0, 121, -0.5, True),
        (NEAR, 0, 1, 1, True),
        (0, -NEAR, 60, 1, True),
        (0, 0, 60, 1, True),
        (NEAR, NEAR, 120, 1, True),  # a catch at the very last step is a catch
        (0.25, 0, 60, 0, False),  # exactly the catch distance is not a catch
        (-0.15, 0.2, 60, 0, False),
        (math.nextafter(0.25, 0), 0, 60, 1, True),
        (0.2, 0.2, 60, 0, False),  # the distance is Euclidean
    ],
)
def test_reward_and_end(east_m, north_m, step, reward, terminated, dtype):
    if dtype == torch.float32 and east_m == math.nextafter(0.25, 0):
        east_m = 0.25 - 2**-26
    way = torch.tensor([[east_m], [north_m]], dtype=dtype)
    paid, ended, caught = outcome.judge(*way, torch.tensor([step]), **RULES)
    assert (paid.tolist(), ended.tolist()) == ([reward], [terminated])
    assert caught.tolist() == [reward == RULES["catch_reward"]]
    assert (paid.dtype, ended.dtype, caught.dtype) == (dtype, torch.bool, torch.bool)


def test_what_an_end_pays_is_free_to_choose():
    rules = RULES | {"catch_reward": 7.0, "miss_reward": 0.0, "time_limit_steps": 3}
    east_m = torch.tensor([FAR, NEAR, FAR])
    paid, ended, _ = outcome.judge(east_m, torch.zeros(3), torch.tensor([3, 3, 2]), **rules)
    assert paid.tolist() == [0, 7, 0]
    assert ended.tolist() == [True, True, False]
