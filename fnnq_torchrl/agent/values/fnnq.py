"""Q(s, a) as a fuzzy neural network (paper, section 2)."""

from collections.abc import Mapping, Sequence
from typing import Any

from torch import Tensor, nn

from fnnq_torchrl.config.values import FuzzyConfig
from fnnq_torchrl.equations.layout import runs_first, runs_last
from fnnq_torchrl.equations.membership import (
    log_membership,
    moved_labels,
    normalised,
    weighted_minima,
)
from fnnq_torchrl.equations.membership_functions import Membership

from .labels import Labels, LabelsValue


class FNNQValue(LabelsValue):
    """A zero-order Takagi–Sugeno rule base: every label of every input with every action label.

    «If bearing is S₁ … and action is A₁ then the value is w₁₁.» The t-norm is the product unless
    set, the defuzzifier the weighted average. The memberships are fixed; what learns are the
    consequents, singletons w, all zero at the start (paper, eq. 6–9).

    Args:
        inputs, action, candidates: as of :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
        t_norm: ``"product"`` or ``"minimum"``.
        **others: as of that class, and so are the errors.
    """

    schema = FuzzyConfig

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        candidates: Tensor,
        *,
        t_norm: str = "product",
        **others: Any,
    ) -> None:
        super().__init__(inputs, action, candidates, **others)
        self.t_norm = t_norm
        self._remember_candidates()

    @classmethod
    def from_config(cls, config: Any, candidates: Tensor, runs: int) -> "FNNQValue":
        settings: dict[str, Any] = {
            "width": config.width,
            "elsewhere": config.elsewhere,
            "t_norm": config.t_norm,
            "runs": runs,
        }
        if not config.learn_memberships:
            return FNNQValue(config.inputs, config.action, candidates, **settings)
        return LearnedLabelsValue(
            config.inputs,
            config.action,
            candidates,
            least_width=config.least_width,
            **settings,
        )

    def shares(self, log_degrees: Tensor) -> Tensor:
        return normalised(log_degrees)

    def _shares(self, i: int, x: Tensor) -> Tensor:
        # With the minimum nothing factors: the rules are combined from the degrees themselves.
        return self._log_degrees(i, x) if self.t_norm == "minimum" else super()._shares(i, x)

    def _average(
        self, consequents: Tensor, shares: Sequence[Tensor], action_shares: Tensor
    ) -> Tensor:
        average = weighted_minima if self.t_norm == "minimum" else super()._average
        return average(consequents, shares, action_shares)


_MOVES = ("middle", "gaps", "widths")


class LearnedLabelsValue(FNNQValue):
    """The fuzzy neural network with Gaussians whose centres and widths are learned, too.

    The labels of dimension i, the inputs and last the action, are moved by parameters of every run,
    all 0 at the start: ``middle_i`` ``[runs, 1]`` moves all together, ``gaps_i`` ``[runs, labels −
    1]`` neighbours apart, and ``widths_i`` ``[runs, labels]`` widens each
    (:func:`fnnq_torchrl.equations.membership.moved_labels`). So any step of them keeps the labels'
    order and a least width.

    Args:
        inputs, action, candidates: as of :class:`FNNQValue`; all labels are Gaussian.
        least_width: no label is narrower than this share of its width at the start.
        **others: as of that class, and so are the errors.
    """

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        candidates: Tensor,
        *,
        least_width: float,
        **others: Any,
    ) -> None:
        super().__init__(inputs, action, candidates, **others)
        self._least_width = least_width
        runs = len(self.weight)
        for i, labels in enumerate(self._labels):
            for name, size in zip(_MOVES, (1, len(labels) - 1, len(labels)), strict=True):
                if size:  # a single label has no neighbours
                    zeros = runs_first(candidates.new_zeros(size, runs))
                    self.register_parameter(f"{name}_{i}", nn.Parameter(zeros))

    def labels_of(self, run: int | None = None) -> list[list[Membership]]:
        found: list[list[Membership]] = []
        for i in range(len(self._labels)):
            centres, inverse_widths = (numbers.detach().double() for numbers in self._moved(i))
            both = (
                numbers.mean(-1).tolist() if run is None else numbers[:, run].tolist()
                for numbers in (centres, inverse_widths.reciprocal())
            )
            found.append([("gaussian", pair) for pair in zip(*both, strict=True)])
        return found

    def _remember_candidates(self) -> None:
        """Nothing stays: their labels move."""

    def _candidate_shares(self) -> Tensor:
        return self._shares(len(self._labels) - 1, self.candidates.unsqueeze(-1))

    def _log_degrees(self, i: int, x: Tensor) -> Tensor:
        return log_membership(x, *self._moved(i))

    def _moved(self, i: int) -> tuple[Tensor, Tensor]:
        """The centres of dimension i and the inverses of the widths, ``[labels, runs]``."""
        moves = {
            name: runs_last(getattr(self, f"{name}_{i}"))
            for name in _MOVES
            if hasattr(self, f"{name}_{i}")
        }
        start = self.get_buffer(f"centres_{i}"), self.get_buffer(f"inverse_widths_{i}")
        return moved_labels(*start, least_width=self._least_width, **moves)
