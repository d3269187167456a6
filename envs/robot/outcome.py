"""How a learning situation ends."""

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
    """Return the reward, whether the episode has terminated, and whether the ball was caught.

    A miss at the time limit pays a penalty, so it terminates the episode and doesn't truncate it.

    Args:
        east_m, north_m: from the robot to the ball after the step, any shape.
        step: steps of this situation so far, this one included, int64, same shape.
        catch_distance_m: nearer than this is a catch.
        time_limit_steps: the last step of a situation.
        catch_reward, miss_reward: what the two ends pay; every other step pays 0.

    Returns:
        The reward, and whether the situation has terminated, and by a catch (bool), of that shape.
    """
    caught = east_m.square() + north_m.square() < catch_distance_m * catch_distance_m
    terminated = caught | (step >= time_limit_steps)
    reward = torch.zeros_like(east_m).masked_fill(terminated, miss_reward)
    return reward.masked_fill(caught, catch_reward), terminated, caught
