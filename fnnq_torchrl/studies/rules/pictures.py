"""Pictures of a run: its memberships, Q surface, consequents, an episode and an explanation."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor

from envs.drawing import shot_of
from envs.pictures import Axes, Figure, own_style
from envs.robot.arena import Arena
from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.rules import Explanation, RuleBase, Variable
from fnnq_torchrl.studies.rules.job import Chosen, Job
from fnnq_torchrl.studies.rules.reading import HARDLY, Reading
from fnnq_torchrl.training.pictures.style import GREY, LINES, new_figure, quiet_grid, save
from fnnq_torchrl.training.weights import Snapshots

_POINTS = 401
_MOST_LINES = 8


@own_style()
def draw_explanation(explanation: Explanation, picture: Path) -> None:
    """Draw Q of the candidate actions, and each rule's contribution to Q of the explained action.

    Args:
        explanation: the explanation of an action.
        picture: the file to write.

    Raises:
        OSError: if the file can't be written.
        ValueError: if the file's format is unknown.
    """
    seen = ", ".join(f"{name} = {value:g}" for name, value in explanation.observation.items())
    title = f"{seen}: {explanation.action_name} {_plain(explanation.action):+g}"
    figure = new_figure(10, 4.2, title, "Q is the sum of the bars; rules below 1 % have no bar")
    curve, bars = figure.subplots(1, 2, width_ratios=(1, 1.3))
    curve.plot(explanation.candidates.numpy(), explanation.values.numpy(), color=LINES[0][0])
    curve.axvline(explanation.action, color=GREY, linestyle=":")
    curve.set_xlabel(explanation.action_name)
    curve.set_ylabel("Q")
    fired = explanation.fired()[::-1]
    names = [
        f"{premise}\nfires {strength:.0%}, says {value:.2f}"
        for premise, strength, value, _ in fired
    ]
    bars.barh(range(len(fired)), [added for *_, added in fired], color=LINES[0][0])
    bars.set_yticks(range(len(fired)), labels=names, fontsize=7)
    bars.axvline(0, color=GREY, linewidth=0.8)
    bars.set_xlabel("adds to Q")
    for axes in (curve, bars):
        quiet_grid(axes)
    save(figure, picture)


def memberships(reading: Reading) -> Figure:
    """Draw the labels of each variable and their gaps, and name the labels that hardly fired."""
    rules = reading.chosen.rules
    variables = rules.inputs
    never = ", ".join(_never_fired(reading)) or "none"
    caption = (
        f"grey: the highest degree; gaps: {_gap_words(variables)}; "
        f"labels that fired less than {HARDLY:g} in the test: {never}"
    )
    title = f"Memberships, {reading.chosen.words}"
    figure = new_figure(9, 1.2 + 2.4 * len(variables), title, caption)
    for axes, variable in zip(
        figure.subplots(len(variables), squeeze=False)[:, 0], variables, strict=True
    ):
        x = torch.linspace(*variable.span(), _POINTS, dtype=torch.float64)
        degrees = variable.log_degrees(x).exp().numpy()
        axes.fill_between(x.numpy(), 0, degrees.max(axis=0), color="0.93", linewidth=0)
        for label, degree, (colour, style) in zip(variable.labels, degrees, LINES, strict=False):
            axes.plot(x.numpy(), degree, color=colour, linestyle=style, label=label.name)
        for low, high in variable.gaps():
            axes.axvspan(low, high, color="0.85")
        axes.set_xlabel(variable.name)
        axes.set_ylabel("degree")
        axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
        quiet_grid(axes)
    return figure


def surface(reading: Reading) -> Figure:
    """Draw Q over the first state input and the action, with the greedy action as a line.

    The other state inputs are fixed at the middle of their ranges.
    """
    rules = reading.chosen.rules
    state, *others = rules.states
    x = torch.linspace(*state.span(), _POINTS, dtype=torch.float64)
    y = torch.linspace(*rules.action.span(), _POINTS, dtype=torch.float64)
    middles = [sum(other.span()) / 2 for other in others]
    states = torch.cat([x.unsqueeze(-1), x.new_tensor(middles).expand(len(x), -1)], dim=-1)
    points = torch.cat(
        [
            states.unsqueeze(0).expand(len(y), -1, -1),
            y.view(-1, 1, 1).expand(-1, len(x), 1),
        ],
        dim=-1,
    )
    fixed = ", ".join(
        f"{other.name} = {middle:g}" for other, middle in zip(others, middles, strict=True)
    )
    figure = new_figure(
        8,
        5,
        f"Q, {reading.chosen.words}",
        f"white: the best of {len(rules.candidates)} actions; dashed: the distilled controller"
        + (f"; where {fixed}" if fixed else ""),
    )
    axes = figure.add_subplot()
    mesh = axes.pcolormesh(
        x.numpy(),
        y.numpy(),
        rules.evaluate(points).numpy(),
        cmap="viridis",
        shading="nearest",
        rasterized=True,
    )
    figure.colorbar(mesh, ax=axes, label="Q")
    axes.plot(x.numpy(), rules.greedy(states).numpy(), color="white")
    smooth = reading.controller.distilled.evaluate(states).numpy()
    axes.plot(x.numpy(), smooth, color="white", linestyle="--", linewidth=1)
    axes.set_xlabel(state.name)
    axes.set_ylabel(rules.action.name)
    return figure


def consequents(job: Job, chosen: Chosen, snapshots: Snapshots) -> Figure:
    """Draw the consequents of the chosen run, or their mean over all runs, while it learned.

    Of many combinations of state labels, those whose consequents changed most have lines.
    """
    action = chosen.rules.action
    columns, rows = len(action.labels), len(chosen.parts)
    most = max(part.consequents[..., 0].numel() for part in chosen.parts)
    caption = "a panel for each action label, a line for each combination of state labels"
    if most > _MOST_LINES:
        caption += f": the {_MOST_LINES} whose consequents changed most"
    title = f"Consequents while learning, {chosen.words}"
    long = max(len(name) for part in chosen.parts for name in _premises_of_states(part)) > 40
    figure = new_figure(3 * columns, 0.6 + (4.2 if long else 3) * rows, title, caption)
    bands = figure.subfigures(rows, 1, squeeze=False)[:, 0]
    for band, rules, name in zip(bands, chosen.parts, job.names, strict=True):
        weight = snapshots.weights[name]
        if chosen.spread:
            history = weight.double().mean(1)
        else:
            history = weight[:, snapshots.seed.tolist().index(chosen.seed)].double()
        of_states = history.reshape(len(history), -1, columns)
        change = (of_states[-1] - of_states[0]).abs().sum(-1)
        # In the order of the rules
        shown = sorted(change.argsort(descending=True, stable=True)[:_MOST_LINES].tolist())
        panels = band.subplots(1, columns, sharex=True, sharey=True, squeeze=False)[0]
        for column, axes in enumerate(panels):
            for place, (colour, style) in zip(shown, LINES, strict=False):
                lines = of_states[:, place, column].numpy()
                axes.plot(snapshots.situations.numpy(), lines, color=colour, linestyle=style)
            axes.set_title(f"{action.name} is {action.labels[column].name}", fontsize=9)
            axes.set_xlabel("learning situations")
            quiet_grid(axes)
        panels[0].set_ylabel("consequent")
        names = _premises_of_states(rules)
        where = "upper center" if long else "right center"
        band.legend(
            panels[0].lines,
            [names[place] for place in shown],
            fontsize=7,
            loc=f"outside {where}",
        )
    return figure


def _premises_of_states(rules: RuleBase) -> list[str]:
    """Return the premise of each combination of state labels, without the action's label."""
    columns = len(rules.action.labels)
    return [rules.premise(labels[:-1]) for labels, _ in rules.rules()][::columns]


def episode(reading: Reading, situation: int) -> Figure:
    """Draw a situation of the test: the robot's path, the rules that fired, and the TD errors."""
    rules, played = reading.chosen.rules, reading.played
    before, after = played.before[:, 0, situation], played.after[:, 0, situation]
    counts = played.counts[:, 0, situation]
    before, after = before[counts], after[counts]
    points = torch.cat([before[name] for name in (*played.names, "action")], dim=-1).double()
    columns = [variable.name for variable in rules.inputs]
    parts = reading.chosen.parts
    firing = torch.cat(
        [
            part.firing(points[:, [columns.index(each.name) for each in part.inputs]]).flatten(1)
            for part in parts
        ],
        dim=-1,
    )
    error = _td_error(reading, points, after)
    success = bool(after["success"][-1])
    figure = new_figure(
        11,
        5.5,
        f"Situation {situation + 1} of the test, {reading.chosen.words}: "
        f"{'a success' if success else 'no success'} after {len(points)} steps",
        f"the {_MOST_LINES} rules that fired most; the TD error is r + γ max Q(s′, ·) − Q(s, a)",
    )
    left, right = figure.subfigures(1, 2, squeeze=False, width_ratios=(1, 1.6))[0]
    _path(left.add_subplot(), reading, situation)
    strengths, errors = right.subplots(2, sharex=True, height_ratios=(2, 1))
    names = [part.premise(labels) for part in parts for labels, _ in part.rules()]
    order = firing.sum(0).argsort(descending=True)[:_MOST_LINES].tolist()
    for place, (colour, style) in zip(order, LINES, strict=False):
        strengths.plot(firing[:, place].numpy(), color=colour, linestyle=style, label=names[place])
    strengths.set_ylabel("firing strength")
    # A premise of many inputs is as wide as the panel.
    columns_of_legend = 2 if len(max(names, key=len)) < 50 else 1
    right.legend(fontsize=6, loc="outside upper center", ncols=columns_of_legend)
    errors.plot(error.numpy(), color="black", linewidth=1)
    errors.set_ylabel("TD error")
    errors.set_xlabel("step")
    for axes in (strengths, errors):
        quiet_grid(axes)
    return figure


def _td_error(reading: Reading, points: Tensor, after: TensorDictBase) -> Tensor:
    """Return δ′ = r + γ max Q(s′, ·) − Q(s, a) of each step (paper, eq. 5), ``[steps]``."""
    rules, gamma = reading.chosen.rules, reading.job.config.gamma
    states = torch.cat([after[name] for name in reading.played.names], dim=-1)
    ahead = rules.state_values(states).masked_fill(after["terminated"].squeeze(-1), 0)
    return after["reward"].squeeze(-1).double() + gamma * ahead - rules.evaluate(points)


def _path(axes: Axes, reading: Reading, situation: int) -> None:
    """Draw the robot's world at the situation's end, with the paths so far.

    In a world without a robot, draw the observations instead.
    """
    played = reading.played
    counts = played.counts[:, 0, situation]
    if isinstance(played.env, FollowBall | Arena):
        after = played.after[:, 0, situation][counts]
        shots = [shot_of(played.env, played.starts[0, situation].unsqueeze(0))]
        shots += [shot_of(played.env, after, step) for step in range(len(after))]
        return shots[-1].draw(axes, shots[0].in_view(shots))
    before = played.before[:, 0, situation][counts]
    for name, (colour, style) in zip(played.names, LINES, strict=False):
        axes.plot(before[name].squeeze(-1).numpy(), color=colour, linestyle=style, label=name)
    axes.legend(fontsize=7)
    axes.set_xlabel("step")
    return quiet_grid(axes)


def _never_fired(reading: Reading) -> Iterator[str]:
    """Yield the labels whose rules fired less than :data:`.HARDLY` in the replay, all together."""
    for variable in reading.chosen.rules.inputs:
        most = torch.zeros(len(variable.labels)).double()
        for part, fired in zip(reading.chosen.parts, reading.fired, strict=True):
            if variable in part.inputs:
                axis = part.inputs.index(variable)
                most = most.maximum(fired.movedim(axis, 0).flatten(1).sum(-1))
        for label, strength in zip(variable.labels, most.tolist(), strict=True):
            if strength < HARDLY:
                yield f"{variable.name} {label.name}"


def _gap_words(variables: tuple[Variable, ...]) -> str:
    gaps = [
        f"{variable.name} {low:.3g} to {high:.3g}"
        for variable in variables
        for low, high in variable.gaps()
    ]
    return ", ".join(gaps) or "none"


def _plain(action: float) -> float:
    """Return the action in float32, with rounding errors around 0 removed."""
    return 0.0 if abs(action) < 1e-6 else float(np.float32(action))
