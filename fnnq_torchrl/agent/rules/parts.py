"""The results of the readers of rules, with places for messages."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from math import inf

from torch import Tensor

from fnnq_torchrl.agent.rules.errors import Place, RulesError
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.system import FuzzySystem, fit_inputs

_REMEDY = "without value.inputs, value.action and value.names, the file's labels are used"


@dataclass(frozen=True, eq=False)
class Definitions:
    """The variables and the settings that a file of rules defines.

    Attributes:
        file: the file's name.
        variables: the inputs in order; empty if the file defines none.
        settings: ``t_norm`` and ``elsewhere``, as far as the file has them.
        places: the place of each variable, by its index, and of each setting, by its name; empty
            if the rules don't come from a text.
    """

    file: str
    variables: tuple[Variable, ...]
    settings: Mapping[str, str]
    places: Mapping[int | str, Place] = field(default_factory=dict)

    def error(self, message: str, of: int | str = 0) -> RulesError:
        """Return an error at the place of a variable or of a setting, by its index or name."""
        place = self.places.get(of)
        return RulesError(f"{self.file}: {message}") if place is None else place.error(message)

    def check(self, variables: Sequence[Variable], t_norm: str, elsewhere: str) -> None:
        """Check that the definitions agree with a network's variables and settings.

        Args:
            variables: the network's state inputs and, last, the action. A file with a controller
                has no action among its inputs.
            t_norm, elsewhere: the network's settings.

        Raises:
            RulesError: if they differ; the message gives the place and the expected definition.
        """
        for name, ours in (("t_norm", t_norm), ("elsewhere", elsewhere)):
            setting = self.settings.get(name, ours)
            if setting != ours:
                raise self.error(
                    f"its {name} is {setting}, the network's is {ours}; "
                    f"value.{name}={setting} changes that",
                    name,
                )
        wanted, given = fit_inputs(variables), fit_inputs(self.variables)
        names, known = ([each.name for each in of] for of in (given, wanted))
        if given and names not in (known, known[:-1]):
            pairs = zip_longest(names, known)
            place = next(i for i, (other, own) in enumerate(pairs) if own != other)
            raise self.error(
                f"another partition: its inputs are {', '.join(names)}, the network's are "
                f"{', '.join(known)}",
                min(place, len(names) - 1),
            )
        for i, (own, other) in enumerate(zip(wanted, given, strict=False)):
            if own.names != other.names:
                raise self.error(
                    f"another partition: its labels of {own.name} are {', '.join(other.names)}, "
                    f"the network's are {', '.join(own.names)}; "
                    f"value.names.{own.name}=[{','.join(other.names)}] renames; {_REMEDY}",
                    i,
                )
            for label, expected in zip(other.labels, own.labels, strict=True):
                if label != expected:
                    raise self.error(
                        f"another partition: {own.name} {label.name} is {label.words}; expected "
                        f"{expected.words}; {_REMEDY}",
                        i,
                    )


@dataclass(frozen=True, eq=False)
class Content:
    """The content of a file with a complete system.

    Attributes:
        system: the system.
        definitions: its inputs and settings, with their places.
        candidates: the candidate actions; empty if the file has none.
    """

    system: FuzzySystem
    definitions: Definitions
    candidates: tuple[float, ...] = ()

    @classmethod
    def build(
        cls,
        definitions: Definitions,
        output: str,
        consequents: Tensor,
        place: Place,
        candidates: tuple[float, ...] = (),
    ) -> "Content":
        """Build the system of a file from its parts.

        Args:
            definitions: the inputs and settings.
            output, consequents: as in :class:`.FuzzySystem`.
            place: the place to name in errors.
            candidates: the candidate actions; may be empty.

        Raises:
            RulesError: if the parts don't make a system.
        """
        try:
            system = FuzzySystem(definitions.variables, output, consequents, **definitions.settings)
        except RulesError as error:
            raise place.error(str(error)) from None
        return cls(system, definitions, candidates)


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
