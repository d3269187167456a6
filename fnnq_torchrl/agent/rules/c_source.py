"""Export rules as C99 for microcontrollers; it needs only ``math.h`` and allocates no memory.

For Q, ``ctl.c`` defines ``double ctl_q(const double *state, double action)`` and ``double
ctl_greedy(const double *state)``. For any other system, it defines ``double ctl_output(const double
*state)``.
"""

import re
from collections.abc import Callable, Sequence
from string import Template

from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.partition import Variable
from fnnq_torchrl.agent.rules.system import FuzzySystem, fit_words

_LARGEST_FLOAT = 3.4e38
_PER_LINE = 4

# The logarithms of the membership functions, as in equations/membership_functions.py.
_FUNCTIONS = {
    "gaussian": """\
static $real gaussian($real x, $real centre, $real width)
{
    const $real u = (x - centre) / width;
    return -$half * u * u;
}
""",
    "triangle": """\
static $real triangle($real x, $real a, $real b, $real c)
{
    return log$f(lower(rise(x, a, b), rise(-x, -c, -b)));
}
""",
    "trapezoid": """\
static $real trapezoid($real x, $real a, $real b, $real c, $real d)
{
    return log$f(lower(rise(x, a, b), rise(-x, -d, -c)));
}
""",
    "bell": """\
static $real bell($real x, $real centre, $real width, $real slope)
{
    const $real u = fabs$f((x - centre) / width);
    if (u <= $one) {
        return -log1p$f(pow$f(u, $two * slope));
    }
    const $real power = $two * slope * log$f(u);
    return -(power + log1p$f(exp$f(-power)));
}
""",
    "sigmoid": """\
static $real sigmoid($real x, $real inflection, $real slope)
{
    const $real z = slope * (x - inflection);
    return lower(z, $zero) - log1p$f(exp$f(-fabs$f(z)));
}
""",
    "gaussian_two_sided": """\
static $real gaussian_two_sided($real x, $real left, $real left_width, $real right,
                                $real right_width)
{
    const $real u = lower(x - left, $zero) / left_width;
    const $real v = lower(right - x, $zero) / right_width;
    return -$half * (u * u + v * v);
}
""",
}

_LOWER = """\
static $real lower($real a, $real b)
{
    return a < b ? a : b;
}
"""

_RISE = """\
/* From 0 at start to 1 at end; a jump where they are the same. */
static $real rise($real x, $real start, $real end)
{
    if (!(start < end)) {
        return x >= start ? $one : $zero;
    }
    const $real share = (x - start) / (end - start);
    return share < $zero ? $zero : lower(share, $one);
}
"""

_NEAREST = """\
/* Where no label fires, the nearest does. */
static void nearest($real x, const $real supports[][2], $real *degrees, int count)
{
    int best = 0;
    $real least = $huge;
    for (int i = 0; i < count; i++) {
        const $real below = supports[i][0] - x, above = x - supports[i][1];
        const $real distance = below > above ? below : above;
        if (distance < least) {
            least = distance;
            best = i;
        }
    }
    degrees[best] = $zero; /* the logarithm of one */
}
"""

_HIGHEST = """\
static $real highest(const $real *numbers, int count)
{
    $real most = numbers[0];
    for (int i = 1; i < count; i++) {
        most = numbers[i] > most ? numbers[i] : most;
    }
    return most;
}
"""

_VALUE = """\
/* The average of the consequents, weighted by how strongly their rules fire. */
static $real output(const $real *inputs)
{
    $real degrees[$labels];
    $real peaks[$inputs];
$calls
    for (int i = 0; i < $inputs; i++) {
        peaks[i] = highest(degrees + starts[i], counts[i]);
    }
$common    /* Relative to the highest ones, so that far from every label something is left. */
    for (int i = 0; i < $inputs; i++) {
        const $real peak = $peak;
        for (int j = starts[i]; j < starts[i] + counts[i]; j++) {
            degrees[j] = exp$f(degrees[j] - (peak > -$huge ? peak : $zero));
        }
    }
    $real total = $zero, sum = $zero;
    for (int rule = 0; rule < $rules; rule++) {
        int rest = rule;
        $real strength = $neutral;
        for (int i = $inputs - 1; i >= 0; i--) {
            const $real degree = degrees[starts[i] + rest % counts[i]];
            rest /= counts[i];
            strength = $combine;
        }
        total += strength;
        sum += strength * consequents[rule];
    }
    return total > $zero ? sum / total : $zero;
}
"""

_Q = """\

$real ${name}_q(const $real *state, $real action)
{
    $real inputs[$inputs];
    for (int i = 0; i < $states; i++) {
        inputs[i] = state[i];
    }
    inputs[$states] = action;
    return output(inputs);
}

$real ${name}_greedy(const $real *state)
{
    $real best = candidates[0], highest_q = ${name}_q(state, best);
    for (int i = 1; i < $candidates; i++) {
        const $real q = ${name}_q(state, candidates[i]);
        if (q > highest_q) {
            highest_q = q;
            best = candidates[i];
        }
    }
    return best;
}
"""

_OUTPUT = """\

$real ${name}_output(const $real *state)
{
    return output(state);
}
"""

_Q_HEADER = """\
/* Q of an action in a state. */
$real ${name}_q(const $real *state, $real action);

/* The best of $candidates actions in a state, the lowest of several. */
$real ${name}_greedy(const $real *state);
"""

_OUTPUT_HEADER = """\
/* The output in a state: $output. */
$real ${name}_output(const $real *state);
"""


def write(
    system: FuzzySystem, candidates: Sequence[float], stem: str, floats: bool
) -> dict[str, bytes]:
    """Return the C source and the header of a system.

    Args:
        system: Q, with the action as its last input, or any other system.
        candidates: for Q, the candidate actions of the greedy choice; else empty.
        stem: the files' name without its ending; it is also the prefix of the functions' names.
        floats: whether to compute in ``float`` instead of ``double``.

    Returns:
        The contents of the files by their endings, ``.c`` and ``.h``.

    Raises:
        RulesError: if a number is too large for a float.
    """
    name = re.sub(r"\W", "_", stem, flags=re.ASCII)
    name = name if re.match("[A-Za-z]", name) else f"rules{name}"
    counts = [len(variable.labels) for variable in system.inputs]
    starts = [sum(counts[:i]) for i in range(len(counts))]
    minimum = system.t_norm == "minimum"

    def literal(value: float) -> str:
        if floats and abs(value) > _LARGEST_FLOAT:
            raise RulesError(f"export_float=true: {value!r} is beyond what a float holds")
        return f"{value!r}f" if floats else repr(value)

    huge = "HUGE_VALF" if floats else "HUGE_VAL"
    words: dict[str, str] = {
        "huge": huge,
        "real": "float" if floats else "double",
        "f": "f" if floats else "",
        "zero": literal(0.0),
        "half": literal(0.5),
        "one": literal(1.0),
        "two": literal(2.0),
        "name": name,
        "output": fit_words([system.output])[0],
        "inputs": str(len(counts)),
        "states": str(len(counts) - 1),
        "labels": str(sum(counts)),
        "rules": str(system.consequents.numel()),
        "candidates": str(len(candidates)),
        "calls": "".join(
            f"    degrees_of_{i}(inputs[{i}], degrees + {start});\n"
            for i, start in enumerate(starts)
        ),
        "common": "",
        "peak": "common" if minimum else "peaks[i]",
        "neutral": huge if minimum else literal(1.0),
        "combine": "lower(strength, degree)" if minimum else "strength * degree",
    }

    if minimum:
        words["common"] = Template(_COMMON).substitute(words)

    def numbers(kind: str, label: str, values: Sequence[object]) -> str:
        lines = [
            ", ".join(map(str, values[i : i + _PER_LINE])) for i in range(0, len(values), _PER_LINE)
        ]
        body = ",\n    ".join(lines)
        return f"static const {kind} {label}[{len(values)}] = {{\n    {body},\n}};\n"

    constants = numbers("int", "counts", counts) + numbers("int", "starts", starts)
    values = [literal(value) for value in system.consequents.flatten().tolist()]
    constants += numbers(words["real"], "consequents", values)
    if candidates:
        constants += numbers(words["real"], "candidates", [*map(literal, candidates)])
    kinds = {label.kind for variable in system.inputs for label in variable.labels}
    silent = system.elsewhere == "nearest" and any(map(_may_be_silent, system.inputs))
    parts = [_LOWER] if minimum or kinds & _NEED_LOWER else []
    parts += [_RISE] if kinds & _NEED_RISE else []
    parts += [text for kind, text in _FUNCTIONS.items() if kind in kinds]
    parts += [_HIGHEST, *([_NEAREST] if silent else [])]
    degrees = [
        _degrees(i, variable, literal, system.elsewhere) for i, variable in enumerate(system.inputs)
    ]
    code = "\n".join([constants, *parts, *degrees, _VALUE]) + (_Q if candidates else _OUTPUT)
    about = "".join(f" *   {_words(variable)}\n" for variable in system.inputs)
    source = f'#include "{stem}.h"\n\n#include <math.h>\n\n{Template(code).substitute(words)}'
    guard = f"{name.upper()}_H"
    declarations = _Q_HEADER if candidates else _OUTPUT_HEADER
    header = (
        f"/* Written by fnnq_torchrl. A state has a number for each input, in this order,\n"
        f" * whatever their range:\n{about} */\n#ifndef {guard}\n#define {guard}\n\n"
        f"{Template(declarations).substitute(words)}\n#endif\n"
    )
    return {".c": source.encode(), ".h": header.encode()}


_COMMON = """\
    $real common = peaks[0]; /* of the strongest rule */
    for (int i = 1; i < $inputs; i++) {
        common = lower(common, peaks[i]);
    }
"""
_NEED_RISE = {"triangle", "trapezoid"}
_NEED_LOWER = {*_NEED_RISE, "sigmoid", "gaussian_two_sided"}


def _words(variable: Variable) -> str:
    """Return a variable's name and range for a comment."""
    name = variable.name.encode("ascii", "replace").decode().replace("*/", "")
    return f"{name}, from {variable.low!r} to {variable.high!r}"


def _may_be_silent(variable: Variable) -> bool:
    """Return whether some numbers may be outside of all labels."""
    return all(label.function.compact for label in variable.labels)


def _degrees(i: int, variable: Variable, literal: Callable[[float], str], elsewhere: str) -> str:
    """Return the C function that computes the log degree of each label of an input."""
    lines = [
        f"    degrees[{j}] = {label.kind}(x, {', '.join(map(literal, label.parameters))});"
        for j, label in enumerate(variable.labels)
    ]
    count = len(variable.labels)
    if elsewhere == "nearest" and _may_be_silent(variable):
        supports = [label.function.support(label.parameters) for label in variable.labels]
        rows = ", ".join(f"{{{literal(low)}, {literal(high)}}}" for low, high in supports)
        lines = [
            f"    static const $real supports[{count}][2] = {{{rows}}};",
            *lines,
            f"    if (!(highest(degrees, {count}) > -$huge)) {{",
            f"        nearest(x, supports, degrees, {count});",
            "    }",
        ]
    head = f"static void degrees_of_{i}($real x, $real *degrees)"
    return f"{head}\n{{\n{chr(10).join(lines)}\n}}\n"
