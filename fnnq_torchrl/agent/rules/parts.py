"""The parts of a variable that a reader of .fll and .fis files collects line by line."""

from dataclasses import dataclass, field
from math import inf

from fnnq_torchrl.agent.rules.errors import Place, RulesError
from fnnq_torchrl.agent.rules.partition import Label, Variable


@dataclass
class VariableParts:
    """The name, the range and the labels of a variable, as far as they have been read."""

    name: str
    place: Place
    low: float = -inf
    high: float = inf
    labels: list[Label] = field(default_factory=list)

    def variable(self) -> Variable:
        """Return the variable.

        Raises:
            RulesError: if the parts don't make a variable; the message names the place.
        """
        try:
            return Variable(self.name, tuple(self.labels), self.low, self.high)
        except RulesError as error:
            raise self.place.error(str(error)) from None
