"""YAML files from elsewhere are plain data, as large as the file."""

import pytest

from fnnq_torchrl.files.settings import parse_settings

BOMB = "a0: &a0 [x, x]\n" + "".join(f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]\n" for i in range(1, 64))


def test_settings_are_read() -> None:
    assert parse_settings(b"lam: 0.2\nenv: {kind: follow_ball}\n") == {
        "lam": 0.2,
        "env": {"kind": "follow_ball"},
    }


@pytest.mark.parametrize(
    "text",
    [
        BOMB.encode(),
        b"[" * 100_000,
        b"a: !!python/object/apply:os.system [echo]",
        b"a: \xff",
        b"- a list",
        b"",
    ],
    ids=["2⁶⁴ entries", "deep", "code", "not UTF-8", "no mapping", "empty"],
)
def test_all_else_is_refused(text: bytes) -> None:
    assert parse_settings(text) is None
