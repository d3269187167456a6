"""Our own text format: rules as sentences, below the definitions of their words.

Each line is one definition or one rule; # starts a comment. The definitions, which a file of prior
knowledge may leave out::

    input bearing from -1.0 to 1.0
    label far_right gaussian -0.5 0.4
    ...
    action steer from -1.0 to 1.0
    label hard_left gaussian -1.0 0.4
    ...
    candidates -1.0 0.0 1.0
    t_norm product
    elsewhere nearest

and the rules, either for values or from state to action::

    if bearing is far_left and steer is hard_left then value is 0.5
    if bearing is far_left then steer hard_left
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices
from fnnq_torchrl.agent.rules.grid import Grid
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.parts import Content, Definitions, VariableParts
from fnnq_torchrl.agent.rules.system import FuzzySystem, fit_inputs, fit_names
from fnnq_torchrl.agent.rules.tokens import Token, Tokens
from fnnq_torchrl.equations.membership_functions import (
    ELSEWHERE,
    MEMBERSHIP_FUNCTIONS,
    T_NORMS,
)

_MOST_LABELS = 1_000


def write(system: FuzzySystem, candidates: Sequence[float] = ()) -> str:
    """Return the text of a system with its definitions, with every number in full precision.

    Args:
        system: Q, with the action as its last input, or any other system.
        candidates: for Q, the candidate actions of the greedy choice; else empty.
    """
    system = fit_names(system)
    lines = ["# Rules of fnnq_torchrl; docs/rules.md says how they are written."]
    for i, variable in enumerate(system.inputs):
        kind = "action" if candidates and i == len(system.inputs) - 1 else "input"
        lines.append(f"{kind} {variable.name} from {variable.low!r} to {variable.high!r}")
        for label in variable.labels:
            numbers = " ".join(map(repr, label.parameters))
            lines.append(f"label {label.name} {label.kind} {numbers}")
    if candidates:
        lines.append(f"candidates {' '.join(map(repr, candidates))}")
    lines += [f"t_norm {system.t_norm}", f"elsewhere {system.elsewhere}", "", *system.sentences()]
    return "".join(f"{line}\n" for line in lines)


def read(text: str, file: str) -> Content:
    """Read a complete system: definitions, and a rule for every combination of labels.

    Args:
        text: the file's text.
        file: the file's name, for messages.

    Raises:
        RulesError: if the text has a mistake; the message gives the place.
    """
    lines, rules = _read_lines(text, file)
    definitions = lines.finish(file)
    variables = definitions.variables
    if not variables:
        raise Place(file, 1).error("expected input NAME from NUMBER to NUMBER")
    end = Place(file, max(1, text.count("\n")))
    grid, output = Grid(variables), ""
    for tokens in rules:
        words = _Words(tokens, variables)
        name, token = words.output()
        if output and name != output:
            raise token.error(f"expected {output}, as in the rules before")
        output = name
        grid.put(words.labels(), words.number(), token.place)
    if not output:
        raise end.error("expected rules: if ... then ...")
    numbers = grid.consequents(end)
    return Content.build(definitions, output, numbers, Place(file, 1), lines.candidates)


def read_definitions(text: str, file: str) -> Definitions:
    """Read the definitions of a file, which may lack some or all definitions.

    Args:
        text, file: as in :func:`read`.

    Raises:
        RulesError: if a definition has a mistake; the message gives the place.
    """
    return _read_lines(text, file)[0].finish(file)


@dataclass(frozen=True)
class Knowledge:
    """Prior knowledge: some rules about variables that are defined elsewhere.

    Attributes:
        values: values of Q by the indices of the rule's labels, of each state input and then of
            the action.
        actions: actions by the indices of the state inputs' labels; for an action named by a
            label, the label's middle.
    """

    values: dict[tuple[int, ...], float]
    actions: dict[tuple[int, ...], float]


def read_knowledge(
    text: str,
    file: str,
    variables: Sequence[Variable],
    t_norm: str = "product",
    elsewhere: str = "nearest",
) -> Knowledge:
    """Read any number of rules, for values and from state to action, about known variables.

    Args:
        text: the file's text; its definitions, if any, must agree with the network's.
        file: the file's name, for messages.
        variables: the network's state inputs and, last, the action.
        t_norm, elsewhere: the network's settings.

    Raises:
        RulesError: if a word is unknown, two rules have the same labels, or the definitions differ;
            the message gives the place.
    """
    lines, rules = _read_lines(text, file)
    lines.finish(file).check(variables, t_norm, elsewhere)
    variables = fit_inputs(variables)
    *states, action = variables
    values, actions = Grid(variables), Grid(states)
    for tokens in rules:
        words = _Words(tokens, variables)
        name, token = words.output()
        if words.about_actions:
            values.put(words.labels(), words.number(), token.place)
        elif name == action.name:
            actions.put(words.labels(), words.action(action), token.place)
        else:
            raise token.error(f"expected {action.name}, or a label of it in the premise")
    return Knowledge(values.known, actions.known)


class _Words:
    """A reader of one rule, which reads the premise on creation.

    Args:
        tokens: the rule's line, from its ``if`` on.
        variables: the variables that the premise may name.
    """

    def __init__(self, tokens: Tokens, variables: Sequence[Variable]) -> None:
        self.tokens, self._variables = tokens, variables
        self._premise: dict[str, int] = {}
        names = [variable.name for variable in variables]
        self._if = tokens.word("if")
        while True:
            token = tokens.one_of(names, "input")
            if token.text in self._premise:
                raise token.error("is in the premise already")
            tokens.word("is")
            variable = variables[names.index(token.text)]
            label = tokens.one_of(variable.names, f"label of {variable.name}")
            self._premise[variable.name] = variable.names.index(label.text)
            if tokens.word("and", "then").text.lower() == "then":
                break

    @property
    def about_actions(self) -> bool:
        """True if the premise names the last variable."""
        return self._variables[-1].name in self._premise

    def output(self) -> tuple[str, Token]:
        """Read the output's name and an optional ``is``; return the name and its token."""
        token = self.tokens.take("an output")
        if self.tokens.peek().lower() == "is":
            self.tokens.take("is")
        return token.text, token

    def labels(self) -> list[int]:
        """Return the index of each variable's label, without the last variable if it isn't named.

        Raises:
            RulesError: if another variable is missing in the premise.
        """
        due = self._variables if self.about_actions else self._variables[:-1]
        for variable in due:
            if variable.name not in self._premise:
                raise self._if.error(f"{variable.name} is missing in the premise")
        return [self._premise[variable.name] for variable in due]

    def action(self, variable: Variable) -> float:
        """Read the action at the end of the line, a number or a label; a label means its middle."""
        if re.match(r"[-+.\d]", self.tokens.peek()):
            return self.number()
        word = self.tokens.one_of(variable.names, f"label of {variable.name}")
        self.tokens.end()
        label = variable.labels[variable.names.index(word.text)]
        return label.function.middle(label.parameters)

    def number(self) -> float:
        """Read the output's number at the end of the line."""
        value = self.tokens.number()
        self.tokens.end()
        return value


@dataclass
class _Definitions:
    """The definitions read so far."""

    variables: list[VariableParts] = field(default_factory=list)
    candidates: tuple[float, ...] = ()
    settings: dict[str, str] = field(default_factory=dict)
    places: dict[int | str, Place] = field(default_factory=dict)
    action: bool = False

    def finish(self, file: str) -> Definitions:
        """Build the variables from all definitions."""
        variables = tuple(parts.variable() for parts in self.variables)
        places = self.places | {i: parts.place for i, parts in enumerate(self.variables)}
        return Definitions(file, variables, self.settings, places)


def _read_lines(text: str, file: str) -> tuple[_Definitions, list[Tokens]]:
    """Read the definitions; return them and the lines of the rules, which must come after them."""
    definitions, rules = _Definitions(), []
    for tokens in _lines(text, file):
        keyword = tokens.peek().lower()
        if keyword == "if":
            rules.append(tokens)
            continue
        first = tokens.take("a line")
        if keyword not in _DEFINE:
            raise first.error(choices(keyword, ["if", *_DEFINE]))
        if rules:
            raise first.error("expected if: the definitions stand above the rules")
        _DEFINE[keyword](definitions, tokens, first)
        tokens.end()
    return definitions, rules


def _lines(text: str, file: str) -> Iterator[Tokens]:
    for i, line in enumerate(text.split("\n"), start=1):
        if (content := line.partition("#")[0]).strip():
            yield Tokens(content, Place(file, i))


def _variable(definitions: _Definitions, tokens: Tokens, first: Token) -> None:
    if definitions.action:
        raise first.error("the action is the last of the inputs")
    definitions.action = first.text.lower() == "action"
    variable = VariableParts(tokens.take("a name").text, first.place)
    if tokens.peek():
        tokens.word("from")
        variable.low = tokens.number(finite=False)
        tokens.word("to")
        variable.high = tokens.number(finite=False)
    definitions.variables.append(variable)


def _label(definitions: _Definitions, tokens: Tokens, first: Token) -> None:
    if not definitions.variables:
        raise first.error("expected input: a label belongs to the input above it")
    labels = definitions.variables[-1].labels
    name = tokens.take("a name").text
    kind = tokens.one_of(MEMBERSHIP_FUNCTIONS, "membership function").text
    numbers = tokens.numbers()
    if len(labels) == _MOST_LABELS:
        raise first.error(f"at most {_MOST_LABELS:,} labels are read")
    try:
        labels.append(Label(name, kind, tuple(numbers)))
    except RulesError as error:
        raise first.place.error(str(error)) from None


def _candidates(definitions: _Definitions, tokens: Tokens, first: Token) -> None:
    numbers = tokens.numbers()
    if not numbers or sorted(set(numbers)) != numbers:
        raise first.error("expected rising numbers")
    definitions.candidates = tuple(numbers)


def _setting(definitions: _Definitions, tokens: Tokens, first: Token) -> None:
    name = first.text.lower()
    known, what = {"t_norm": (T_NORMS, "t-norm"), "elsewhere": (ELSEWHERE, "choice")}[name]
    definitions.settings[name] = tokens.one_of(known, what).text
    definitions.places[name] = first.place


_DEFINE = {
    "input": _variable,
    "action": _variable,
    "label": _label,
    "candidates": _candidates,
    "t_norm": _setting,
    "elsewhere": _setting,
}
