"""The pictures of the page: learning curves, and the sweep."""

from collections.abc import Sequence

from envs.pictures import Axes, Figure, own_style
from fnnq_torchrl.training.intervals import mean_interval
from fnnq_torchrl.training.pictures.style import LINES, count_words, new_figure, quiet_grid
from fnnq_torchrl.training.results import CONFIDENCE

from .learners import WORLDS, Learner, World, in_world, settings_of

_BAND = f"band: its {100 * CONFIDENCE:g} % interval (Student's t)"


@own_style()
def curves_figure(learners: Sequence[Learner]) -> Figure:
    """Draw the measure in the tests against the situations, a panel for each classic world."""
    runs = count_words([each.judged.evaluations.runs for each in _classic(learners)])
    figure = new_figure(
        15,
        4.6,
        "Value functions, each with its own best λ and α",
        f"line: mean over {runs} in the greedy tests; {_BAND}",
    )
    styles = _styles(learners)
    row = figure.subplots(1, len(WORLDS), squeeze=False)[0]
    for axes, world in zip(row, WORLDS, strict=True):
        for learner in in_world(learners, world):
            colour, style = styles[learner.value]
            mean, low, high = mean_interval(learner.curve, axis=0)
            x = learner.judged.evaluations.situations
            axes.plot(x, mean, style, color=colour, linewidth=1.4, label=learner.value)
            axes.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
        _dress(axes, world)
        axes.set_xlabel("episodes learned from")
        axes.set_xlim(0, x[-1])
    row[0].legend(frameon=False, fontsize=8, loc="center right", bbox_to_anchor=(1, 0.6))
    return figure


@own_style()
def sweep_figure(learners: Sequence[Learner]) -> Figure:
    """Draw the sweep's measure against α, at the best λ; a panel for each classic world."""
    runs = count_words([job.evaluations.runs for each in _classic(learners) for job in each.sweep])
    figure = new_figure(
        15,
        4.6,
        "The sweep: every α, at the best λ of each value function",
        f"line: mean over {runs} in the episodes learned from; {_BAND}; dot: the best α",
    )
    styles = _styles(learners)
    row = figure.subplots(1, len(WORLDS), squeeze=False)[0]
    for axes, world in zip(row, WORLDS, strict=True):
        for learner in in_world(learners, world):
            colour, style = styles[learner.value]
            lam, best = settings_of(learner.best)
            jobs = sorted(
                (job for job in learner.sweep if settings_of(job)[0] == lam),
                key=lambda job: settings_of(job)[1],
            )
            samples = [world.measured(job.evaluations)[:, 1:].mean(axis=1) for job in jobs]
            found = [mean_interval(sample) for sample in samples]
            x, means = [settings_of(job)[1] for job in jobs], [float(each.mean) for each in found]
            label = f"{learner.value}, λ = {lam:g}"
            axes.plot(x, means, style, color=colour, linewidth=1.4, label=label)
            bounds = [each.low for each in found], [each.high for each in found]
            axes.fill_between(x, *bounds, color=colour, alpha=0.2, linewidth=0)
            axes.plot(best, means[x.index(best)], "o", color=colour, markersize=5)
        _dress(axes, world)
        axes.set_xscale("log")
        axes.set_xlabel("α")
        axes.legend(frameon=False, fontsize=8)
    return figure


def _classic(learners: Sequence[Learner]) -> list[Learner]:
    return [each for each in learners if each.world in WORLDS]


def _styles(learners: Sequence[Learner]) -> dict[str, tuple[str, str]]:
    """Return the colour and the line style of each value function."""
    names = dict.fromkeys(each.value for each in _classic(learners))
    return dict(zip(names, LINES, strict=False))


def _dress(axes: Axes, world: World) -> None:
    axes.set_title(world.title, fontsize=10)
    axes.set_ylabel(world.measure)
    if world.sign < 0:
        axes.set_yscale("log")
        low, high = axes.get_ylim()
        axes.set_yticks([tick for tick in (100, 200, 500, 1000) if low <= tick <= high])
        axes.yaxis.set_major_formatter("{x:,.0f}")
        axes.yaxis.set_minor_formatter("")
    quiet_grid(axes)
