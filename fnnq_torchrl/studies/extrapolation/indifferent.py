"""A value function that knows nothing where nothing was seen: the control for what it is worth."""

from torch import Tensor, where

from fnnq_torchrl.agent.values import ValueNetwork


class IndifferentWhereUnseen(ValueNetwork):
    """Another's Q where states were seen, and 0 for every action elsewhere.

    So the greedy policy draws lots there.

    Args:
        network: the other, which sees the bearing.
        edge_rad: states with a smaller bearing Δθ were not seen.
    """

    def __init__(self, network: ValueNetwork, edge_rad: float) -> None:
        super().__init__(network.in_keys, network.candidates)
        self.network = network
        self._edge_rad = edge_rad

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        values = self.network(*observations, action=action)
        bearing_rad = observations[self.in_keys.index("bearing")]
        return where(bearing_rad >= self._edge_rad, values, 0.0)
