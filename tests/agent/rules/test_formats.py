"""Files of rules: written, read back, and refused in one line if they are malformed."""

import json
import os
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from fnnq_torchrl import RuleBase
from fnnq_torchrl.agent.rules import FuzzySystem, RulesError, Variable
from fnnq_torchrl.agent.rules.errors import choices
from fnnq_torchrl.agent.rules.formats import MOST_BYTES, READERS, WRITERS, read_system
from fnnq_torchrl.agent.rules.graphs import free_name
from fnnq_torchrl.agent.rules.sentences import read_knowledge
from tests.rule_bases import paper, systems, variables

ENDINGS = sorted(READERS)


def text_of(system: FuzzySystem, ending: str) -> str:
    candidates = getattr(system, "candidates", ())
    return WRITERS[ending].write(system, candidates, "q", False)[ending].decode()


@pytest.mark.parametrize("ending", ENDINGS)
@given(system=systems())
@settings(max_examples=10)
def test_written_read_and_written_again_it_is_the_same(ending: str, system: FuzzySystem) -> None:
    gaps = any(variable.gaps() for variable in system.inputs)
    if gaps and (ending == ".fis" or (ending == ".fll" and system.elsewhere == "nearest")):
        with pytest.raises(RulesError, match=f"^{ending} can't say what fires at x"):
            text_of(system, ending)
        return
    text = text_of(system, ending)
    again = READERS[ending](text, "file").system
    assert text_of(again, ending) == text
    assert torch.equal(again.consequents, system.consequents)
    assert again.inputs == system.inputs
    assert (again.t_norm, again.elsewhere) == (system.t_norm, system.elsewhere)


@given(variable=variables("x"))
@settings(max_examples=30)
def test_gaps_are_where_no_label_fires(variable: Variable) -> None:
    ends = [variable.low, variable.high, *(end for gap in variable.gaps() for end in gap)]
    x = torch.tensor([*ends, *torch.linspace(-11, 11, 500).tolist()], dtype=torch.float64)
    x = x[(x >= variable.low) & (x <= variable.high) & x.isfinite()]
    silent = (variable.log_degrees(x) == -inf).all(0)
    for number, no_label in zip(x.tolist(), silent.tolist(), strict=True):
        # At the end of a gap, a label with a vertical side fires.
        inside = any(low < number < high or low == number == high for low, high in variable.gaps())
        at_end = any(number in gap for gap in variable.gaps())
        assert no_label == inside or at_end


@pytest.mark.parametrize("ending", ENDINGS)
def test_by_way_of_a_file(ending: str, tmp_path: Path) -> None:
    rules = paper()
    (file,) = rules.export(tmp_path / f"q{ending}")
    again = RuleBase.read(file)
    assert torch.equal(again.consequents, rules.consequents)
    assert again.same_partition(rules.inputs)
    assert np.allclose(again.candidates, rules.candidates, atol=1e-15)
    (distilled,) = rules.export(tmp_path / f"d{ending}", controller="distilled")
    content = read_system(distilled)
    assert (content.system.output, content.candidates) == ("steer", ())
    assert torch.equal(content.system.consequents, rules.controller().distilled.consequents)


def test_numbers_of_labels_have_the_order_of_each_format() -> None:
    rules = paper()
    assert "  term: far_right Gaussian -0.5 0.4\n" in text_of(rules, ".fll")
    assert "\nMF1='far_right':'gaussmf',[0.4 -0.5]\n" in text_of(rules, ".fis")
    assert "\nlabel far_right gaussian -0.5 0.4\n" in text_of(rules, ".txt")


def test_words_that_a_format_does_not_take(tmp_path: Path) -> None:
    rules = paper()
    odd = [
        Variable(
            name,
            tuple(
                type(label)(f"{label.name}, {i % 2}", label.kind, label.parameters)
                for i, label in enumerate(variable.labels)
            ),
        )
        for name, variable in zip(["Δθ / rad", "if"], rules.inputs, strict=True)
    ]
    system = RuleBase(tuple(odd), "Q(s, a)", rules.consequents)
    for ending in (".fll", ".fis", ".txt"):
        again = RuleBase.read(system.export(tmp_path / f"q{ending}")[0])
        assert [each.name for each in again.inputs] == ["rad", "_if"]
        assert again.output == "Q_s_a"
        assert torch.equal(again.consequents, system.consequents)
    assert RuleBase.read(system.export(tmp_path / "q.json")[0]).same_partition(odd)


def test_what_is_exported_runs_in_torch(tmp_path: Path) -> None:
    rules = paper()
    states = torch.linspace(-2, 2, 50).double().unsqueeze(-1)
    (greedy,) = rules.export(tmp_path / "g.pt2", controller="full")
    module = torch.export.load(greedy).module()
    assert torch.equal(module(state=states), rules.greedy(states))
    (q,) = rules.export(tmp_path / "q.pt2")
    actions = torch.linspace(1, -1, 50).double().unsqueeze(-1)
    values = torch.export.load(q).module()(state=states, action=actions)
    torch.testing.assert_close(values, rules.evaluate(torch.cat([states, actions], -1)))


@pytest.mark.long
def test_an_actions_name_is_no_other_name_in_onnx(tmp_path: Path) -> None:
    """An ONNX graph gives a name only once, to an input or to an operation's result."""
    rules = paper()
    rules = replace(rules, inputs=(rules.inputs[0], replace(rules.inputs[1], name="state")))
    (file,) = rules.export(tmp_path / "q.onnx", controller="full")
    model = onnx.load(file)
    onnx.checker.check_model(model, full_check=True)
    assert [each.name for each in model.graph.input] == ["state"]
    assert [each.name for each in model.graph.output] == ["state_2"]
    assert free_name("Δ v / s", {"v_s", "v_s_2"}) == "v_s_3"
    assert free_name("Δ", set()) == "output"


def test_c_is_one_pair_of_files_and_names_its_functions(tmp_path: Path) -> None:
    source, header = paper().export(tmp_path / "my ctl-2.c", floats=True)
    assert (source.name, header.name) == ("my ctl-2.c", "my ctl-2.h")
    assert "float my_ctl_2_q(const float *state, float action);" in header.read_text()
    assert "float my_ctl_2_greedy(const float *state);" in header.read_text()
    assert "malloc" not in source.read_text()


@pytest.mark.parametrize(
    ("name", "how", "line"),
    [
        ("q.fl", {}, "q.fl: can't be written by its ending; did you mean .fll?"),
        ("q.fll", {"controller": "full"}, "controller=full: .fll can't choose among candidates; "),
        ("q.fis", {"controller": "best"}, "controller=best: must be full or distilled"),
        ("q.json", {"floats": True}, "export_float=true: is for .c, .onnx, .pt2; .json has "),
    ],
)
def test_what_cannot_be_exported(name: str, how: dict, line: str, tmp_path: Path) -> None:
    with pytest.raises(RulesError) as refused:
        paper().export(tmp_path / name, **how)
    assert str(refused.value).removeprefix(f"{tmp_path}{os.sep}").startswith(line)
    assert not [*tmp_path.iterdir()]


TEXTS = {ending: text_of(paper(), ending) for ending in ENDINGS}
RULE = "if bearing is far_right and steer is hard_left then value is "


@pytest.mark.parametrize(
    ("ending", "old", "new", "said"),
    [
        (".fll", "AlgebraicProduct", "EinsteinProduct", "49:16: 'EinsteinProduct': no such t-norm"),
        (".fll", "Gaussian -0.5 0.4", "Spike -0.5 0.4", "6:19: 'Spike': terms of this class"),
        (".fll", "Gaussian -0.5 0.4", "Gaussian -0.5 0", "6:19: label 'far_right': gaussian"),
        (".fll", "Gaussian -0.5 0.4", "Gaussian -0.5 x", "6:33: 'x': expected a number"),
        (".fll", "is far_right and", "is very far_right and", ": 'very': hedges are not read"),
        (".fll", "far_right and steer", "far_right or steer", ": 'or': rules with or are not read"),
        (".fll", "TakagiSugeno", "Tsukamoto", ": 'Tsukamoto': expected takagisugeno or automatic"),
        (".fll", "WeightedAverage", "Centroid", ": 'Centroid': defuzzifier 'Centroid' is not read"),
        (".fll", "Constant", "Linear 0.5", ": 'Linear': output terms of this class are not read"),
        (".fll", "  rule: ", "  # rule: ", "there is no rule for bearing is far_right and"),
        (".fll", "RuleBlock: rules", "OutputVariable: two", ": 'OutputVariable': a second output"),
        (".fis", "'sugeno'", "'mamdani'", "3:6: \"'mamdani'\": systems of this type are not read"),
        (".fis", "1 1, 1 (1) : 1", "1 1, 1 (1) : 2", ": '2': rules with or are not read"),
        (".fis", "1 1, 1 (1) : 1", "-1 1, 1 (1) : 1", ": '-1': rules with not are not read"),
        (".fis", "1 1, 1 (1) : 1", "1 1, 1 (0.5) : 1", ": '0.5': rules with a weight are not read"),
        (".fis", "1 1, 1 (1) : 1", "0 1, 1 (1) : 1", ": '0': rules without bearing are not read"),
        (".fis", "'gaussmf'", "'pimf'", "this membership function is not read"),
        (".fis", "'constant'", "'linear'", "output terms of this kind are not read"),
        (".txt", "far_right and", "far_rigt and", "17:15: 'far_rigt': no such label of bearing;"),
        (".txt", RULE, f"{RULE}1\n{RULE}", "contradicts an earlier one, of line 17"),
        (".txt", RULE, f"{RULE}nan #", "17:62: 'nan': expected a number, a finite one"),
        (".txt", "t_norm product", "t_norm prodct", "'prodct': no such t-norm; did you mean"),
        (".txt", "action steer", "input steer", None),
        (".txt", "label hard_left", "lable hard_left", ": 'lable': did you mean label?"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_named_with_its_place(
    ending: str, old: str, new: str, said: str | None
) -> None:
    text = TEXTS[ending]
    assert old in text
    changed = text.replace(old, new, 1)
    if said is None:
        READERS[ending](changed, "f")
        return
    with pytest.raises(RulesError) as refused:
        READERS[ending](changed, "f")
    message = str(refused.value)
    assert message.startswith("f:")
    assert "\n" not in message
    assert said in message


def damaged(draw: st.DrawFn, text: str) -> str:
    """Return the text cut, with a piece replaced, or with a piece repeated."""
    start, end = sorted(draw(st.tuples(*[st.integers(0, len(text))] * 2)))
    middle = draw(
        st.one_of(
            st.just(""),
            st.text(max_size=20),
            st.just(text[start:end] * 2),
            st.sampled_from(["1e999", "-", "[" * 3000, "9" * 5000, "null", "{}", "\0", "term:"]),
        )
    )
    tail = "" if draw(st.booleans()) else text[end:]
    return text[:start] + middle + tail


@pytest.mark.parametrize("ending", ENDINGS)
@given(data=st.data())
@settings(max_examples=25)
def test_damaged_files_are_told_in_one_line(ending: str, data: st.DataObject) -> None:
    text = data.draw(st.composite(damaged)(TEXTS[ending]))
    message = refusal(ending, text)
    assert message is None or (message.startswith("file:") and message.isprintable())
    assert message is None or len(message) < 400


def refusal(ending: str, text: str) -> str | None:
    """Return the message of a reader that refuses the text, or None if it reads it."""
    try:
        READERS[ending](text, "file")
    except RulesError as error:
        return str(error)
    return None


def test_json_of_other_shapes() -> None:
    good = json.loads(text_of(paper(), ".json"))
    for change, said in [
        ({"consequents": [[1] * 4] * 4}, "consequents: list; expected 5 entries"),
        ({"inputs": {}}, "inputs: dict; expected a list"),
        ({"output": 3}, "output: '3'; expected a text"),
        ({"candidates": [1, 0]}, "candidates: expected rising numbers"),
        ({"candidates": True}, "candidates: 'True'; expected a list"),
        ({"t_norm": "sum"}, "t_norm: 'sum': expected product or minimum"),
        ({"format": "2"}, "format: '2'; expected 'rules of fnnq_torchrl, 1'"),
    ]:
        [key] = change
        text = json.dumps(good | change, indent=1)
        line = next(i for i, row in enumerate(text.splitlines(), 1) if row.startswith(f' "{key}"'))
        with pytest.raises(RulesError) as refused:
            READERS[".json"](text, "file")
        assert str(refused.value).startswith(f"file:{line}:{len(key) + 6}: {said}")
    text = json.dumps(good | {"candidates": [0, True]})
    with pytest.raises(RulesError) as refused:
        READERS[".json"](text, "file")
    column = text.index("true") + 1
    said = f"file:1:{column}: candidates[1]: 'True'; expected a finite number"
    assert str(refused.value) == said
    good["inputs"][0]["labels"][1]["parameters"][1] = -1
    with pytest.raises(RulesError, match=r"^file:\d+:5: inputs\[0\]\.labels\[1\]: label 'right'"):
        READERS[".json"](json.dumps(good, indent=1), "file")


def test_too_large_or_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_bytes(b"if a\n  \xff")
    with pytest.raises(RulesError, match=r"a\.txt:2:3: is no text in UTF-8$"):
        read_system(tmp_path / "a.txt")
    (tmp_path / "b.fll").write_bytes(b"#" * (MOST_BYTES + 1))
    with pytest.raises(RulesError, match="is larger than 4 MiB"):
        read_system(tmp_path / "b.fll")
    many = "".join(
        f"input x{i}\n" + "".join(f"label l{j} gaussian {j} 1\n" for j in range(100))
        for i in range(9)
    )
    with pytest.raises(RulesError, match="at most 65,536"):
        READERS[".txt"](f"{many}if x0 is l0 then y is 1\n", "f")


def test_a_line_of_blanks_is_read_in_no_time() -> None:
    """A regular expression for the blanks before a comment would take hours."""
    with pytest.raises(RulesError):
        READERS[".fis"]("[System]\n" + " " * 10**6 + "x\n", "f")


def test_an_actions_name_does_not_end_the_comment_in_c(tmp_path: Path) -> None:
    rules = paper()
    *states, action = rules.inputs
    rules = replace(rules, inputs=(*states, replace(action, name="*/ int x; /*")))
    _, header = rules.export(tmp_path / "c.c", controller="distilled")
    assert "*/ int" not in header.read_text()


def test_names_that_are_no_print_are_shown_as_escapes() -> None:
    assert choices("value", ["\x1bvalue"]) == r"did you mean '\x1bvalue'?"


def test_knowledge() -> None:
    text = """# as people write it
    if bearing is far_left and steer is hard_left then value is 0.5
    IF bearing IS far_right THEN steer hard_right
    if bearing is ahead then steer is left  # with an is
    """
    known = read_knowledge(text, "f", paper().inputs)
    assert known.values == {(4, 0): 0.5}
    assert known.actions == {(0,): 1.0, (2,): -0.4}
    whole = read_knowledge(TEXTS[".txt"], "f", paper().inputs)
    assert len(whole.values) == 20


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("if bearing is left then steer up", "f:1:31: 'up': no such label of steer; expected hard"),
        ("if bearing is left then stear left", "f:1:25: 'stear': expected steer, or a label of it"),
        ("if bearing left", "f:1:12: 'left': expected is"),
        ("if bearing is left", "f:1:19: the line ends here; expected and or then"),
        ("if steer is left then value is 1", "f:1:1: 'if': bearing is missing in the premise"),
        (
            "if bearing is left then steer left\nif bearing is left then steer right",
            "f:2:25: the rule for bearing is left contradicts an earlier one, of line 1",
        ),
        (
            "if bearing is left then steer left\nif bearing is left then steer left",
            "f:2:25: the rule for bearing is left is there twice, of line 1",
        ),
        (
            "input bearing\nlabel left gaussian 0 1\naction steer\nlabel a gaussian 0 1\n",
            "f:1:1: another partition: its labels of bearing are left, the network's are far_right",
        ),
    ],
)
def test_knowledge_with_mistakes(text: str, said: str) -> None:
    with pytest.raises(RulesError) as refused:
        read_knowledge(text, "f", paper().inputs)
    assert str(refused.value).startswith(said)
