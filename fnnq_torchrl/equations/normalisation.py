"""Running normalisation of observations and scaling of rewards, for each run by itself.

Source: M. Elsayed, G. Vasan, A. R. Mahmood, "Streaming deep reinforcement learning finally works",
2024, and the program published with it. The running mean and variance are those of B. P. Welford,
"Note on a method for calculating corrected sums of squares and products", Technometrics 4, 1962.
Everything is element by element, so the tensors may have any shapes that broadcast.
"""

from typing import NamedTuple

import torch
from torch import Tensor

_EPSILON = 1e-8  # added to the variance; Elsayed et al.


class Moments(NamedTuple):
    """The running moments of a number.

    Attributes:
        samples: the number of samples so far.
        mean: their mean; 0 before the first sample.
        squares: the sum of their squared deviations from their mean.
    """

    samples: Tensor
    mean: Tensor
    squares: Tensor

    def with_sample(self, x: Tensor) -> "Moments":
        """Return the moments after another sample."""
        samples = self.samples + 1
        mean = self.mean + (x - self.mean) / samples
        return Moments(samples, mean, self.squares + (x - self.mean) * (x - mean))

    @property
    def variance(self) -> Tensor:
        """The samples' variance, with n − 1 in the denominator; 1 for fewer than two samples."""
        spread = self.squares / (self.samples - 1).clamp(min=1)
        return torch.where(self.samples < 2, 1, spread)


def normalised(x: Tensor, moments: Moments) -> Tensor:
    """Return (x − mean)/√(variance + 10⁻⁸)."""
    return (x - moments.mean) / (moments.variance + _EPSILON).sqrt()


class RewardScale(NamedTuple):
    """The state by which a run's rewards are scaled.

    Attributes:
        trace: u, the discounted sum of the rewards so far.
        moments: the running moments of u.
    """

    trace: Tensor
    moments: Moments

    def with_reward(self, reward: Tensor, gamma: Tensor, done: Tensor) -> "RewardScale":
        """Return the state after a step.

            u ← γ(1 − T)u + r

        As in the authors' program, the last step of an episode makes u forget the rewards before
        it, and its own reward begins the u of the next episode.

        Args:
            reward: r, the step's reward.
            gamma: γ, the discount.
            done: T, whether the step has ended the episode (bool).
        """
        trace = gamma * self.trace.masked_fill(done, 0) + reward
        return RewardScale(trace, self.moments.with_sample(trace))

    def scaled(self, reward: Tensor) -> Tensor:
        """Return r/√(variance of u + 10⁻⁸)."""
        return reward / (self.moments.variance + _EPSILON).sqrt()
