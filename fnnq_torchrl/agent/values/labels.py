"""The base class of value functions with a weight for every combination of labels."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Self

from torch import Tensor, nn

from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.equations.layout import runs_first, runs_last
from fnnq_torchrl.equations.membership import defuzzify, rule_width

from .base import ValueNetwork

Labels = Sequence[tuple[float, float]]


class LabelsValue(ValueNetwork):
    """Q(s, a) = Σ w·Πⱼ φⱼ(sⱼ)·φ(a), over every combination of the inputs' and the action's labels.

    A subclass defines φ, the degree to which a number belongs to each label.

    Every run has its own weights, all zero at the start: ``weight`` is ``[runs, labels of input 1,
    …, action labels]``. In memory the runs are the last dimension, for the equations.

    Args:
        inputs: the labels (centre, width) of each observation, by its key in the TensorDict.
        action: the labels (centre, width) of the action.
        candidates: the candidate actions, ``[candidates]``, in the network's dtype and device.
        width: the meaning of a label's second number, ``"sigma"`` or ``"variance"``.
        runs: the number of runs in the batch; a network of one run takes inputs of any batch size.

    Raises:
        ValueError: if ``width`` is neither of the two.
    """

    schema = LabelsConfig

    candidate_shares: Tensor

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        candidates: Tensor,
        *,
        width: str = "sigma",
        runs: int = 1,
    ) -> None:
        super().__init__(list(inputs), candidates)
        if width not in ("sigma", "variance"):
            raise ValueError(f"width={width!r}: must be 'sigma' or 'variance'")
        dimensions = [*inputs.values(), action]
        for i, labels in enumerate(dimensions):
            centres = [centre for centre, _ in labels]
            inverse_widths = [1 / rule_width(second, width) for _, second in labels]
            # Each buffer has its own memory, because a compiled loop allows no aliases.
            self.register_buffer(f"centres_{i}", candidates.new_tensor(centres))
            self.register_buffer(f"inverse_widths_{i}", candidates.new_tensor(inverse_widths))
        # The candidates never change, so neither do their shares.
        shares = self._shares(len(inputs), candidates.unsqueeze(-1))
        self.register_buffer("candidate_shares", shares, persistent=False)
        weights = candidates.new_zeros([*map(len, dimensions), runs])
        self.weight = nn.Parameter(runs_first(weights))

    @classmethod
    def from_config(cls, config: LabelsConfig, candidates: Tensor, runs: int) -> Self:
        return cls(config.inputs, config.action, candidates, width=config.width, runs=runs)

    @abstractmethod
    def shares(self, x: Tensor, centres: Tensor, inverse_widths: Tensor) -> Tensor:
        """Return φ(x) for every label of one input; arguments and result as `log_membership`'s."""

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        shares = [self._shares(i, runs_last(x.squeeze(-1))) for i, x in enumerate(observations)]
        if action is None:
            every_state = (*self.candidate_shares.shape[:2], *[1] * (shares[0].ndim - 1))
            action_shares = self.candidate_shares.view(every_state)
        else:
            action_shares = self._shares(len(shares), runs_last(action.squeeze(-1)).unsqueeze(0))
        return defuzzify(runs_last(self.weight), shares, action_shares).movedim((0, -1), (-1, 0))

    def _shares(self, i: int, x: Tensor) -> Tensor:
        return self.shares(x, getattr(self, f"centres_{i}"), getattr(self, f"inverse_widths_{i}"))
