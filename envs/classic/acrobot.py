"""Acrobot: two links with a motor at the joint between them; the tip must swing above a bar."""

from math import pi

import torch
from torch import Tensor

from envs.classic.schemas import AcrobotConfig
from envs.classic.starts import draw_state
from envs.core.pure import Entries, PureEnv

_GRAVITY_MPS2 = 9.8
_CENTRE_M = 0.5
"""The distance of a link's centre of mass from its upper end. A link has 1 m, 1 kg and 1 kg m²."""

_ANGLES = ("angle1_rad", "angle2_rad")

Motion = tuple[Tensor, Tensor, Tensor, Tensor]
"""Both angles and both angular speeds, or their derivatives."""


class Acrobot(PureEnv):
    """Acrobot, with the equations of Gymnasium's Acrobot-v1 (Runge and Kutta's method).

    An angle of 0 points downwards; the second angle is relative to the first link. Actions are a
    torque to the left (0), no torque (1) or a torque to the right (2); a number in between is a
    weaker torque. The task ends when the tip is above the bar. The reward is −1 a step, and 0 for
    the last step of the task.

    Source: R. S. Sutton, A. G. Barto, "Reinforcement learning", 1998, section 11.3.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/acrobot.yaml``.
    """

    schema = AcrobotConfig
    world: AcrobotConfig

    @property
    def state_sizes(self) -> dict[str, int]:
        """The angles, if only their cosines and sines are observed."""
        return dict.fromkeys(_ANGLES, 1) if self.world.cosines else {}

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        names = [*_ANGLES, "speed1_radps", "speed2_radps"]
        state = draw_state(names, self.world.start, seed, episode, self.dtype)
        return state | self._cosines(state["angle1_rad"], state["angle2_rad"])

    def _cosines(self, angle1_rad: Tensor, angle2_rad: Tensor) -> Entries:
        if not self.world.cosines:
            return {}
        return {
            "cosine1": torch.cos(angle1_rad),
            "sine1": torch.sin(angle1_rad),
            "cosine2": torch.cos(angle2_rad),
            "sine2": torch.sin(angle2_rad),
        }

    def transition(self, state: Entries, action: Tensor) -> Entries:
        torque_nm = (action - 1) * self.world.torque_nm
        angle1, angle2, speed1, speed2 = _runge_kutta(
            (
                state["angle1_rad"],
                state["angle2_rad"],
                state["speed1_radps"],
                state["speed2_radps"],
            ),
            torque_nm,
            self.world.time_step_s,
        )
        angle1, angle2 = _wrapped(angle1), _wrapped(angle2)
        above = -torch.cos(angle1) - torch.cos(angle2 + angle1) > 1
        return {
            "angle1_rad": angle1,
            "angle2_rad": angle2,
            **self._cosines(angle1, angle2),
            "speed1_radps": speed1.clamp(-4 * pi, 4 * pi),
            "speed2_radps": speed2.clamp(-9 * pi, 9 * pi),
            "reward": torch.full_like(angle1, -1).masked_fill(above, 0),
            "terminated": above,
            "success": above,
        }


def _runge_kutta(motion: Motion, torque_nm: Tensor, time_step_s: float) -> Motion:
    """Return the motion after a time step, by Runge and Kutta's method of fourth order."""

    def ahead(slope: Motion, share: float) -> Motion:
        moved = (y + share * time_step_s * k for y, k in zip(motion, slope, strict=True))
        return tuple(moved)  # type: ignore[return-value]  # of four

    k1 = _derivative(motion, torque_nm)
    k2 = _derivative(ahead(k1, 1 / 2), torque_nm)
    k3 = _derivative(ahead(k2, 1 / 2), torque_nm)
    k4 = _derivative(ahead(k3, 1), torque_nm)
    after = (
        y + time_step_s / 6 * (a + 2 * b + 2 * c + d)
        for y, a, b, c, d in zip(motion, k1, k2, k3, k4, strict=True)
    )
    return tuple(after)  # type: ignore[return-value]  # of four


def _derivative(motion: Motion, torque_nm: Tensor) -> Motion:
    """Return the angular speeds and accelerations; a link's mass, length and inertia are 1."""
    angle1, angle2, speed1, speed2 = motion
    lc, g = _CENTRE_M, _GRAVITY_MPS2
    cosine, sine = torch.cos(angle2), torch.sin(angle2)
    d1 = 2 * lc**2 + 1 + 2 * lc * cosine + 2
    d2 = lc**2 + lc * cosine + 1
    phi2 = lc * g * torch.cos(angle1 + angle2 - pi / 2)
    phi1 = (
        -lc * speed2.square() * sine
        - 2 * lc * speed2 * speed1 * sine
        + (lc + 1) * g * torch.cos(angle1 - pi / 2)
        + phi2
    )
    of_second = (torque_nm + d2 / d1 * phi1 - lc * speed1.square() * sine - phi2) / (
        lc**2 + 1 - d2.square() / d1
    )
    of_first = -(d2 * of_second + phi1) / d1
    return speed1, speed2, of_first, of_second


def _wrapped(angle_rad: Tensor) -> Tensor:
    """Return the angle in [−π, π]."""
    return angle_rad - 2 * pi * torch.floor((angle_rad + pi) / (2 * pi))
