"""Where learning starts: what is known before it, as consequents (``conf/rules/``)."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.imitation import imitate, read_demonstrations
from fnnq_torchrl.agent.rules import RulesError, partition
from fnnq_torchrl.agent.rules.prior import from_system, read_prior
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.choices import config_directory
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.policies import load_rules

_SHIPPED = "rules"
"""The folder of conf/ that has files of rules and of demonstrations."""


@dataclass(frozen=True, eq=False)
class Start:
    """What the runs of a job start from, all of them the same.

    Attributes:
        consequents: float64 ``[labels of input 1, …, action labels]``.
        learns: 1 for each rule that learns, 0 for each that stays as it is, as the consequents;
            none if all learn.
        digest: tells the contents of the files that were read from others.
        told: a line for the user on what came of imitation; empty without any.
    """

    consequents: Tensor
    learns: Tensor | None
    digest: str
    told: str

    @property
    def masks(self) -> dict[str, Tensor]:
        """``learns`` by the name of the network's parameter; empty if all learn."""
        return {} if self.learns is None else {"weight": self.learns}

    def put_into(self, network: ValueNetwork) -> None:
        """Have the network's runs start from here."""
        with torch.no_grad():
            weight = network.get_parameter("weight")
            weight.copy_(self.consequents.expand_as(weight))


def read_start(config: Config) -> Start | None:
    """Read what is known before learning; none if that is nothing.

    Raises:
        ConfigError: a file isn't there, has a mistake, or is about other rules. One line.
        OSError: a file can't be read.
    """
    rules = config.rules
    if rules is None or (rules.prior is None and rules.demonstrations is None and not rules.frozen):
        return None
    variables, t_norm = partition(config.value, config.env), config.value.t_norm
    contents = []
    consequents = torch.zeros([len(each.labels) for each in variables], dtype=torch.float64)
    if rules.prior is not None:
        path = _find("rules.prior", rules.prior)
        if path.is_dir():
            contents.append(_bytes_of_job(path))
            consequents = from_system(load_rules(path), variables, rules.margin, str(path), t_norm)
        else:
            contents.append(path.read_bytes())
            consequents = read_prior(path, variables, rules.margin, t_norm)
    learns = _learns(config, consequents)
    told = ""
    if rules.demonstrations is not None:
        path = _find("rules.demonstrations", rules.demonstrations)
        contents.append(path.read_bytes())
        demonstrations = read_demonstrations(path, variables)
        candidates = make_candidates(config, torch.float64)
        network = make_value_network(config.value, candidates, 1)
        Start(consequents, None, "", "").put_into(network)
        imitation = imitate(network, demonstrations, margin=rules.margin, learns=learns)
        consequents = _hopeful(consequents, imitation.weights.squeeze(0), learns, rules.margin)
        told = (
            f"imitation: the best action is the operator's in {imitation.agreement:.0%} of "
            f"{len(demonstrations.actions):,} steps, and {imitation.mean_difference:.2f} from it "
            "in the mean"
        )
    digest = hashlib.sha256(b"".join(hashlib.sha256(each).digest() for each in contents))
    return Start(consequents, learns, digest.hexdigest(), told)


def _learns(config: Config, consequents: Tensor) -> Tensor | None:
    if not (frozen := config.frozen_rules):
        return None
    learns = torch.ones_like(consequents)
    for places in frozen:
        learns[tuple(slice(None) if place is None else place for place in places)] = 0
    return learns


def _hopeful(before: Tensor, fitted: Tensor, learns: Tensor | None, margin: float) -> Tensor:
    """Have the best action label of each state be worth the margin, as in a told controller.

    A number that is added to all rules of a state changes no choice, so that an operator has no
    say in it; but values that are too low make learning turn away from what was imitated. States
    of which something was known before, or where a rule stays, are left as they are.
    """
    free = (before == 0).all(-1, keepdim=True)
    if learns is not None:
        free &= learns.bool().all(-1, keepdim=True)
    return torch.where(free, fitted + margin - fitted.amax(-1, keepdim=True), fitted)


def _find(key: str, name: str) -> Path:
    """The file or directory of a name: of conf/rules/ if it is there and the name is no path."""
    shipped = config_directory() / _SHIPPED
    path = Path(name)
    if path.name == name and (shipped / name).is_file():
        return shipped / name
    if not path.exists():
        known = sorted(each.name for each in shipped.iterdir() if each.suffix != ".yaml")
        raise RulesError(f"{key}={name}: there is no such file; there is {', '.join(known)}")
    return path


def _bytes_of_job(directory: Path) -> bytes:
    checkpoint = directory / "checkpoint.pt"
    if not checkpoint.is_file():
        raise RulesError(f"rules.prior={directory}: has no checkpoint.pt, so it is no finished job")
    return checkpoint.read_bytes()
