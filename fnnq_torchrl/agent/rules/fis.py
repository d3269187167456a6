"""The .fis format of MATLAB and Octave, restricted to zero-order Sugeno systems.

The format has no place for ``elsewhere`` or infinite ranges. They are written as comments such as
``% fnnq_torchrl elsewhere zero``, which only our reader reads.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices
from fnnq_torchrl.agent.rules.grid import Grid
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.parts import Content, Definitions, VariableParts
from fnnq_torchrl.agent.rules.system import FuzzySystem, fit_names, fit_words
from fnnq_torchrl.agent.rules.tokens import Token, Tokens, number
from fnnq_torchrl.equations.membership_functions import (
    ELSEWHERE,
    MEMBERSHIP_FUNCTIONS,
    T_NORMS,
)

_KINDS = {function.fis: name for name, function in MEMBERSHIP_FUNCTIONS.items()}
_T_NORMS = {t_norm.fis: name for name, t_norm in T_NORMS.items()}
_OURS = "% fnnq_torchrl "
"""The beginning of the comments that our reader reads."""


def write(system: FuzzySystem, candidates: Sequence[float] = ()) -> str:
    """Return the text of a .fis file, with every number in full precision.

    Args:
        system: the system to write. Other programs see :meth:`.Variable.span` instead of an
            infinite range.
        candidates: ignored, since the format has no place for them.

    Raises:
        RulesError: if there are gaps between the labels, where the format has no value.
    """
    system.refuse_gaps(".fis", "")
    system = fit_names(system)
    values = [value for _, value in system.rules()]
    terms = fit_words(["_".join(label.name for label in labels) for labels, _ in system.rules()])
    lines = [
        "[System]",
        "Name='fnnq_torchrl'",
        "Type='sugeno'",
        "Version=2.0",
        f"NumInputs={len(system.inputs)}",
        "NumOutputs=1",
        f"NumRules={len(values)}",
        f"AndMethod='{T_NORMS[system.t_norm].fis}'",
        "OrMethod='max'",
        "ImpMethod='prod'",
        "AggMethod='sum'",
        "DefuzzMethod='wtaver'",
        f"{_OURS}elsewhere {system.elsewhere}",
    ]
    for i, variable in enumerate(system.inputs, start=1):
        low, high = variable.span()
        lines += ["", f"[Input{i}]", f"Name='{variable.name}'", f"Range=[{low!r} {high!r}]"]
        if (low, high) != (variable.low, variable.high):
            lines.append(f"{_OURS}range {variable.low!r} {variable.high!r}")
        lines.append(f"NumMFs={len(variable.labels)}")
        for j, label in enumerate(variable.labels, start=1):
            function = label.function
            numbers = " ".join(repr(label.parameters[place]) for place in function.fis_order)
            lines.append(f"MF{j}='{label.name}':'{function.fis}',[{numbers}]")
    # Octave requires a range that isn't empty, but doesn't use it.
    low, high = min(values), max(values)
    high = high if high > low else low + 1.0
    lines += ["", "[Output1]", f"Name='{system.output}'", f"Range=[{low!r} {high!r}]"]
    lines.append(f"NumMFs={len(values)}")
    lines += [
        f"MF{j}='{term}':'constant',[{value!r}]"
        for j, (term, value) in enumerate(zip(terms, values, strict=True), start=1)
    ]
    lines += ["", "[Rules]"]
    places = {
        (i, label.name): j
        for i, variable in enumerate(system.inputs)
        for j, label in enumerate(variable.labels, start=1)
    }
    for j, (labels, _) in enumerate(system.rules(), start=1):
        premise = " ".join(str(places[i, label.name]) for i, label in enumerate(labels))
        lines.append(f"{premise}, {j} (1) : 1")
    return "".join(f"{line}\n" for line in lines)


def read(text: str, file: str) -> Content:
    """Read a system without candidates; arguments and errors as in :func:`.sentences.read`.

    An unsupported feature is an error that names it and its line.
    """
    parts, section = _Parts(), ""
    for line in _lines(text, file):
        if line.text.startswith(_OURS):
            _read_ours(parts, section, line)
        elif header := re.fullmatch(r"\[\s*([A-Za-z]+)\s*([0-9]{0,4})\s*\]", line.text):
            section = header.group(1).lower()
            if section not in _SECTIONS:
                raise line.error(choices(section, _SECTIONS))
            if section == "output" and parts.outputs:
                raise line.error("a second output is not read")
            if section in ("input", "output"):
                of = parts.inputs if section == "input" else parts.outputs
                of.append(_Part("", line.place))
        elif not section:
            raise line.error("expected [System]")
        elif section == "rules":
            parts.rules.append(Tokens(line.text, line.place))
        else:
            _read_key(parts, section, line)
    return parts.finish(Place(file, max(1, text.count("\n"))))


def _lines(text: str, file: str) -> Iterator[Token]:
    for i, line in enumerate(text.split("\n"), start=1):
        whole = "'" in line or line.startswith(_OURS)
        content = line if whole else re.split("[%#]", line, maxsplit=1)[0].rstrip()
        if content.strip():
            yield Token(content.strip(), Place(file, i, len(content) - len(content.lstrip()) + 1))


@dataclass
class _Part(VariableParts):
    """The parts of an input or of the output."""

    constants: list[float] = field(default_factory=list)


@dataclass
class _Parts:
    """The parts of the file read so far."""

    inputs: list[_Part] = field(default_factory=list)
    outputs: list[_Part] = field(default_factory=list)
    rules: list[Tokens] = field(default_factory=list)
    settings: dict[str, str] = field(default_factory=dict)
    places: dict[int | str, Place] = field(default_factory=dict)
    sugeno: bool = False

    def finish(self, end: Place) -> Content:
        """Build the system from all parts."""
        if not self.sugeno:
            raise end.error("the file ends here; expected Type='sugeno'")
        if not self.inputs or not self.outputs or not self.rules:
            raise end.error("the file ends here; expected [Input1], [Output1] and [Rules]")
        variables, [output] = [part.variable() for part in self.inputs], self.outputs
        grid = Grid(variables)
        for tokens in self.rules:
            _put_rule(tokens, grid, variables, output)
        places = self.places | {i: part.place for i, part in enumerate(self.inputs)}
        definitions = Definitions(end.file, tuple(variables), self.settings, places)
        return Content.build(definitions, output.name, grid.consequents(end), output.place)


def _put_rule(tokens: Tokens, grid: Grid, variables: Sequence[Variable], output: _Part) -> None:
    """Add a rule like ``1 2, 7 (1) : 1``: labels of the inputs and output, weight, connective."""
    labels = []
    for variable in variables:
        place = _whole(tokens.take(f"the number of a label of {variable.name}"))
        if place[0] == 0:
            raise place[1].error(f"rules without {variable.name} are not read")
        if place[0] < 0:
            raise place[1].error("rules with not are not read")
        if place[0] > len(variable.labels):
            raise place[1].error(f"{variable.name} has {len(variable.labels)} labels")
        labels.append(place[0] - 1)
    tokens.word(",")
    term, token = _whole(tokens.take(f"the number of a label of {output.name}"))
    if not 1 <= term <= len(output.constants):
        raise token.error(f"{output.name} has {len(output.constants)} labels")
    tokens.word("(")
    weight = tokens.take("a weight")
    if number(weight) != 1:
        raise weight.error("rules with a weight are not read")
    tokens.word(")")
    tokens.word(":")
    joint = tokens.take("1, for and")
    if joint.text not in ("1", "2"):
        raise joint.error("expected 1, for and")
    if joint.text == "2" and len(variables) > 1:
        raise joint.error("rules with or are not read")
    tokens.end()
    grid.put(labels, output.constants[term - 1], token.place)


def _whole(token: Token) -> tuple[int, Token]:
    """Return a token's integer, and the token."""
    if not re.fullmatch(r"-?[0-9]{1,6}(\.0{0,6})?", token.text):
        raise token.error("expected a whole number")
    return int(token.text.partition(".")[0]), token


def _read_key(parts: _Parts, section: str, line: Token) -> None:
    key, equals, value = line.text.partition("=")
    key = key.strip()
    if not equals:
        raise line.error("expected KEY=VALUE")
    column = line.place.column + len(line.text) - len(value) + len(value) - len(value.lstrip())
    of_value = Token(value.strip(), Place(line.place.file, line.place.line, column))
    if section == "system":
        return _system_key(parts, key, of_value, line)
    part = (parts.inputs if section == "input" else parts.outputs)[-1]
    if key == "Name":
        part.name = _quoted(of_value)
    elif key == "Range":
        low, high = _numbers(of_value, 2)
        part.low, part.high = low, high
    elif re.fullmatch("MF[0-9]{1,6}", key):
        _membership(part, section, of_value)
    elif key != "NumMFs":
        raise line.error(choices(key, ("Name", "Range", "NumMFs", "MF1")))
    return None


def _read_ours(parts: _Parts, section: str, line: Token) -> None:
    """Read a comment of our writer."""
    place = replace(line.place, column=line.place.column + len(_OURS))
    tokens = Tokens(line.text[len(_OURS) :], place)
    key = tokens.word("elsewhere", "range")
    if key.text == "elsewhere":
        choice = tokens.one_of(ELSEWHERE, "choice")
        parts.settings["elsewhere"], parts.places["elsewhere"] = choice.text, choice.place
    elif section != "input":
        raise key.error("expected below [Input1] or the like")
    else:
        part = parts.inputs[-1]
        part.low, part.high = tokens.number(finite=False), tokens.number(finite=False)
    tokens.end()


def _system_key(parts: _Parts, key: str, value: Token, line: Token) -> None:
    if key == "Type":
        if _quoted(value).lower() != "sugeno":
            raise value.error("systems of this type are not read; expected 'sugeno'")
        parts.sugeno = True
    elif key == "AndMethod":
        if (given := _quoted(value)) not in _T_NORMS:
            raise value.error(f"this t-norm is not read; expected {' or '.join(_T_NORMS)}")
        parts.settings["t_norm"], parts.places["t_norm"] = _T_NORMS[given], value.place
    elif key == "DefuzzMethod":
        if _quoted(value) != "wtaver":
            raise value.error("this defuzzifier is not read; expected 'wtaver'")
    elif key not in _OF_NO_MATTER:
        raise line.error(choices(key, ("Type", "AndMethod", "DefuzzMethod", *_OF_NO_MATTER)))


_OF_NO_MATTER = (
    "Name",
    "Version",
    "NumInputs",
    "NumOutputs",
    "NumRules",
    "OrMethod",
    "ImpMethod",
    "AggMethod",
)
_SECTIONS = ("system", "input", "output", "rules")


def _membership(part: _Part, section: str, value: Token) -> None:
    """Read the value of a key like MF1: ``'name':'kind',[parameters]``."""
    found = re.fullmatch(
        r"'([^']{1,200})'\s*:\s*'([^']{1,200})'\s*,\s*(\[.*\]|[^\[\]]+)", value.text
    )
    if found is None:
        raise value.error("expected 'NAME':'KIND',[NUMBERS]")
    name, kind = found.group(1), found.group(2)
    place = value.place
    numbers = Token(found.group(3), Place(place.file, place.line, place.column + found.start(3)))
    if section == "output":
        if kind != "constant":
            raise value.error("output terms of this kind are not read; expected 'constant'")
        part.constants.append(_numbers(numbers, 1)[0])
        return
    if kind not in _KINDS:
        raise value.error(f"this membership function is not read; {choices(kind, _KINDS)}")
    function = MEMBERSHIP_FUNCTIONS[_KINDS[kind]]
    given = _numbers(numbers, len(function.parameters))
    ours = [0.0] * len(given)
    for theirs, place_of_ours in zip(given, function.fis_order, strict=True):
        ours[place_of_ours] = theirs
    try:
        part.labels.append(Label(name, _KINDS[kind], tuple(ours)))
    except RulesError as error:
        raise place.error(str(error)) from None


def _quoted(value: Token) -> str:
    """Return the text between a value's quotes."""
    if not re.fullmatch(r"'[^']{1,200}'", value.text):
        raise value.error("expected a text in quotes, '...'")
    return value.text[1:-1]


def _numbers(value: Token, count: int) -> list[float]:
    """Return the numbers between a value's brackets."""
    inner = value.text.removeprefix("[").removesuffix("]")
    offset = len(value.text) - len(value.text.removeprefix("["))
    place = value.place
    tokens = Tokens(inner.replace(",", " "), Place(place.file, place.line, place.column + offset))
    numbers = tokens.numbers()
    if len(numbers) != count:
        raise value.error(f"expected {count} number{'s' if count > 1 else ''}")
    return numbers
