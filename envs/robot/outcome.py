"""The end of a situation (episode): a catch, or a miss at the time limit."""

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
    """Return a step's reward, whether it ends the situation (episode), and whether by a catch.

    A miss at the time limit has its own reward, so the episode is terminated, not truncated.

    Args:
        east_m, north_m: the ball's position relative to the robot after the step, any shape.
        step: the number of this step in its situation, from 1, int64, same shape.
        catch_distance_m: the distance below which the ball is caught.
        time_limit_steps: the number of a situation's last step.
        catch_reward, miss_reward: the rewards of a catch and a miss; other steps have 0.

    Returns:
        The reward, ``terminated`` (bool) and ``caught`` (bool), all shaped as ``east_m``.
    """
    caught = east_m.square() + north_m.square() < catch_distance_m * catch_distance_m
    terminated = caught | (step >= time_limit_steps)
    reward = torch.zeros_like(east_m).masked_fill(terminated, miss_reward)
    return reward.masked_fill(caught, catch_reward), terminated, caught
