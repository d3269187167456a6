"""The rules of fuzzy Q-learning, each of which chooses an action."""

from pathlib import Path
from typing import ClassVar

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.controller import Controller, exact
from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.formats import export_system
from fnnq_torchrl.agent.rules.rule_base import RuleBase
from fnnq_torchrl.agent.rules.system import FuzzySystem


class ChoiceRules(RuleBase):
    """Rules of which those with the same state labels are one rule that chooses an action label.

    A consequent is the value q of a choice. The greedy policy executes the mean of the choices with
    the highest values, so it is itself a controller with one number for each state rule: nothing
    is lost when it is written as one.

    Attributes:
        candidates: the action of each action label, in the labels' order.
    """

    compares: ClassVar[bool] = False

    @property
    def chosen(self) -> FuzzySystem:
        """The greedy policy: each state rule with the action that it chooses."""
        numbers = torch.tensor(self.candidates, dtype=torch.float64)[self.consequents.argmax(-1)]
        return FuzzySystem(self.states, self.action.name, numbers, self.t_norm, self.elsewhere)

    def firing(self, points: Tensor) -> Tensor:
        """Return the state rules' firing strengths at their greedy choices, and 0 at the others.

        Arguments and result as in :meth:`.FuzzySystem.firing`; the action in ``points`` is ignored.
        """
        is_chosen = torch.nn.functional.one_hot(self.consequents.argmax(-1), self.shape[-1])
        return self.chosen.firing(points[..., :-1]).unsqueeze(-1) * is_chosen

    def action_values(self, states: Tensor) -> Tensor:
        """Return Q if all rules choose the same action, for each, ``[*points, candidates]``."""
        firing = self.chosen.firing(states).flatten(states.ndim - 1)
        return firing @ self.consequents.flatten(0, -2)

    def state_values(self, states: Tensor) -> Tensor:
        firing = self.chosen.firing(states)
        return (firing * self.consequents.amax(-1)).flatten(states.ndim - 1).sum(-1)

    def greedy(self, states: Tensor) -> Tensor:
        """Return the mean of the rules' greedy choices, ``[*points]``, float64."""
        return self.chosen.evaluate(states)

    def controller(self) -> Controller:
        """Return the greedy policy, which is one number for each state rule."""
        return exact(self.chosen, self.action)

    def export(
        self, path: str | Path, *, controller: str | None = None, floats: bool = False
    ) -> list[Path]:
        """Write the greedy policy; arguments and errors as in :meth:`.RuleBase.export`.

        It is the same for ``"full"`` and ``"distilled"``, and every format can express it. There is
        no Q of state and action to write.
        """
        if controller not in ("full", "distilled"):
            raise RulesError(
                "controller=full or distilled is needed: fuzzy Q-learning has no Q of an action "
                "that could be written"
            )
        return export_system(Path(path), self.chosen, floats=floats)
