"""The tests' quick composition is the real one."""

import pytest

from fnnq_torchrl.launch.composition import load_config
from tests.compositions import config_of


@pytest.mark.parametrize(
    "overrides",
    [
        ("lam=1", "value.inputs.bearing=[[0,1],{triangle:[0,1,2]}]", "evaluation.every=null"),
        ("task=chain", "env.length=7", "value=table"),  # the labels depend on the length
        ("value=tiles", "env.field_of_view_rad=2", "step_size=obgd"),
    ],
    ids=" ".join,
)
def test_a_configuration_is_the_one_that_hydra_composes(overrides: tuple[str, ...]) -> None:
    config_of(*overrides)  # the second is made from what the first has composed
    assert config_of(*overrides) == load_config(*overrides)
