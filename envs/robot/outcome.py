"""The end of a situation: a catch, or a miss at the time limit."""

import torch
from torch import Tensor


def judge(
    east_m: Tensor,
    north_m: Tensor,
    step: Tensor,
    *,
    catch_distance_m: float,
    time_limit_steps: int,
    catch_reward: float,
    miss_reward: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Return the reward of a step, whether it ends the situation, and whether by a catch.

    A miss at the time limit brings a penalty, so it terminates the episode and doesn't truncate it.

    Args:
        east_m, north_m: from the robot to the ball after the step, any shape.
        step: steps of this situation so far, this one included, int64, same shape.
        catch_distance_m: a ball nearer than this is caught.
        time_limit_steps: the number of a situation's last step.
        catch_reward, miss_reward: the rewards at the two ends; at every other step it is 0.

    Returns:
        The reward, and ``terminated`` and ``caught`` (bool), of that shape.
    """
    caught = east_m.square() + north_m.square() < catch_distance_m * catch_distance_m
    terminated = caught | (step >= time_limit_steps)
    reward = torch.zeros_like(east_m).masked_fill(terminated, miss_reward)
    return reward.masked_fill(caught, catch_reward), terminated, caught
