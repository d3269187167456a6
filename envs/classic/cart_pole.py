"""Cart-Pole: the learner pushes a cart to keep the pole on it upright."""

import torch
from torch import Tensor

from envs.classic.schemas import CartPoleConfig
from envs.classic.starts import draw_state
from envs.core.pure import Entries, PureEnv


class CartPole(PureEnv):
    """Cart-Pole, with the equations of Gymnasium's CartPole-v1 (Euler's method).

    Actions are a push to the left (0) or to the right (1); a number in between is a weaker push.
    The task ends when the cart leaves the track or the pole has fallen; an episode that reaches the
    time limit is a success.

    Source: A. G. Barto, R. S. Sutton, C. W. Anderson, "Neuronlike adaptive elements that can solve
    difficult learning control problems", IEEE Trans. Systems, Man and Cybernetics 13, 1983.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/cart_pole.yaml``.
    """

    schema = CartPoleConfig
    world: CartPoleConfig

    def initial(self, seed: Tensor, episode: Tensor, situations: Tensor | None) -> Entries:
        return draw_state(self.seen, self.world.start, seed, episode, self.dtype)

    def transition(self, state: Entries, action: Tensor) -> Entries:
        world, step_s = self.world, self.world.time_step_s
        sine, cosine = torch.sin(state["pole_rad"]), torch.cos(state["pole_rad"])
        total_kg = world.cart_kg + world.pole_kg
        moment = world.pole_kg * world.half_pole_m
        force_n = (2 * action - 1) * world.force_n
        push = (force_n + moment * state["pole_radps"].square() * sine) / total_kg
        of_pole = (world.gravity_mps2 * sine - cosine * push) / (
            world.half_pole_m * (4 / 3 - world.pole_kg * cosine.square() / total_kg)
        )
        of_cart = push - moment * of_pole * cosine / total_kg
        cart_m = state["cart_m"] + step_s * state["cart_mps"]
        pole_rad = state["pole_rad"] + step_s * state["pole_radps"]
        fallen = (cart_m.abs() > world.track_m) | (pole_rad.abs() > world.largest_angle_rad)
        reward = torch.full_like(cart_m, world.step_reward)
        return {
            "cart_m": cart_m,
            "cart_mps": state["cart_mps"] + step_s * of_cart,
            "pole_rad": pole_rad,
            "pole_radps": state["pole_radps"] + step_s * of_pole,
            "reward": reward.masked_fill(fallen, world.fall_reward),
            "terminated": fallen,
            "success": (state["step"] >= world.time_limit_steps) & ~fallen,
        }
