"""The commands that install the libraries of an extra."""

import pytest

from fnnq_torchrl.config import extras


def test_the_libraries_of_an_extra_are_installed_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """The package itself is in no index, so a command can't name its extra."""
    required = [
        "torch>=2.13",
        "pillow>=11; extra == 'pictures'",
        'numpy>=2 ; extra == "pictures"',
        "wandb>=0.31; extra == 'pictures_too'",
    ]
    monkeypatch.setattr(extras, "requires", lambda name: required)
    assert extras.installing("pictures") == "pip install 'pillow>=11' 'numpy>=2'"
