"""The rules of a fuzzy Q-function."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import torch
from torch import Tensor

from envs.core.world import WorldConfig
from fnnq_torchrl.agent.rules.controller import Controller, distil
from fnnq_torchrl.agent.rules.errors import RulesError
from fnnq_torchrl.agent.rules.explanation import Explanation
from fnnq_torchrl.agent.rules.formats import export_controller, export_system, read_system
from fnnq_torchrl.agent.rules.partition import Label, Variable
from fnnq_torchrl.agent.rules.system import FuzzySystem, observed
from fnnq_torchrl.agent.values import FNNQValue
from fnnq_torchrl.config.values import LabelsConfig
from fnnq_torchrl.equations.membership_functions import Membership, membership_of

_CANDIDATES = 21


@dataclass(frozen=True, eq=False)
class RuleBase(FuzzySystem):
    """Q(s, a) as rules: the last input is the action, the output the value.

    ``print`` shows the rules as sentences, a notebook as a table.

    Attributes:
        candidates: the actions among which the best is sought, rising.
    """

    candidates: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.inputs) < 2:
            raise RulesError("a value needs a state input and, last, the action")
        if not self.candidates:
            grid = torch.linspace(*self.action.span(), _CANDIDATES, dtype=torch.float64)
            object.__setattr__(self, "candidates", tuple(grid.tolist()))

    @classmethod
    def from_network(
        cls, network: FNNQValue, config: LabelsConfig, world: WorldConfig, run: int | None = None
    ) -> Self:
        """The rules of a network.

        Args:
            network: which has the labels and the consequents.
            config: that the network was made from, which has the labels' words.
            world: that it learned in, which has the ranges and the names.
            run: which of the network's runs; if not given, the mean over them.
        """
        weights = network.weight.detach().to("cpu", torch.float64)
        weight = weights.mean(0) if run is None else weights[run]
        candidates = tuple(network.candidates.to("cpu", torch.float64).tolist())
        inputs = partition(config, world, network.labels_of(run))
        return cls(inputs, "value", weight, network.t_norm, network.elsewhere, candidates)

    @classmethod
    def from_system(cls, system: FuzzySystem, candidates: Sequence[float] = ()) -> Self:
        """The rules of a system whose last input is the action.

        Raises:
            RulesError: it has a single input.
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
    def read(cls, path: str | Path) -> Self:
        """Read a file, by its ending: .fll, .fis, .json or .txt. The last input is the action.

        Raises:
            OSError: the file can't be read.
            RulesError: it holds no such rules. One line, with the place.
        """
        system, candidates = read_system(Path(path))
        return cls.from_system(system, candidates)

    def to_network(self, runs: int = 1, dtype: torch.dtype = torch.float32) -> FNNQValue:
        """A network with these rules, whose consequents are the same in every run."""
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
        """The inputs but the action."""
        return self.inputs[:-1]

    @property
    def action(self) -> Variable:
        """The last input."""
        return self.inputs[-1]

    def action_values(self, states: Tensor) -> Tensor:
        """Q of every candidate.

        Args:
            states: one number for each state input, ``[*points, states]``.

        Returns:
            ``[*points, candidates]``, float64.
        """
        states = states.to(torch.float64)
        candidates = states.new_tensor(self.candidates)
        if self.t_norm == "product":  # whose shares factor into those of the state and the action
            of_states = self._of(self.states).firing(states).flatten(states.ndim - 1)
            of_actions = self._of((self.action,)).firing(candidates.unsqueeze(-1))
            numbers = self.consequents.reshape(of_states.shape[-1], -1)
            return of_states @ (numbers @ of_actions.T)
        each = states.unsqueeze(-2).expand(*states.shape[:-1], len(candidates), -1)
        actions = candidates.expand(each.shape[:-1]).unsqueeze(-1)
        return self.evaluate(torch.cat([each, actions], dim=-1))

    def _of(self, inputs: tuple[Variable, ...]) -> FuzzySystem:
        """The firing of some of the inputs alone."""
        zeros = torch.zeros([len(each.labels) for each in inputs], dtype=torch.float64)
        return FuzzySystem(inputs, self.output, zeros, self.t_norm, self.elsewhere)

    def greedy(self, states: Tensor) -> Tensor:
        """The best candidate, the lowest of several: ``[*points]`` of ``[*points, states]``."""
        best = self.action_values(states).argmax(-1)  # the first, if there are several
        return states.new_tensor(self.candidates, dtype=torch.float64)[best]

    def controller(self) -> Controller:
        """What the greedy policy does, as rules from state to action."""
        return distil(self.states, self.action, self.greedy, self.t_norm, self.elsewhere)

    def explain(self, observation: Mapping[str, float]) -> Explanation:
        """Why the greedy policy does what it does in a state.

        Args:
            observation: a number for each state input, by its name.

        Raises:
            RulesError: one is missing, or unknown.
        """
        state = observed(self.states, observation)
        values = self.action_values(state)
        points = torch.cat(
            [state.expand(len(values), -1), values.new_tensor(self.candidates).unsqueeze(-1)], -1
        )
        return Explanation(
            dict(observation),
            self.action.name,
            [self.premise(labels) for labels, _ in self.rules()],
            self.consequents.flatten(),
            values.new_tensor(self.candidates),
            self.firing(points).flatten(1),
        )

    def export(
        self, path: str | Path, *, controller: str | None = None, floats: bool = False
    ) -> list[Path]:
        """Write the rules into a file, in the format of its ending.

        Args:
            path: ends in .fll, .fis, .c, .onnx, .pt2, .json or .txt.
            controller: none for Q; ``full`` for the best of the candidates, where the format can;
                ``distilled`` for the distilled controller.
            floats: whether what is exported computes in single precision, where it can.

        Returns:
            The files that were written.

        Raises:
            OSError: a file can't be written.
            RulesError: the ending is unknown, or the format can't express that.
        """
        path = Path(path)
        if controller == "distilled":
            return export_system(path, self.controller().distilled, floats=floats)
        if controller == "full":
            return export_controller(path, self, self.candidates, floats=floats)
        if controller is not None:
            raise RulesError(f"controller={controller}: must be full or distilled")
        return export_system(path, self, self.candidates, floats=floats)


def partition(
    config: LabelsConfig,
    world: WorldConfig,
    labels: Sequence[Sequence[Membership]] | None = None,
) -> tuple[Variable, ...]:
    """The variables of a configuration: the inputs in their order, and the action.

    Args:
        config: the labels and their words.
        world: the ranges and the action's name.
        labels: those of each variable, where they aren't the configuration's.
    """
    if labels is None:
        both = (*config.inputs.values(), config.action)
        labels = [[membership_of(label, config.width) for label in each] for each in both]
    actions = world.actions
    action_range = (0.0, actions - 1.0) if isinstance(actions, int) else actions
    ranges = {**world.observations, world.action_name: action_range}
    variables = []
    for name, its_labels in zip((*config.inputs, world.action_name), labels, strict=True):
        words = config.names_of(name, len(its_labels))
        of = (Label(word, *label) for word, label in zip(words, its_labels, strict=True))
        variables.append(Variable(name, tuple(of), *ranges[name]))
    return tuple(variables)
