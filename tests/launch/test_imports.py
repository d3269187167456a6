"""The garbage collector doesn't look through imported modules."""

import gc
import sys
from types import ModuleType

import pytest

from fnnq_torchrl.launch.imports import uncollected


@pytest.fixture(autouse=True)
def thawed():
    yield
    sys.modules.pop("made_here", None)
    gc.unfreeze()
    gc.enable()


@pytest.mark.parametrize("enabled", [True, False])
@pytest.mark.parametrize("fails", [True, False])
def test_the_collector_is_as_before_after_the_block(enabled: bool, fails: bool) -> None:
    if not enabled:
        gc.disable()
    try:
        with uncollected():
            assert not gc.isenabled()
            if fails:
                raise ImportError
    except ImportError:
        pass
    assert gc.isenabled() is enabled


def test_what_was_imported_is_not_looked_through() -> None:
    gc.unfreeze()
    with uncollected():
        pass
    assert gc.get_freeze_count() == 0  # nothing was imported
    with uncollected():
        sys.modules["made_here"] = ModuleType("made_here")
    assert gc.get_freeze_count() > 0
