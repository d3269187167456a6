"""Collect rules that are read one by one into a tensor of consequents."""

from collections.abc import Sequence

import torch
from torch import Tensor

from fnnq_torchrl.agent.rules.errors import Place, RulesError
from fnnq_torchrl.agent.rules.partition import Variable
from fnnq_torchrl.agent.rules.system import check_size


class Grid:
    """The rules read so far: a number for each combination of one label per variable.

    Args:
        variables: the inputs in order.
    """

    def __init__(self, variables: Sequence[Variable]) -> None:
        self.variables = variables
        check_size([len(variable.labels) for variable in variables])
        self._numbers: dict[tuple[int, ...], tuple[float, Place]] = {}

    def put(self, labels: Sequence[int], value: float, place: Place) -> None:
        """Add a rule.

        Args:
            labels: the index of a label of each variable.
            value: the rule's number.
            place: the rule's place in the file.

        Raises:
            RulesError: if there is already a rule for these labels.
        """
        key = tuple(labels)
        if key in self._numbers:
            earlier, where = self._numbers[key]
            words = "is there twice" if earlier == value else "contradicts an earlier one"
            raise place.error(f"the rule for {self._words(key)} {words}, of line {where.line}")
        self._numbers[key] = (value, place)

    @property
    def known(self) -> dict[tuple[int, ...], float]:
        """The rules' numbers by the indices of their labels."""
        return {key: value for key, (value, _) in self._numbers.items()}

    def consequents(self, end: Place) -> Tensor:
        """Return the consequents of all rules.

        Args:
            end: the end of the file, for messages.

        Returns:
            float64 ``[labels of variable 1, …, labels of the last]``.

        Raises:
            RulesError: if a rule is missing.
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
        """Return the error for a missing rule, given the indices of its labels."""
        return end.error(
            f"there is no rule for {self._words(key)}; a rule base has one for every label of "
            "each input with each of the others'"
        )

    def _words(self, key: Sequence[int]) -> str:
        pairs = zip(self.variables, key, strict=True)
        return " and ".join(f"{variable.name} is {variable.names[i]}" for variable, i in pairs)
