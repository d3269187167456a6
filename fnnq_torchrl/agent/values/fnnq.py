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
    """A zero-order Takagi–Sugeno rule base, with a rule for every combination of labels.

    An example: «If bearing is S₁ … and action is A₁ then the value is w₁₁.» The t-norm is the
    product by default, and the defuzzifier is the weighted average. The memberships are fixed: only
    the consequents w are learned. They are singletons and start at zero (paper, eq. 6–9).

    Args:
        inputs, action, candidates: as in :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
        t_norm: ``"product"`` or ``"minimum"``.
        **others: the other arguments of ``LabelsValue``, which raises the same errors.
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
        # With the minimum, rule strengths don't factor into shares, so the log degrees are used.
        return self._log_degrees(i, x) if self.t_norm == "minimum" else super()._shares(i, x)

    def _average(
        self, consequents: Tensor, shares: Sequence[Tensor], action_shares: Tensor
    ) -> Tensor:
        average = weighted_minima if self.t_norm == "minimum" else super()._average
        return average(consequents, shares, action_shares)


_MOVES = ("middle", "gaps", "widths")


class LearnedLabelsValue(FNNQValue):
    """The fuzzy neural network with Gaussian labels whose centres and widths are learned, too.

    Dimension i is an input or, last, the action. Each run has three parameters per dimension, all 0
    at the start: ``middle_i`` ``[runs, 1]`` shifts all labels, ``gaps_i`` ``[runs, labels − 1]``
    moves neighbours apart, and ``widths_i`` ``[runs, labels]`` widens each label. Any values of
    them keep the labels' order and a least width
    (:func:`fnnq_torchrl.equations.membership.moved_labels`).

    Args:
        inputs, action, candidates: as in :class:`FNNQValue`; all labels must be Gaussian.
        least_width: the least width of a label, as a share of its width at the start.
        **others: the other arguments of ``FNNQValue``, which raises the same errors.
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
        """Keep nothing: the candidates' shares change as the labels move."""

    def _candidate_shares(self) -> Tensor:
        return self._shares(len(self._labels) - 1, self.candidates.unsqueeze(-1))

    def _log_degrees(self, i: int, x: Tensor) -> Tensor:
        return log_membership(x, *self._moved(i))

    def _moved(self, i: int) -> tuple[Tensor, Tensor]:
        """Return the present centres and inverse widths of dimension i, each ``[labels, runs]``."""
        moves = {
            name: runs_last(getattr(self, f"{name}_{i}"))
            for name in _MOVES
            if hasattr(self, f"{name}_{i}")
        }
        start = self.get_buffer(f"centres_{i}"), self.get_buffer(f"inverse_widths_{i}")
        return moved_labels(*start, least_width=self._least_width, **moves)
