"""A fuzzy Q-function as a rule base."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

import torch
from torch import Tensor

from envs.core.world import WorldConfig
from fnnq_torchrl.agent.rules.controller import Controller, distil
from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.explanation import Explanation
from fnnq_torchrl.agent.rules.formats import export_controller, export_system, read_system
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.system import FuzzySystem, check_size, observed
from fnnq_torchrl.agent.values import FNNQValue
from fnnq_torchrl.agent.values.labels import LabelsValue
from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.equations.membership_functions import Membership, membership_of

_CANDIDATES = 21


@dataclass(frozen=True, eq=False)
class RuleBase(FuzzySystem):
    """Q(s, a) as rules: the last input is the action, and the output is the value.

    ``print`` shows the rules as sentences; a notebook shows them as a table.

    Attributes:
        candidates: the candidate actions of the greedy choice, rising.
    """

    candidates: tuple[float, ...] = ()

    compares: ClassVar[bool] = True
    """Whether the greedy action is the candidate with the highest value."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.inputs) < 2:
            raise RulesError("a value needs a state input and, last, the action")
        if not self.candidates:
            grid = torch.linspace(*self.action.span(), _CANDIDATES, dtype=torch.float64)
            object.__setattr__(self, "candidates", tuple(grid.tolist()))

    @classmethod
    def from_network(
        cls, network: LabelsValue, config: LabelsConfig, world: WorldConfig, run: int | None = None
    ) -> Self:
        """Return the rules of a network.

        Args:
            network: the network, with the labels and the consequents.
            config: the network's configuration, with the labels' names.
            world: the world it learned in, with the variables' names and ranges.
            run: the index of a run; the mean over all runs, if not given.
        """
        weights = network.weight.detach().to("cpu", torch.float64)
        weight = weights.mean(0) if run is None else weights[run]
        candidates = tuple(network.candidates.to("cpu", torch.float64).tolist())
        inputs = partition(config, world, network.labels_of(run))
        return cls(inputs, "value", weight, network.t_norm, network.elsewhere, candidates)

    @classmethod
    def from_system(cls, system: FuzzySystem, candidates: Sequence[float] = ()) -> Self:
        """Return a system whose last input is the action as a rule base.

        Args:
            system: the system.
            candidates: the candidate actions; if empty, the system's own or an even grid.

        Raises:
            RulesError: if the system has only one input.
        """
        return cls(
            system.inputs,
            system.output,
            system.consequents,
            system.t_norm,
            system.elsewhere,
            tuple(candidates) or getattr(system, "candidates", ()),
        )

    @classmethod
    def from_sum(cls, parts: Sequence["RuleBase"], names: Sequence[str]) -> "RuleBase":
        """Return the single rule base whose Q is the sum of several rule bases' Q.

        The single rule base has a rule for every combination of the inputs' labels. A rule's
        consequent is the sum of the parts' consequents for these labels. With the product t-norm
        the parts' normalised firing strengths factor, so the sum is exact.

        Args:
            parts: rule bases about the same action; an input of several parts has the same labels
                in each.
            names: the names of all state inputs, in the wanted order.

        Raises:
            RulesError: if there would be too many rules, or no single rule base has the same sum.
        """
        first, *others = parts
        if not others:
            return first
        states = {variable.name: variable for part in parts for variable in part.states}
        inputs = (*(states[name] for name in names), first.action)
        zero = first.elsewhere == "zero" and any(variable.gaps() for variable in inputs)
        if zero or any(part.t_norm != "product" for part in parts):
            raise RulesError(
                "the sum of these rule bases is no single rule base: that needs t_norm=product "
                "and, for labels with gaps, elsewhere=nearest"
            )
        shape = [len(variable.labels) for variable in inputs]
        check_size(shape)
        consequents = torch.zeros(shape, dtype=torch.float64)
        for part in parts:
            axes = [inputs.index(variable) for variable in part.inputs]
            rising = sorted(range(len(axes)), key=axes.__getitem__)
            sizes = [size if axis in axes else 1 for axis, size in enumerate(shape)]
            consequents += part.consequents.permute(rising).reshape(sizes)
        return cls(inputs, first.output, consequents, "product", first.elsewhere, first.candidates)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read a .fll, .fis, .json or .txt file whose last input is the action.

        Raises:
            OSError: if the file can't be read.
            RulesError: if it has a mistake; the message gives the place.
        """
        content = read_system(Path(path))
        return cls.from_system(content.system, content.candidates)

    def to_network(self, runs: int = 1, dtype: torch.dtype = torch.float32) -> FNNQValue:
        """Return a network with these rules; all its runs have the same consequents."""
        of = {
            variable.name: [{label.kind: label.parameters} for label in variable.labels]
            for variable in self.inputs
        }
        action = of.pop(self.action.name)
        candidates = torch.tensor(self.candidates, dtype=dtype)
        network = FNNQValue(
            of, action, candidates, t_norm=self.t_norm, elsewhere=self.elsewhere, runs=runs
        )
        with torch.no_grad():
            network.weight.copy_(self.consequents.expand_as(network.weight))
        return network

    @property
    def states(self) -> tuple[Variable, ...]:
        """The state inputs: all inputs except the action."""
        return self.inputs[:-1]

    @property
    def action(self) -> Variable:
        """The action's variable, which is the last input."""
        return self.inputs[-1]

    def action_values(self, states: Tensor) -> Tensor:
        """Return Q of every candidate.

        Args:
            states: one number for each state input, ``[*points, states]``.

        Returns:
            ``[*points, candidates]``, float64.
        """
        states = states.to(torch.float64)
        candidates = states.new_tensor(self.candidates)
        if self.t_norm == "product":  # firing strengths factor into state and action parts
            of_states = self._of(self.states).firing(states).flatten(states.ndim - 1)
            of_actions = self._of((self.action,)).firing(candidates.unsqueeze(-1))
            numbers = self.consequents.reshape(of_states.shape[-1], -1)
            return of_states @ (numbers @ of_actions.T)
        each = states.unsqueeze(-2).expand(*states.shape[:-1], len(candidates), -1)
        actions = candidates.expand(each.shape[:-1]).unsqueeze(-1)
        return self.evaluate(torch.cat([each, actions], dim=-1))

    def state_values(self, states: Tensor) -> Tensor:
        """Return V(s), the value of the greedy action, ``[*points]``, float64.

        Args:
            states: one number for each state input, ``[*points, states]``.
        """
        return self.action_values(states).amax(-1)

    def _of(self, inputs: tuple[Variable, ...]) -> FuzzySystem:
        """Return a system of some of the inputs, used for its firing strengths alone."""
        zeros = torch.zeros([len(each.labels) for each in inputs], dtype=torch.float64)
        return FuzzySystem(inputs, self.output, zeros, self.t_norm, self.elsewhere)

    def greedy(self, states: Tensor) -> Tensor:
        """Return the best candidate, or the lowest of equally good ones.

        Args:
            states: ``[*points, states]``.

        Returns:
            ``[*points]``, float64.
        """
        best = self.action_values(states).argmax(-1)
        return states.new_tensor(self.candidates, dtype=torch.float64)[best]

    def controller(self) -> Controller:
        """Return rules from state to action that approximate the greedy policy."""
        return distil(self.states, self.action, self.greedy, self.t_norm, self.elsewhere)

    def explain(self, observation: Mapping[str, float]) -> Explanation:
        """Explain the greedy action in a state by the rules that fire.

        Args:
            observation: a number for each state input by name.

        Raises:
            RulesError: if a state input is missing or a name is unknown.
        """
        return explain([self], observation)

    def export(
        self, path: str | Path, *, controller: str | None = None, floats: bool = False
    ) -> list[Path]:
        """Write the rules to a file in the format of its ending.

        Args:
            path: a path that ends in .fll, .fis, .c, .onnx, .pt2, .json or .txt.
            controller: None for Q; ``"full"`` for the greedy choice among the candidates (.c, .onnx
                and .pt2 only); ``"distilled"`` for the distilled controller.
            floats: whether to compute in single precision (.c, .onnx and .pt2 only).

        Returns:
            The paths of the files that were written.

        Raises:
            OSError: if a file can't be written.
            RulesError: if the ending is unknown or its format can't express the request.
        """
        path = Path(path)
        if controller == "distilled":
            return export_system(path, self.controller().distilled, floats=floats)
        if controller == "full":
            return export_controller(path, self, self.candidates, floats=floats)
        if controller is not None:
            raise RulesError(f"controller={controller}: must be full or distilled")
        return export_system(path, self, self.candidates, floats=floats)


def explain(parts: Sequence[RuleBase], observation: Mapping[str, float]) -> Explanation:
    """Explain the greedy action of a sum of rule bases by the rules that fire.

    Args:
        parts: the rule bases, with the same candidates.
        observation: a number for each state input by name.

    Raises:
        RulesError: if a state input is missing or a name is unknown, or if each rule chooses an
            action (fuzzy Q-learning), so that no actions are compared.
    """
    if not all(part.compares for part in parts):
        raise RulesError(
            "explain: fuzzy Q-learning compares no actions, since each rule chooses its own; "
            "its controller's sentences say which"
        )
    states = {variable.name: variable for part in parts for variable in part.states}
    observed([*states.values()], observation)
    candidates = torch.tensor(parts[0].candidates, dtype=torch.float64)
    premises, firing = [], []
    for part in parts:
        state = torch.tensor([observation[each.name] for each in part.states]).double()
        points = torch.cat([state.expand(len(candidates), -1), candidates.unsqueeze(-1)], -1)
        premises += [part.premise(labels) for labels, _ in part.rules()]
        firing.append(part.firing(points).flatten(1))
    return Explanation(
        dict(observation),
        parts[0].action.name,
        premises,
        torch.cat([part.consequents.flatten() for part in parts]),
        candidates,
        torch.cat(firing, dim=-1),
    )


def partition(
    config: LabelsConfig,
    world: WorldConfig,
    labels: Sequence[Sequence[Membership]] | None = None,
) -> tuple[Variable, ...]:
    """Return the variables of a configuration: the inputs in order, then the action.

    Args:
        config: the configuration of the labels and their names.
        world: the world, with the ranges and the action's name.
        labels: each variable's labels, if they differ from the configuration's.
    """
    if labels is None:
        both = (*config.inputs.values(), config.action)
        labels = [[membership_of(label, config.width) for label in each] for each in both]
    actions = world.actions
    action_range = (0.0, max(1.0, actions - 1.0)) if isinstance(actions, int) else actions
    ranges = {**world.observations, world.action_name: action_range}
    variables = []
    for name, its_labels in zip((*config.inputs, world.action_name), labels, strict=True):
        words = config.names_of(name, len(its_labels))
        of = (Label(word, *label) for word, label in zip(words, its_labels, strict=True))
        variables.append(Variable(name, tuple(of), *ranges[name]))
    return tuple(variables)
