"""The action values of fuzzy Q-learning, whose rules choose an action each."""

from collections.abc import Mapping
from math import ceil, prod
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from envs.core import streams
from envs.core.pure import WHEN
from envs.core.streams import Stream
from fnnq_torchrl.config.values import FuzzyQConfig
from fnnq_torchrl.equations.layout import runs_last
from fnnq_torchrl.equations.membership import combined, normalised
from fnnq_torchrl.equations.membership_functions import MEMBERSHIP_FUNCTIONS, membership_of

from .base import Choose
from .labels import Labels, LabelsValue

_WORDS = 4
"""The number of random words in a draw."""


class FuzzyQValue(LabelsValue):
    """A value q[i, a] for every state rule i and action label a; each rule chooses an action.

        a = Σᵢ φᵢaᵢ,   Q(s, a₁ … aₙ) = Σᵢ φᵢ q[i, aᵢ],   V(s) = Σᵢ φᵢ maxₐ q[i, a]

    φᵢ is the normalised firing strength of rule i in the state s, and aᵢ is the action that rule i
    chooses among the middles of the action's labels, by its own values and its own random number.
    The executed action a is their mean. It may lie between them, so the world must take any action
    in its range. Q belongs to the rules' choices, not to a; so ``action`` of :meth:`forward` are
    the choices, ``[runs, *batch, rules]``. The values of all candidates are each rule's share
    φᵢ q[i, ·] of Q, ``[runs, *batch, rules, labels of the action]``.

    Source: P. Y. Glorennec, L. Jouffe, "Fuzzy Q-learning", FUZZ-IEEE 1997; L. Jouffe, "Fuzzy
    inference system learning by reinforcement methods", IEEE Trans. Systems, Man and Cybernetics C
    28(3), 1998.

    Args:
        inputs, action: as in :class:`fnnq_torchrl.agent.values.labels.LabelsValue`.
        candidates: actions over the world's range, to whose ends the labels' middles are clipped;
            their dtype and device are the network's.
        **others: the other arguments of ``LabelsValue``, which raises the same errors.
    """

    schema = FuzzyQConfig
    choice_key = "choices"
    chance_keys = WHEN

    groups: Tensor

    def __init__(
        self,
        inputs: Mapping[str, Labels],
        action: Labels,
        candidates: Tensor,
        *,
        width: str = "sigma",
        **others: Any,
    ) -> None:
        labels = [membership_of(label, width) for label in action]
        middles = [MEMBERSHIP_FUNCTIONS[kind].middle(numbers) for kind, numbers in labels]
        chosen_from = candidates.new_tensor(middles).clamp(candidates.amin(), candidates.amax())
        super().__init__(inputs, action, chosen_from, width=width, **others)
        self._rules = prod(self.weight.shape[1:-1])
        groups = torch.arange(ceil(self._rules / _WORDS), device=candidates.device)
        self.register_buffer("groups", groups, persistent=False)

    def shares(self, log_degrees: Tensor) -> Tensor:
        return normalised(log_degrees)

    def forward(self, *observations: Tensor, action: Tensor | None = None) -> Tensor:
        values = self._share_of_rules(self._strengths(*observations))
        if action is None:
            return values.movedim((-1, 0, 1), (0, -2, -1))
        chosen = action.movedim((-1, 0), (0, -1)).unsqueeze(1)  # [rules, 1, *batch, runs]
        is_chosen = (chosen == self._candidates(chosen.ndim)).to(values.dtype)
        return (values * is_chosen).sum((0, 1)).movedim(-1, 0).unsqueeze(-1)

    def decide(self, state: TensorDictBase, choose: Choose) -> dict[str, Tensor]:
        strengths = self._strengths(*(state[key] for key in self.in_keys))
        values = self._values(strengths.ndim).expand(-1, -1, *strengths.shape[1:])
        chosen = choose(values.movedim((1, -1), (0, 2)), self._chances(state))
        return {
            "action_value": self._share_of_rules(strengths).movedim((-1, 0, 1), (0, -2, -1)),
            "choices": chosen.movedim(0, -1),
            "action": self._mean(strengths, chosen),
        }

    def best(self, action_values: Tensor) -> Tensor:
        return action_values.amax(-1).sum(-1, keepdim=True)

    def greedy(self, *observations: Tensor) -> Tensor:
        strengths = self._strengths(*observations)
        chosen = self.candidates[self._values(strengths.ndim).argmax(1)].movedim(-1, 1)
        return self._mean(strengths, chosen)

    def _remember_candidates(self) -> None:
        """Keep nothing: the rules choose a label, so no action has degrees."""

    def _candidates(self, dimensions: int) -> Tensor:
        """Return the candidates as ``[1, candidates, 1, …]`` with this number of dimensions."""
        return self.candidates.view(1, -1, *[1] * (dimensions - 2))

    def _strengths(self, *observations: Tensor) -> Tensor:
        """Return φ, ``[rules, *batch, runs]``."""
        shares = [self._shares(i, runs_last(x.squeeze(-1))) for i, x in enumerate(observations)]
        return combined(shares)

    def _values(self, dimensions: int) -> Tensor:
        """Return q for strengths with this number of dimensions, ``[rules, candidates, …, runs]``.

        The dimensions between have the size 1.
        """
        q = runs_last(self.weight).flatten(0, -3)
        return q.view(*q.shape[:2], *[1] * (dimensions - 2), q.shape[-1])

    def _share_of_rules(self, strengths: Tensor) -> Tensor:
        """Return φᵢ q[i, ·], ``[rules, candidates, *batch, runs]``."""
        return strengths.unsqueeze(1) * self._values(strengths.ndim)

    def _mean(self, strengths: Tensor, chosen: Tensor) -> Tensor:
        """Return the action of the rules' choices, ``[runs, *batch, 1]``.

        Args:
            strengths: φ, ``[rules, *batch, runs]``.
            chosen: the choices, ``[rules, runs, *batch]``.
        """
        action = (strengths.movedim(-1, 1) * chosen).sum(0).unsqueeze(-1)
        # φ sums to 1 only up to rounding.
        lowest, highest = self.candidates.amin(), self.candidates.amax()
        return torch.minimum(torch.maximum(action, lowest), highest)

    def _chances(self, state: TensorDictBase) -> Tensor:
        """Return a random number of each rule, U[0, 1), ``[rules, runs, *batch]``."""
        seed, episode, step = (state[key] for key in WHEN)
        counter = step * len(self.groups) + self.groups
        when = seed.expand_as(counter), episode.expand_as(counter), counter
        words = streams.uniform(streams.draw(*when, Stream.LEARNER), self.candidates.dtype)
        return words.movedim(-1, 0).flatten(0, 1)[: self._rules]
