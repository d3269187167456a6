"""A value function that prefers no action where nothing was seen: the control of the study."""

from torch import Tensor, where

from fnnq_torchrl.agent.values import ValueNetwork


class IndifferentWhereUnseen(ValueNetwork):
    """Another network's Q where states were seen, and 0 for every action elsewhere.

    There the greedy policy draws an action at random.

    Args:
        network: the other network, which observes the bearing.
        edge_rad: the edge of the seen states; smaller bearings Δθ were not seen.
    """

    def __init__(self, network: ValueNetwork, edge_rad: float) -> None:
        super().__init__(network.in_keys, network.candidates)
        self.network = network
        self._edge_rad = edge_rad

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        values = self.network(*observations, action=action)
        bearing_rad = observations[self.in_keys.index("bearing")]
        return where(bearing_rad >= self._edge_rad, values, 0.0)
