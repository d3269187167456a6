"""The consequents that learning starts from, by the prior knowledge of ``conf/rules/``."""

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
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.training.policies import load_rules


@dataclass(frozen=True, eq=False)
class Start:
    """The common start of all runs of a job.

    Attributes:
        consequents: the first consequents, float64 ``[labels of input 1, …, action labels]``.
        learns: 1 for each rule that learns and 0 for each frozen rule, shaped as
            ``consequents``; None if all rules learn.
        digest: the SHA-256 digest of the files that were read.
        told: a line for the user about the result of imitation; empty without imitation.
    """

    consequents: Tensor
    learns: Tensor | None
    digest: str
    told: str

    @property
    def masks(self) -> dict[str, Tensor]:
        """The mask `learns` by the name of its parameter; empty if all rules learn."""
        return {} if self.learns is None else {"weight": self.learns}

    def put_into(self, network: ValueNetwork) -> None:
        """Copy the consequents to all runs of a network."""
        with torch.no_grad():
            weight = network.get_parameter("weight")
            weight.copy_(self.consequents.expand_as(weight))


def read_start(config: Config) -> Start | None:
    """Read the prior knowledge that a configuration names; None if it names none.

    Raises:
        ConfigError: if a file is missing, has a mistake, or is about other rules. One line.
        OSError: if a file can't be read.
    """
    rules = config.rules
    if rules is None or (rules.prior is None and rules.demonstrations is None and not rules.frozen):
        return None
    variables, t_norm = partition(config.value, config.env), config.value.t_norm
    contents = []
    consequents = torch.zeros([len(each.labels) for each in variables], dtype=torch.float64)
    files = rules.files()
    if (path := files.get("prior")) is not None:
        if path.is_dir():
            contents.append(_bytes_of_job(path))
            consequents = from_system(load_rules(path), variables, rules.margin, str(path), t_norm)
        else:
            contents.append(path.read_bytes())
            consequents = read_prior(path, variables, rules.margin, t_norm)
    learns = _learns(config, consequents)
    told = ""
    if (path := files.get("demonstrations")) is not None:
        contents.append(path.read_bytes())
        demonstrations = read_demonstrations(path, variables)
        candidates = make_candidates(config, torch.float64)
        network = make_value_network(config.value, candidates, 1)
        Start(consequents, None, "", "").put_into(network)
        imitation = imitate(network, demonstrations, margin=rules.margin, learns=learns)
        consequents = _hopeful(consequents, imitation.weights.squeeze(0), learns, rules.margin)
        told = (
            f"imitation: the best action is the operator's in {imitation.agreement:.0%} of "
            f"{len(demonstrations.actions):,} steps; the mean difference between the two is "
            f"{imitation.mean_difference:.2f}"
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
    """Shift fitted consequents so that each state's best action label has the value ``margin``.

    Adding a number to all rules of a state changes no greedy action, so demonstrations don't
    determine this number. But if the values are too low, learning turns away from the imitated
    actions. States with prior values or frozen rules aren't shifted.
    """
    free = (before == 0).all(-1, keepdim=True)
    if learns is not None:
        free &= learns.bool().all(-1, keepdim=True)
    return torch.where(free, fitted + margin - fitted.amax(-1, keepdim=True), fitted)


def _bytes_of_job(directory: Path) -> bytes:
    checkpoint = directory / "checkpoint.pt"
    if not checkpoint.is_file():
        raise RulesError(
            f"rules.prior={directory}: has no checkpoint.pt, so it isn't a finished job"
        )
    return checkpoint.read_bytes()
