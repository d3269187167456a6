"""The values that ranges allow and refuse, and the messages of refusals."""

import copy
from dataclasses import dataclass, fields, replace
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from envs.core.parameters import (
    OutOfRange,
    Parameters,
    Range,
    allowed,
    check,
    matching,
    number,
    one_of,
    pairs,
    whole,
)


@dataclass
class Wheel(Parameters):
    radius_m: float = number(above=0)


@dataclass
class Robot(Parameters):
    slow: float = number(0, 1)
    fast: float = number(0, 1)
    labels: dict[str, list] = pairs("centre", "width", above=0)
    wheel: Wheel

    def contradictions(self):
        if self.slow > self.fast:
            yield OutOfRange("slow", self.slow, f"at most fast={self.fast}")


ROBOT = Robot(0.1, 0.2, {"a": [[0, 1]], "b": [[-1.5, 0.5], [1, 2]]}, Wheel(0.3))


def range_of(declared) -> Range:
    return declared.metadata["range"]


@pytest.mark.parametrize(
    ("declared", "good", "bad", "words"),
    [
        (number(), [0, -2.5, 10**400], [inf, -inf, nan, True, "1", None], "in (-inf, inf)"),
        (number(0), [0, 0.0, 3], [-1e-9, inf, nan], "in [0, inf)"),
        (number(0, 1), [0, 0.5, 1], [-0.1, 1.1, nan], "in [0, 1]"),
        (number(above=0), [1e-9, 3], [0, -1, inf, nan], "in (0, inf)"),
        (number(above=0, high=1), [1e-9, 1], [0, 1.1, nan], "in (0, 1]"),
        (whole(1), [1, 2**70], [0, 1.0, True, "1", inf, nan], "whole number >= 1"),
        (one_of("output", "gradient"), ["output"], ["out", "", None], "output or gradient"),
        (one_of("a", "b", "c"), ["c"], ["d"], "a, b or c"),
        (matching(r"cuda(:\d+)?", "cuda or cuda:N"), ["cuda:12"], ["cuda:", "xcuda", 3], "cuda:N"),
        (
            pairs("centre", "width", above=0),
            [[[0, 1]], [[-1, 0.4], [1.0, 2]]],
            [[], [[0, 0]], [[0]], [[0, 1, 2]], [[0, nan]], [["0", 1]], [0, 1], 3, None],
            "a list of at least one pair [centre, width] with width > 0",
        ),
        (pairs("angle", "speed"), [[[0, -1]]], [[], [[0, inf]]], "pair [angle, speed]"),
    ],
)
def test_a_range_holds_what_its_words_say(declared, good, bad, words):
    assert [value for value in good if not range_of(declared).holds(value)] == []
    assert [value for value in bad if range_of(declared).holds(value)] == []
    assert range_of(declared).words.endswith(words)


@given(st.floats(), st.floats(-10, 10), st.floats(-10, 10))
def test_an_interval_holds_exactly_its_numbers(value, one, other):
    low, high = sorted((one, other))
    assert range_of(number(low, high)).holds(value) == (low <= value <= high)
    assert range_of(number(above=low, high=high)).holds(value) == (low < value <= high)


def test_a_range_is_no_default():
    with pytest.raises(TypeError, match="radius_m"):
        Wheel()


def test_good_values_pass():
    check(ROBOT)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"slow": -1}, "slow=-1: must be a number in [0, 1]"),
        ({"wheel": Wheel(0)}, "wheel.radius_m=0: must be a number in (0, inf)"),
        (
            {"labels": {"a": [[0, 1]], "b": []}},
            "labels.b=[]: must be a list of at least one pair [centre, width] with width > 0",
        ),
        ({"slow": 0.3}, "slow=0.3: must be at most fast=0.2"),
    ],
)
def test_a_refusal_names_key_value_and_what_is_allowed(changes, line):
    with pytest.raises(OutOfRange) as refused:
        check(replace(ROBOT, **changes))
    assert str(refused.value) == line


def test_prefix_stands_before_every_key():
    with pytest.raises(OutOfRange, match=r"^env\.wheel\.radius_m="):
        check(replace(ROBOT, wheel=Wheel(nan)), "env.")
    with pytest.raises(OutOfRange, match=r"^env\.slow=0\.3"):
        check(replace(ROBOT, slow=0.3), "env.")


def test_allowed_says_every_range():
    words = allowed(Robot)
    assert list(words) == ["slow", "fast", "labels", "wheel.radius_m"]
    assert words["wheel.radius_m"] == range_of(fields(Wheel)[0]).words


def test_a_refusal_can_be_pickled_for_another_process():
    refused = copy.copy(OutOfRange("lam", 1.5, "a number in [0, 1]"))  # as pickle copies
    assert str(refused) == "lam=1.5: must be a number in [0, 1]"
