"""The FuzzyLite Language (.fll) of the C++ and Python libraries, restricted to our rule bases.

Each rule is written with its own output term, since FuzzyLite aggregates shared terms. The inputs
are locked to their ranges: C++ FuzzyLite ignores rules that fire below 1e-6, so far outside a range
there would be no output.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from fnnq_torchrl.agent.rules.errors import Place, RulesError, choices
from fnnq_torchrl.agent.rules.grid import Grid
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.parts import Content, Definitions, VariableParts
from fnnq_torchrl.agent.rules.system import FuzzySystem, fit_names, fit_words
from fnnq_torchrl.agent.rules.tokens import Token, Tokens
from fnnq_torchrl.equations.membership_functions import MEMBERSHIP_FUNCTIONS, T_NORMS

_KINDS = {function.fll: name for name, function in MEMBERSHIP_FUNCTIONS.items()}
_T_NORMS = {t_norm.fll: name for name, t_norm in T_NORMS.items()}
_HEDGES = ("any", "extremely", "not", "seldom", "somewhat", "very")


def write(system: FuzzySystem, candidates: Sequence[float] = ()) -> str:
    """Return the text of a .fll file, with every number in full precision.

    Args:
        system: the system to write.
        candidates: ignored, since the format has no place for them.
    """
    system = fit_names(system)
    if system.elsewhere == "nearest":
        system.refuse_gaps(".fll", "value.elsewhere=zero")
    lines = ["Engine: fnnq_torchrl"]
    for variable in system.inputs:
        lines += [
            f"InputVariable: {variable.name}",
            "  enabled: true",
            f"  range: {variable.low!r} {variable.high!r}",
            "  lock-range: true",
            *(
                f"  term: {label.name} {label.function.fll} {_numbers(label.parameters)}"
                for label in variable.labels
            ),
        ]
    values = [value for _, value in system.rules()]
    terms = fit_words(["_".join(label.name for label in labels) for labels, _ in system.rules()])
    lines += [
        f"OutputVariable: {system.output}",
        "  enabled: true",
        f"  range: {min(values)!r} {max(values)!r}",
        "  lock-range: false",
        "  aggregation: none",
        "  defuzzifier: WeightedAverage TakagiSugeno",
        f"  default: {'0.0' if system.elsewhere == 'zero' else 'nan'}",
        "  lock-previous: false",
        *(f"  term: {term} Constant {value!r}" for term, value in zip(terms, values, strict=True)),
        "RuleBlock: rules",
        "  enabled: true",
        f"  conjunction: {T_NORMS[system.t_norm].fll}",
        "  disjunction: none",
        "  implication: none",
        "  activation: General",
        *(
            f"  rule: if {system.premise(labels)} then {system.output} is {term}"
            for (labels, _), term in zip(system.rules(), terms, strict=True)
        ),
    ]
    return "".join(f"{line}\n" for line in lines)


def _numbers(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))


def read(text: str, file: str) -> Content:
    """Read a system without candidates; arguments and errors as in :func:`.sentences.read`.

    An unsupported feature is an error that names it and its line.
    """
    parts = _Parts()
    block: Callable[[_Parts, str, Tokens, Token], None] | None = None
    for key, tokens in _lines(text, file):
        if key.text in _BLOCKS:
            block = _BLOCKS[key.text](parts, tokens, key)
        elif block is None:
            raise key.error(choices(key.text, _BLOCKS))
        else:
            block(parts, key.text, tokens, key)
    return parts.finish(Place(file, max(1, text.count("\n"))))


def _lines(text: str, file: str) -> Iterator[tuple[Token, Tokens]]:
    """Yield each line ``key: value`` as its key and the tokens of its value."""
    for i, line in enumerate(text.split("\n"), start=1):
        content = line.partition("#")[0].rstrip()
        if not content:
            continue
        key = re.match(r"(\s*)([A-Za-z-]{1,30}):", content)
        if key is None:
            column = len(content) - len(content.lstrip()) + 1
            raise Token(content.strip(), Place(file, i, column)).error("expected KEY: VALUE")
        place = Place(file, i, key.start(2) + 1)
        value = Tokens(content[key.end() :], Place(file, i, key.end() + 1))
        yield Token(key.group(2), place), value


@dataclass
class _Part(VariableParts):
    """The parts of an input or of the output."""

    constants: dict[str, float] = field(default_factory=dict)


@dataclass
class _Parts:
    """The parts of the file read so far."""

    inputs: list[_Part] = field(default_factory=list)
    outputs: list[_Part] = field(default_factory=list)
    rules: list[Tokens] = field(default_factory=list)
    blocks: int = 0
    settings: dict[str, str] = field(default_factory=dict)
    places: dict[int | str, Place] = field(default_factory=dict)

    def finish(self, end: Place) -> Content:
        """Build the system from all parts."""
        if not self.inputs or not self.outputs or not self.rules:
            raise end.error("the file ends here; expected InputVariable, OutputVariable and rules")
        variables, [output] = [part.variable() for part in self.inputs], self.outputs
        grid = Grid(variables)
        for tokens in self.rules:
            _put_rule(tokens, grid, variables, output)
        places = self.places | {i: part.place for i, part in enumerate(self.inputs)}
        definitions = Definitions(end.file, tuple(variables), self.settings, places)
        return Content.build(definitions, output.name, grid.consequents(end), output.place)


def _put_rule(tokens: Tokens, grid: Grid, variables: Sequence[Variable], output: _Part) -> None:
    """Add a rule like ``if A is X and B is Y then Q is Z``."""
    names = [variable.name for variable in variables]
    premise: dict[str, int] = {}
    first = tokens.word("if")
    while True:
        token = tokens.take("an input")
        if token.text == "(":
            raise token.error("parentheses are not read")
        if token.text not in names:
            raise token.error(f"no such input; {choices(token.text, names)}")
        if token.text in premise:
            raise token.error("is in the premise already")
        tokens.word("is")
        variable = variables[names.index(token.text)]
        label = tokens.take("a term")
        if label.text in _HEDGES and label.text not in variable.names:
            raise label.error("hedges are not read")
        if label.text not in variable.names:
            raise label.error(
                f"no such term of {variable.name}; {choices(label.text, variable.names)}"
            )
        premise[variable.name] = variable.names.index(label.text)
        joint = tokens.take("and or then")
        if joint.text == "or":
            raise joint.error("rules with or are not read")
        if joint.text == "then":
            break
        if joint.text != "and":
            raise joint.error("expected and or then")
    for name in names:
        if name not in premise:
            raise first.error(f"{name} is missing in the premise; each rule names every input")
    tokens.one_of([output.name], "output")
    tokens.word("is")
    term = tokens.one_of(output.constants, f"term of {output.name}")
    if tokens.peek() == "with":
        weight = tokens.take("with")
        if tokens.number() != 1:
            raise weight.error("rules with a weight are not read")
    tokens.end()
    grid.put([premise[name] for name in names], output.constants[term.text], first.place)


def _term(part: _Part, tokens: Tokens) -> None:
    """Read a term of an input: name, class, parameters and an optional height, which must be 1."""
    name, kind = tokens.take("a name"), tokens.take("a class of terms")
    if kind.text not in _KINDS:
        raise kind.error(f"terms of this class are not read; {choices(kind.text, _KINDS)}")
    if name.text in [label.name for label in part.labels]:
        raise name.error(f"there is such a term of {part.name} already")
    numbers, function = tokens.numbers(), MEMBERSHIP_FUNCTIONS[_KINDS[kind.text]]
    if len(numbers) == len(function.parameters) + 1 and numbers.pop() != 1:
        raise kind.error("terms with a height are not read")
    try:
        part.labels.append(Label(name.text, _KINDS[kind.text], tuple(numbers)))
    except RulesError as error:
        raise kind.place.error(str(error)) from None


def _input_line(parts: _Parts, key: str, tokens: Tokens, place: Token) -> None:
    if key == "term":
        return _term(parts.inputs[-1], tokens)
    return _variable_line(parts.inputs[-1], key, tokens, place, _OF_INPUTS)


def _output_line(parts: _Parts, key: str, tokens: Tokens, place: Token) -> None:
    part = parts.outputs[-1]
    if key == "term":
        name, kind = tokens.take("a name"), tokens.take("a class of terms")
        if kind.text != "Constant":
            raise kind.error("output terms of this class are not read; expected Constant")
        if name.text in part.constants:
            raise name.error(f"there is such a term of {part.name} already")
        part.constants[name.text] = tokens.number()
        return tokens.end()
    if key == "default":
        default = tokens.take("a number")
        if default.text not in ("nan", "0", "0.0", "0.000"):
            raise default.error("expected nan or 0")
        parts.settings["elsewhere"] = "nearest" if default.text == "nan" else "zero"
        parts.places["elsewhere"] = default.place
        return tokens.end()
    return _variable_line(part, key, tokens, place, _OF_OUTPUTS)


def _variable_line(
    part: _Part, key: str, tokens: Tokens, place: Token, known: dict[str, tuple[str, ...] | None]
) -> None:
    """Read a line of an input or output that isn't a term."""
    if key == "range":
        part.low, part.high = tokens.number(finite=False), tokens.number(finite=False)
        return tokens.end()
    return _setting(key, tokens, place, known)


def _setting(
    key: str, tokens: Tokens, place: Token, known: dict[str, tuple[str, ...] | None]
) -> None:
    """Check a setting: ``known`` lists the values that we support, or None if any value will do."""
    if key not in known:
        raise place.error(choices(key, [*known, "term"]))
    if (allowed := known[key]) is None:
        return
    value = tokens.take(" or ".join(allowed))
    if value.text not in allowed:
        raise value.error(f"{key} {value.text[:40]!a} is not read; expected {' or '.join(allowed)}")
    if value.text == "WeightedAverage" and tokens.peek():
        tokens.word("takagisugeno", "automatic")
    tokens.end()


_OF_INPUTS: dict[str, tuple[str, ...] | None] = {
    "description": None,
    "enabled": ("true",),
    "lock-range": None,
}
_OF_OUTPUTS: dict[str, tuple[str, ...] | None] = {
    "description": None,
    "enabled": ("true",),
    "lock-range": ("false",),
    "aggregation": ("none",),
    "accumulation": ("none",),
    "defuzzifier": ("WeightedAverage",),
    "lock-previous": None,
}
_OF_RULES: dict[str, tuple[str, ...] | None] = {
    "description": None,
    "enabled": ("true",),
    "disjunction": None,  # no rule has an or
    "implication": None,  # a constant times a degree under any implication
    "activation": ("General",),
}


def _rules_line(parts: _Parts, key: str, tokens: Tokens, place: Token) -> None:
    if key == "rule":
        parts.rules.append(tokens)
    elif key == "conjunction":
        # Rules about a single input need no t-norm.
        known = [*_T_NORMS, "none"] if len(parts.inputs) == 1 else [*_T_NORMS]
        token = tokens.one_of(known, "t-norm")
        if token.text in _T_NORMS:
            parts.settings["t_norm"], parts.places["t_norm"] = _T_NORMS[token.text], token.place
    else:
        _setting(key, tokens, place, _OF_RULES)


def _engine_line(parts: _Parts, key: str, tokens: Tokens, place: Token) -> None:
    if key != "description":
        raise place.error(choices(key, _BLOCKS))


Block = Callable[[_Parts, str, Tokens, Token], None]


def _engine(parts: _Parts, tokens: Tokens, key: Token) -> Block:
    return _engine_line


def _input(parts: _Parts, tokens: Tokens, key: Token) -> Block:
    parts.inputs.append(_Part(tokens.take("a name").text, key.place))
    tokens.end()
    return _input_line


def _output(parts: _Parts, tokens: Tokens, key: Token) -> Block:
    if parts.outputs:
        raise key.error("a second output is not read")
    parts.outputs.append(_Part(tokens.take("a name").text, key.place))
    tokens.end()
    return _output_line


def _rule_block(parts: _Parts, tokens: Tokens, key: Token) -> Block:
    if parts.blocks:
        raise key.error("a second block of rules is not read")
    parts.blocks += 1
    return _rules_line


_BLOCKS: dict[str, Callable[[_Parts, Tokens, Token], Block]] = {
    "Engine": _engine,
    "InputVariable": _input,
    "OutputVariable": _output,
    "RuleBlock": _rule_block,
}
