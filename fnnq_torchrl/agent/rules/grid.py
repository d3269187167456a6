"""Rules that are read one after the other, put in their places."""

from collections.abc import Sequence

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.errors import Place, RulesError
from fnnq_torchrl.agent.rules.partition import Variable
from fnnq_torchrl.agent.rules.system import check_size


class Grid:
    """A number for each label of each variable with each of the others', as they become known.

    Args:
        variables: in their order.
    """

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.variables = variables
        check_size([len(variable.labels) for variable in variables])
        self._numbers: dict[tuple[int, ...], tuple[float, Place]] = {}

    def put(self, labels: Sequence[int], value: float, place: Place) -> None:
        """Put a rule's number in its place.

        Raises:
            RulesError: there is a rule for these labels already.
        """
        key = tuple(labels)
        if key in self._numbers:
            earlier, where = self._numbers[key]
            words = "is there twice" if earlier == value else "contradicts an earlier one"
            raise place.error(f"the rule for {self._words(key)} {words}, of line {where.line}")
        self._numbers[key] = (value, place)

    @property
    def known(self) -> dict[tuple[int, ...], float]:
        """The numbers by the places of their rules' labels."""
        return {key: value for key, (value, _) in self._numbers.items()}

    def consequents(self, end: Place) -> Tensor:
        """All the numbers, float64.

        Args:
            end: the end of the file.

        Raises:
            RulesError: a rule is missing.
        """
        numbers = torch.zeros([len(variable.labels) for variable in self.variables]).double()
        for key in (
            torch.cartesian_prod(*map(torch.arange, numbers.shape))
            .reshape(-1, numbers.ndim)
            .tolist()
        ):
            if tuple(key) not in self._numbers:
                raise self.missing(key, end)
            numbers[tuple(key)] = self._numbers[tuple(key)][0]
        return numbers

    def missing(self, key: Sequence[int], end: Place) -> RulesError:
        """The error that there is no rule for these labels."""
        return end.error(
            f"there is no rule for {self._words(key)}; a rule base has one for every label of "
            "each input with each of the others'"
        )

    def _words(self, key: Sequence[int]) -> str:
        pairs = zip(self.variables, key, strict=True)
        return " and ".join(f"{variable.name} is {variable.names[i]}" for variable, i in pairs)
