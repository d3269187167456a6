"""From a network to rules, to a file, and back to a network."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from fnnq_torchrl.agent.rules import RuleBase
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.launch.composition import load_config
from tests.agent.test_values import CANDIDATES, VARIANTS


@pytest.mark.parametrize("ending", ["json", "txt", "fll", "fis"])
@pytest.mark.parametrize("name", ["mixed", "nearest", "zero", "minimum_mixed", "learned"])
def test_a_networks_labels_and_t_norm_come_back_from_a_file(
    name: str, ending: str, tmp_path: Path
) -> None:
    config = load_config(*VARIANTS[name])
    network = make_value_network(config.value, CANDIDATES, 1)
    generator = torch.Generator().manual_seed(0)
    with torch.no_grad():
        for weight in network.parameters():
            weight.normal_(generator=generator)
    rules = RuleBase.from_network(network, config.value, config.env, run=0)
    path = tmp_path / f"rules.{ending}"
    rules.export(path)
    read = RuleBase.read(path)
    if ending == "fis":  # which has no words for what happens where no label fires
        read = replace(read, elsewhere=network.elsewhere)
    assert (read.t_norm, read.elsewhere) == (network.t_norm, network.elsewhere)
    bearing = torch.linspace(-1, 1, 41, dtype=torch.float64).view(1, -1, 1)
    again = RuleBase.from_system(read, rules.candidates).to_network(dtype=torch.float64)
    torch.testing.assert_close(again(bearing), network(bearing), rtol=1e-9, atol=1e-12)
