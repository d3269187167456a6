"""Files of rules as the start values of learning."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from fnnq_torchrl.agent.rules import Label, RuleBase, RulesError, Variable, sentences
from fnnq_torchrl.agent.rules.formats import READERS
from fnnq_torchrl.agent.rules.prior import preferences, read_prior
from tests.rule_bases import paper

VARIABLES = paper().inputs
ROUGH = """
if bearing is far_right then steer hard_right
if bearing is left then steer left   # a label's middle is −0.4
if bearing is ahead then steer 0.1
"""


def written(directory: Path, text: str) -> Path:
    path = directory / "prior.txt"
    path.write_text(text)
    return path


def read(directory: Path, text: str) -> torch.Tensor:
    return read_prior(written(directory, text), VARIABLES, margin=0.5)


def test_what_to_do_becomes_values_that_fall_with_the_distance(tmp_path: Path) -> None:
    values = read(tmp_path, ROUGH)
    # 0.5 · (1 − ((a − a*)/2)²) for the middles −1, −0.4, 0.4, 1
    for row, action in ((0, 1.0), (3, -0.4), (2, 0.1)):
        expected = [0.5 * (1 - ((a - action) / 2) ** 2) for a in (-1, -0.4, 0.4, 1)]
        assert values[row].tolist() == pytest.approx(expected)
    assert values[[1, 4]].abs().max() == 0  # no rule of the file names these states


def test_values_count_where_both_are_given_and_all_else_is_0(tmp_path: Path) -> None:
    sentence = "if steer is right and bearing is far_right then value is -7.5\n"
    values = read(tmp_path, sentence + ROUGH)
    assert values[0, 2] == -7.5
    assert values[0, 3] == 0.5
    alone = read(tmp_path, sentence)
    assert alone[0, 2] == -7.5
    assert alone.count_nonzero() == 1


def test_the_best_action_of_told_states_is_their_weighted_mean() -> None:
    # With labels that a parabola is exact between, as narrow as the candidates are apart.
    action = Variable(
        "steer",
        tuple(Label(f"a{i}", "gaussian", (-1 + i / 50, 0.002)) for i in range(101)),
        *(-1.0, 1.0),
    )
    bearing = VARIABLES[0]
    told = {(0,): 0.9, (1,): -0.5, (2,): 0.1, (3,): 0.4, (4,): -1.0}
    rules = RuleBase(
        (bearing, action), "value", preferences((bearing, action), told, 0.5),
        candidates=tuple(-1 + i / 50 for i in range(101)),
    )  # fmt: skip
    states = torch.linspace(-0.8, 0.8, 33, dtype=torch.float64).unsqueeze(-1)
    shares = rules.firing(torch.cat([states, torch.zeros_like(states)], -1)).sum(-1)
    mean = shares @ torch.tensor([*told.values()], dtype=torch.float64)
    assert (rules.greedy(states) - mean).abs().max() <= 0.0101


@pytest.mark.parametrize("ending", [".txt", ".json", ".fll", ".fis"])
def test_a_whole_rule_base_of_any_format(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"q{ending}"
    paper().export(path)
    assert torch.equal(read_prior(path, VARIABLES, 0.5), paper().consequents)
    path = tmp_path / f"controller{ending}"
    paper().export(path, controller="distilled")
    numbers = paper().controller().distilled.consequents
    told = {(i,): float(number) for i, number in enumerate(numbers)}
    assert torch.equal(read_prior(path, VARIABLES, 0.5), preferences(VARIABLES, told, 0.5))


DEFINED = [
    line for line in sentences.write(paper()).splitlines() if not line.startswith(("if", "t_norm"))
]
"""The definitions of the network's own words."""


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("if bearing is far_lft then steer left", "1:15", "did you mean far_left?"),
        ("if bearing is left", "1:19", "the line ends here; expected and or then"),
        ("\nif bearing is left then stear left", "2:25", "expected steer"),
        ("if bearing is left then steer lef", "1:31", "did you mean left?"),
        ("if bearing is left then steer left\nif bearing is left then steer right", "2:1",
         "contradicts an earlier one, of line 1"),
        ("if bearing is left then steer left\nif bearing is left then steer left", "2:1",
         "is there twice, of line 1"),
        ("if bearing is left and steer is left then value is much", "1:52", "expected a number"),
        ("\n".join([*DEFINED, "t_norm minimum"]), "15:1", "its t_norm is minimum"),
        ("input bearing from -1 to 1\nlabel left gaussian 0 1", "1:1", "another partition"),
    ],
)  # fmt: skip
def test_mistakes_are_told_with_their_place(
    tmp_path: Path, text: str, place: str, words: str
) -> None:
    with pytest.raises(RulesError) as refused:
        read(tmp_path, text)
    line, column = place.split(":")
    assert f"prior.txt:{line}:" in str(refused.value)
    assert words in str(refused.value)
    if words.startswith(("did", "expected", "the line")):
        assert f"prior.txt:{line}:{column}: " in str(refused.value)


def other(change: Callable[[Variable], Variable]) -> RuleBase:
    bearing, steer = VARIABLES
    return RuleBase((change(bearing), steer), "value", paper().consequents)


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        (
            other(lambda each: Variable("angle", each.labels, each.low, each.high)),
            "its inputs are angle, steer, the network's are bearing, steer",
        ),
        (
            other(lambda each: Variable(each.name, each.labels[::-1])),
            "value.names.bearing=[far_left,left,ahead,right,far_right] renames",
        ),
        (
            other(
                lambda each: Variable(
                    each.name, (Label("far_right", "gaussian", (-0.6, 0.4)), *each.labels[1:])
                )
            ),
            "bearing far_right is gaussian -0.6 0.4; expected gaussian -0.5 0.4; without value",
        ),
        (
            RuleBase(VARIABLES, "value", paper().consequents, t_norm="minimum"),
            "its t_norm is minimum, the network's is product",
        ),
    ],
)
def test_another_partition_is_refused_with_a_way_out(
    tmp_path: Path, rules: RuleBase, words: str
) -> None:
    for ending in sorted(READERS):
        path = tmp_path / f"other{ending}"
        rules.export(path)
        with pytest.raises(RulesError) as refused:
            read_prior(path, VARIABLES, 0.5)
        assert re.match(rf"{re.escape(str(path))}:\d+:\d+: ", str(refused.value))
        assert words in str(refused.value)
