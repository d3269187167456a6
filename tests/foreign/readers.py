"""Third-party programs that read our files, each as a function from a file to output values."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

HERE = Path(__file__).parent
PYTHON = HERE / ".venv" / "bin" / "python"
"""The environment that `make foreign` makes."""

PACKAGES = {
    "clang": "clang libclang-rt-14-dev",
    "fuzzylite": "fuzzylite",
    "gcc": "gcc",
    "octave-cli": "octave octave-fuzzy-logic-toolkit",
}

Numbers = NDArray[np.float64]


def needed(program: str) -> str:
    """Return the path of a program, or fail the test with the packages to install."""
    path = shutil.which(program)
    if path is None:
        pytest.fail(f"{program} is missing: apt-get install {PACKAGES[program]}", pytrace=False)
    return path


def run(*command: object) -> str:
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-2000:]
    return done.stdout


def python(script: str, file: Path, points: Numbers) -> Numbers:
    """Return y, which a script computes from ``file`` and the points x in its own environment."""
    if not PYTHON.is_file():
        pytest.fail(f"{PYTHON} is missing: make foreign makes it", pytrace=False)
    x, y = file.with_suffix(".x.npy"), file.with_suffix(".y.npy")
    np.save(x, points)
    script = f"import sys, numpy as np\nfile, x = sys.argv[1], np.load(sys.argv[2])\n{script}"
    run(PYTHON, "-W", "ignore", "-c", f"{script}\nnp.save(sys.argv[3], y)", file, x, y)
    return np.load(y)


def pyfuzzylite(file: Path, points: Numbers) -> Numbers:
    return python(
        """
import fuzzylite as fl
engine = fl.FllImporter().from_file(file)
for variable, column in zip(engine.input_variables, x.T):
    variable.value = column
engine.process()
y = engine.output_variables[0].value
""",
        file,
        points,
    )


def onnxruntime(file: Path, *inputs: Numbers) -> Numbers:
    return python(
        f"""
import onnxruntime
session = onnxruntime.InferenceSession(file)
names = [each.name for each in session.get_inputs()]
kind = np.float32 if "float)" in session.get_inputs()[0].type else np.float64
widths = {[part.shape[1] for part in inputs]}
parts = np.split(x, np.cumsum(widths)[:-1], axis=1)
(y,) = session.run(None, {{name: part.astype(kind) for name, part in zip(names, parts)}})
""",
        file,
        np.concatenate(inputs, axis=1),
    )


def cpp_fuzzylite(file: Path, points: Numbers) -> Numbers:
    """Return the values of C++ fuzzylite's command, which reads .fll and .fis."""
    data, answers = file.with_suffix(".in.fld"), file.with_suffix(".out.fld")
    np.savetxt(data, points, fmt="%.17g")
    command = [needed("fuzzylite"), "-i", file, "-if", file.suffix[1:], "-o", answers, "-of", "fld"]
    run(*command, "-d", data, "-decimals", 12, "-dheader", "false", "-dinputs", "false")
    return np.loadtxt(answers)


def octave(file: Path, points: Numbers, whole: int) -> Numbers:
    """Return the values of Octave's fuzzy logic toolkit.

    Its `evalfis` takes milliseconds for each point and rule. So it gets the first ``whole`` points
    alone. For the others, its reader and its membership functions work on all points at once, and
    the rules that it has read are added up here.
    """
    data, answers = file.with_suffix(".in.txt"), file.with_suffix(".out.txt")
    np.savetxt(data, points, fmt="%.17g")
    script = f"""
    pkg load fuzzy-logic-toolkit
    x = load('{data}'); fis = readfis('{file}');
    for j = 1:columns(fis.input)
        [sorted, ~, places] = unique(x(:, j));  # evalmf takes rising numbers only
        for k = 1:columns(fis.input(j).mf)
            mf = fis.input(j).mf(k);
            degrees{{j}}(:, k) = evalmf(sorted', mf.params, mf.type)(places);
        end
    end
    above = below = zeros(rows(x), 1);
    for rule = fis.rule
        each = cellfun(@(all, k) all(:, k), degrees, num2cell(rule.antecedent), 'UniformOutput', 0);
        each = [each{{:}}];
        if strcmp(fis.andMethod, 'min') fires = min(each, [], 2); else fires = prod(each, 2); end
        fires *= rule.weight;
        above += fires * fis.output.mf(rule.consequent).params;
        below += fires;
    end
    y = above ./ below;
    y(1:{whole}) = evalfis(x(1:{whole}, :), fis);
    file = fopen('{answers}', 'w'); fprintf(file, '%.17g\\n', y); fclose(file);
    """
    run(needed("octave-cli"), "--no-gui", "-q", "--eval", script)
    return np.loadtxt(answers)


def compiled(
    compiler: str, source: Path, function: str, points: Numbers, real: str = "double"
) -> Numbers:
    """Return the values of a C function, compiled with warnings as errors and both sanitizers.

    Args:
        function: an expression of `x`, a pointer to a point's numbers.
    """
    name = source.stem
    width = points.shape[1]
    main = source.with_name(f"{name}_main.c")
    main.write_text(
        f"""
#include <stdio.h>
#include "{name}.h"
int main(void)
{{
    double row[{width}];
    {real} x[{width}];
    for (;;) {{
        for (int i = 0; i < {width}; i++) {{
            if (scanf("%lf", &row[i]) != 1) {{
                return 0;
            }}
            x[i] = ({real})row[i];
        }}
        printf("%.17g\\n", (double){function});
    }}
}}
"""
    )
    program = source.with_name(f"{name}_{compiler}")
    flags = "-std=c99 -O2 -pedantic -Wall -Wextra -Wconversion -Wdouble-promotion -Wshadow -Werror"
    checks = "-fsanitize=address,undefined -fno-sanitize-recover=all"
    run(needed(compiler), *flags.split(), *checks.split(), source, main, "-o", program, "-lm")
    rows = "\n".join(" ".join(map(repr, row)) for row in points.tolist())
    done = subprocess.run([program], input=rows, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return np.array(json.loads(f"[{','.join(done.stdout.split())}]"))
