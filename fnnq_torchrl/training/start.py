"""The consequents that learning starts from, by the prior knowledge of ``conf/rules/``."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import torch
from torch import Tensor

from envs.core.world import WorldConfig
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.imitation import imitate, read_demonstrations
from fnnq_torchrl.agent.rules import RulesError, partition
from fnnq_torchrl.agent.rules.errors import choices, shown
from fnnq_torchrl.agent.rules.parts import Content, Definitions
from fnnq_torchrl.agent.rules.prior import definitions_of, from_content, read_prior
from fnnq_torchrl.agent.rules.system import fit_words
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.equations.membership_functions import Membership
from fnnq_torchrl.training.jobs import Job
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


def with_imported_labels(jobs: Sequence[Job]) -> Sequence[Job]:
    """Return the jobs of a batch, with the labels and settings of ``rules.prior``'s file, if any.

    The new configurations contain the file's labels and settings as if a user had given them.
    Labels that a user has given, and settings that differ from the default, aren't replaced;
    :func:`read_start` compares them with the file.

    Raises:
        ConfigError, OSError: as in :func:`read_start`.
    """
    config = imported(jobs[0].config)
    if config is jobs[0].config:
        return jobs
    return [replace(job, config=replace(job.config, value=config.value)) for job in jobs]


def imported(config: Config) -> Config:
    """Return a job's configuration, changed as by :func:`with_imported_labels`."""
    rules, value = config.rules, config.value
    if rules is None or rules.prior is None:
        return config
    path = rules.files()["prior"]
    given = _of_job(path).definitions if path.is_dir() else definitions_of(path)
    defaults = {field.name: field.default for field in fields(value)}
    settings = {
        name: setting
        for name, setting in given.settings.items()
        if getattr(value, name) == defaults[name]
    }
    value = replace(value, **settings)
    if given.variables and value.as_shipped:
        value = _with_labels(replace(value, width="sigma"), given, config.env)
    elif value.inputs is None or value.action is None:
        raise given.error("defines no labels, and value.inputs or value.action is null")
    return replace(config, value=value)


def _with_labels(value: LabelsConfig, given: Definitions, world: WorldConfig) -> LabelsConfig:
    """Return a copy of the settings with the labels of a file about the world's variables."""
    names = [*world.observations, world.action_name]
    known = dict(zip(fit_words(names), names, strict=True)) | {name: name for name in names}
    labels: dict[str, list[Membership]] = {}
    names_of = {}
    for i, variable in enumerate(given.variables):
        if variable.name not in known:
            advice = choices(variable.name, names)
            words = f"{shown(variable.name)}: {world.kind} has no such input"
            raise given.error(f"{words}; {advice}", i)
        if world.action_name in labels:
            raise given.error(f"{world.action_name} must be the last of the inputs", i - 1)
        name = known[variable.name]
        labels[name] = [(label.kind, label.parameters) for label in variable.labels]
        names_of[name] = fit_words(variable.names)
    action = labels.pop(world.action_name, None)
    if not labels:
        raise given.error(f"expected an input among {', '.join(world.observations)}")
    return value.found(labels, world, action, names_of)


def read_start(config: Config) -> Start | None:
    """Read the prior knowledge that a configuration names; None if it names none.

    Raises:
        ConfigError: if a file is missing, has a mistake, or is about other rules. One line.
        OSError: if a file can't be read.
    """
    rules = config.rules
    if rules is None or (rules.prior is None and rules.demonstrations is None and not rules.frozen):
        return None
    variables = partition(config.value, config.env)
    settings = {"t_norm": config.value.t_norm, "elsewhere": config.value.elsewhere}
    contents = []
    consequents = torch.zeros([len(each.labels) for each in variables], dtype=torch.float64)
    files = rules.files()
    if (path := files.get("prior")) is not None:
        if path.is_dir():
            contents.append(_bytes_of_job(path))
            consequents = from_content(_of_job(path), variables, rules.margin, **settings)
        else:
            contents.append(path.read_bytes())
            consequents = read_prior(path, variables, rules.margin, **settings)
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


def _of_job(directory: Path) -> Content:
    """Return the rules of a finished job, as the content of a file."""
    _bytes_of_job(directory)
    rules = load_rules(directory)
    settings = {"t_norm": rules.t_norm, "elsewhere": rules.elsewhere}
    return Content(rules, Definitions(str(directory), rules.inputs, settings))


def _bytes_of_job(directory: Path) -> bytes:
    checkpoint = directory / "checkpoint.pt"
    if not checkpoint.is_file():
        raise RulesError(
            f"rules.prior={directory}: has no checkpoint.pt, so it isn't a finished job"
        )
    return checkpoint.read_bytes()
