"""Q(s, a) as a fuzzy neural network (paper, section 2)."""

from collections.abc import Mapping, Sequence

from torch import Tensor, nn

from fnnq_torchrl.layout import runs_first, runs_last
from fnnq_torchrl.membership import defuzzify, firing_shares, rule_width

from .base import ValueNetwork

Labels = Sequence[tuple[float, float]]


class FNNQValue(ValueNetwork):
    """A zero-order Takagi–Sugeno rule base: every label of every input with every action label.

    «If bearing is S₁ … and action is A₁ then the value is w₁₁.» Membership is Gaussian with fixed
    centres and widths, the t-norm is the product, the defuzzifier the weighted average; what
    learns are the consequents, singletons w, all zero at the start (paper, eq. 6–9).

    Every run has consequents of its own: ``weight`` is ``[runs, labels of input 1, …, action
    labels]``. Its memory has the runs last, because that is how the arithmetic wants it.

    Args:
        inputs: for each observation, by its name in the TensorDict, its labels (centre, width).
        action: the action's labels (centre, width).
        candidates: the actions among which the best is sought, ``[candidates]``; their dtype and
            device are the network's.
        width: whether a label's second number is a ``"sigma"`` or a ``"variance"``.
        runs: how many learners this batch holds; a single one serves inputs of any batch size.

    Raises:
        ValueError: if ``width`` is neither.
    """

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
            # Every buffer has memory of its own: a compiled loop allows no aliases.
            self.register_buffer(f"centres_{i}", candidates.new_tensor(centres))
            self.register_buffer(f"inverse_widths_{i}", candidates.new_tensor(inverse_widths))
        # The candidates never change, and so neither do their shares in the firing strengths.
        shares = self._shares(len(inputs), candidates.unsqueeze(-1))
        self.register_buffer("candidate_shares", shares, persistent=False)
        consequents = candidates.new_zeros([*map(len, dimensions), runs])
        self.weight = nn.Parameter(runs_first(consequents))

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        shares = [self._shares(i, runs_last(x.squeeze(-1))) for i, x in enumerate(observations)]
        if action is None:
            every_state = (*self.candidate_shares.shape[:2], *[1] * (shares[0].ndim - 1))
            action_shares = self.candidate_shares.view(every_state)
        else:
            action_shares = self._shares(len(shares), runs_last(action.squeeze(-1)).unsqueeze(0))
        return defuzzify(runs_last(self.weight), shares, action_shares).movedim((0, -1), (-1, 0))

    def _shares(self, i: int, x: Tensor) -> Tensor:
        return firing_shares(x, getattr(self, f"centres_{i}"), getattr(self, f"inverse_widths_{i}"))
