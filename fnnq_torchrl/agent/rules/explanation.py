"""Explain a greedy action: the rules that fired, and their contributions to Q."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isclose

from torch import Tensor


@dataclass(frozen=True, eq=False)
class Explanation:
    """The rules' firing and their contributions to Q in one state.

    ``print`` shows it as tables.

    Attributes:
        observation: the state, a number for each input by name.
        action_name: the action's name.
        premises: the rules' premises in words, ``[rules]``.
        consequents: the rules' consequents, ``[rules]``.
        candidates: the candidate actions, ``[candidates]``.
        firing: each rule's normalised firing strength for each candidate, ``[candidates, rules]``.
    """

    observation: dict[str, float]
    action_name: str
    premises: Sequence[str]
    consequents: Tensor
    candidates: Tensor
    firing: Tensor

    @property
    def contributions(self) -> Tensor:
        """Each rule's contribution to each candidate's Q, ``[candidates, rules]``."""
        return self.firing * self.consequents

    @property
    def values(self) -> Tensor:
        """Q of each candidate, ``[candidates]``."""
        return self.contributions.sum(-1)

    @property
    def best(self) -> int:
        """The index of the best candidate; the first if several are equally good."""
        return int(self.values.argmax())

    @property
    def action(self) -> float:
        """The best candidate."""
        return float(self.candidates[self.best])

    def fired(self, least: float = 0.01) -> list[tuple[str, float, float, float]]:
        """Return the rules that fired for the best candidate, the strongest first.

        Args:
            least: the least firing strength; weaker rules are left out.

        Returns:
            A tuple for each rule: premise, firing strength, consequent, contribution to Q.
        """
        strengths, added = self.firing[self.best].tolist(), self.contributions[self.best].tolist()
        rows = zip(self.premises, strengths, self.consequents.tolist(), added, strict=True)
        strong = [row for row in rows if row[1] >= least]
        # Equal strengths differ by rounding errors; then the larger contribution comes first.
        return sorted(strong, key=lambda row: (-round(row[1], 6), -abs(row[3])))

    def __str__(self) -> str:
        seen = ", ".join(f"{name} = {value:g}" for name, value in self.observation.items())
        values = self.values.tolist()
        best, second = values[self.best], sorted(values)[-2] if len(values) > 1 else values[0]
        lines = [
            f"{seen}: {self.action_name} {self.action:+.3g}, whose Q is the highest: {best:.4g}",
            f"  {'fires':>6} {'says':>8} {'adds':>8}",
        ]
        lines += [
            f"  {strength:>6.1%} {value:>8.3g} {added:>+8.3g}  {premise}"
            for premise, strength, value, added in self.fired()
        ]
        lines += ["", f"  {self.action_name:>8} {'Q':>9}"]
        lines += [
            f"  {round(action, 6):>+8.3g} {value:>9.4f}{'  <' if i == self.best else ''}"
            for i, (action, value) in enumerate(zip(self.candidates.tolist(), values, strict=True))
        ]
        if isclose(best, second, abs_tol=1e-12):
            lines.append("  several actions are the best; a learner draws one of them by lot")
        return "\n".join(lines)
