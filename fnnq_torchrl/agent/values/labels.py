"""The base class of value functions with a weight for every combination of labels."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import ClassVar, Self

from torch import Tensor, nn

from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.equations.layout import runs_first, runs_last
from fnnq_torchrl.equations.membership import (
    defuzzify,
    log_degrees,
    log_membership,
    zero_where_silent,
)
from fnnq_torchrl.equations.membership_functions import (
    MEMBERSHIP_FUNCTIONS,
    Membership,
    membership_of,
)

from .base import ValueNetwork

Labels = Sequence[Sequence[float] | Mapping[str, Sequence[float]]]


class LabelsValue(ValueNetwork):
    """Q(s, a) = Σ w·Πⱼ φⱼ(sⱼ)·φ(a), over every combination of the inputs' and the action's labels.

    A subclass defines φ, the degree to which a number belongs to each label.

    Every run has its own weights, all zero at the start: ``weight`` is ``[runs, labels of input 1,
    …, action labels]``. In memory the runs are the last dimension, for the equations.

    Args:
        inputs: the labels of each observation, by its key in the TensorDict. A label is (centre,
            width) of a Gaussian or {kind: parameters} of one of
            :data:`fnnq_torchrl.equations.membership_functions.MEMBERSHIP_FUNCTIONS`.
        action: the labels of the action.
        candidates: the candidate actions, ``[candidates]``, in the network's dtype and device.
        width: the meaning of the second number of (centre, width), ``"sigma"`` or ``"variance"``.
        elsewhere: the label that fires for a number outside of all labels: the ``"nearest"``, or
            none (``"zero"``).
        runs: the number of runs in the batch; a network of one run takes inputs of any batch size.

    Raises:
        ValueError: if ``width`` is neither of the two.
    """

    schema: ClassVar[type[LabelsConfig]] = LabelsConfig

    candidate_shares: Tensor
    t_norm = "product"

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        candidates: Tensor,
        *,
        width: str = "sigma",
        elsewhere: str = "nearest",
        runs: int = 1,
    ) -> None:
        super().__init__(list(inputs), candidates)
        if width not in ("sigma", "variance"):
            raise ValueError(f"width={width!r}: must be 'sigma' or 'variance'")
        self.elsewhere = elsewhere
        self._labels = [
            [membership_of(label, width) for label in labels]
            for labels in (*inputs.values(), action)
        ]
        self._gaussian = [_all_gaussian(labels) for labels in self._labels]
        # Each buffer has its own memory, because a compiled loop allows no aliases.
        for i, labels in enumerate(self._labels):
            if self._gaussian[i]:
                centres, widths = zip(*(parameters for _, parameters in labels), strict=True)
                self.register_buffer(f"centres_{i}", candidates.new_tensor(centres))
                inverse = [1 / sigma for sigma in widths]
                self.register_buffer(f"inverse_widths_{i}", candidates.new_tensor(inverse))
            else:
                for j, (_, parameters) in enumerate(labels):
                    self.register_buffer(f"parameters_{i}_{j}", candidates.new_tensor(parameters))
        self._remember_candidates()
        weights = candidates.new_zeros([*map(len, self._labels), runs])
        self.weight = nn.Parameter(runs_first(weights))

    @classmethod
    def from_config(cls, config: LabelsConfig, candidates: Tensor, runs: int) -> Self:
        return cls(
            config.inputs,
            config.action,
            candidates,
            width=config.width,
            elsewhere=config.elsewhere,
            runs=runs,
        )

    @abstractmethod
    def shares(self, log_degrees: Tensor) -> Tensor:
        """Return φ for every label of one input, at least one of which fires.

        Args:
            log_degrees: log μ, ``[labels, ..., runs]``.

        Returns:
            Of the same shape.
        """

    def labels_of(self, run: int | None = None) -> list[list[Membership]]:
        """Return the labels of each input, in the inputs' order, and last those of the action.

        Args:
            run: the index of a run, if each has its own labels; None for the mean over the runs.
        """
        return self._labels

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        shares = [self._shares(i, runs_last(x.squeeze(-1))) for i, x in enumerate(observations)]
        if action is None:
            of_candidates = self._candidate_shares()
            labels, candidates, *runs = of_candidates.shape
            every_state = (labels, candidates, *[1] * (shares[0].ndim - 2), *runs)
            action_shares = of_candidates.view(every_state)
        else:
            action_shares = self._shares(len(shares), runs_last(action.squeeze(-1)).unsqueeze(0))
        values = self._average(runs_last(self.weight), shares, action_shares)
        return values.movedim((0, -1), (-1, 0))

    def _average(
        self, consequents: Tensor, shares: Sequence[Tensor], action_shares: Tensor
    ) -> Tensor:
        """Return Q of every action; arguments and result as in :func:`defuzzify`."""
        return defuzzify(consequents, shares, action_shares)

    def _remember_candidates(self) -> None:
        """Compute the candidates' shares once: neither they nor the labels ever change."""
        shares = self._shares(len(self._labels) - 1, self.candidates.unsqueeze(-1))
        self.register_buffer("candidate_shares", shares, persistent=False)

    def _candidate_shares(self) -> Tensor:
        """Return φ of each action label for the candidates, ``[labels, candidates, runs or 1]``."""
        return self.candidate_shares

    def _shares(self, i: int, x: Tensor) -> Tensor:
        """Return φ of each label of dimension i, ``[labels, ..., runs]``.

        Args:
            i: the index of an input, or the number of inputs for the action.
            x: the numbers, ``[..., runs]``.
        """
        log_degrees = self._log_degrees(i, x)
        if self.elsewhere == "zero" and _all_compact(self._labels[i]):
            return zero_where_silent(self.shares, log_degrees)
        return self.shares(log_degrees)

    def _log_degrees(self, i: int, x: Tensor) -> Tensor:
        """Return log μ of each label of dimension i; arguments and shape as in :meth:`_shares`."""
        if self._gaussian[i]:
            gaussians = getattr(self, f"centres_{i}"), getattr(self, f"inverse_widths_{i}")
            return log_membership(x, *gaussians)
        labels = self._labels[i]
        parameters = [getattr(self, f"parameters_{i}_{j}").unbind(0) for j in range(len(labels))]
        kinds = [kind for kind, _ in labels]
        return log_degrees(x, [*zip(kinds, parameters, strict=True)], self.elsewhere)


def _all_gaussian(labels: Sequence[Membership]) -> bool:
    return all(kind == "gaussian" for kind, _ in labels)


def _all_compact(labels: Sequence[Membership]) -> bool:
    return all(MEMBERSHIP_FUNCTIONS[kind].compact for kind, _ in labels)
