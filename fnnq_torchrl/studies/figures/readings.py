"""What the two readings of step h do: ‖f‖², the effective step size, and the score."""

import numpy as np
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fnnq_torchrl.studies.effective_step import effective_step, squared_gradient
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.training.pictures.style import (
    GREY,
    LINES,
    count_words,
    label_ends,
    new_figure,
    quiet_grid,
)
from fnnq_torchrl.training.pictures.words import setting_words

from .lines import INTERVAL, draw_lines

_GRID = 201


def readings_figure(experiment: Experiment, measure: str = "mean_score") -> Figure:
    """Draw three panels from an experiment that varies ``trace`` and ``lam``.

    Raises:
        NoResults: a combination is missing.
    """
    traces = experiment.values("trace")
    over = count_words([experiment.runs])
    figure = new_figure(
        15,
        4.4,
        f"{' and '.join(setting_words('trace', trace) for trace in traces)}: "
        "‖f‖², the effective step size, and the score",
        "middle: median over the states and actions on the left, band: 5 to 95 % of them; "
        f"right: mean over {over}, band: its {INTERVAL}",
    )
    left, middle, right = figure.subplots(1, 3)
    norm = norms(experiment)
    _draw_norm(figure, left, experiment, norm)
    _draw_steps(middle, experiment, norm)
    draw_lines(right, experiment, "lam", "trace", measure)
    figure.draw_without_rendering()
    for axes in (middle, right):
        label_ends(axes, [setting_words("trace", trace) for trace in traces])
    return figure


def norms(experiment: Experiment) -> np.ndarray:
    """‖f‖² on a grid of bearings and actions, ``[actions, bearings]``."""
    settings = experiment.jobs[0].settings
    view_rad = settings["env.field_of_view_rad"]
    bearing = torch.linspace(-view_rad, view_rad, _GRID, dtype=torch.float64)
    action = torch.linspace(-1, 1, _GRID, dtype=torch.float64).unsqueeze(-1)
    inputs = [
        (settings["value.inputs.bearing"], bearing.expand(_GRID, _GRID)),
        (settings["value.action"], action.expand(_GRID, _GRID)),
    ]
    return squared_gradient(inputs, settings["value.width"]).numpy()


def _draw_norm(figure: Figure, axes: Axes, experiment: Experiment, norm: np.ndarray) -> None:
    view_rad = experiment.jobs[0].settings["env.field_of_view_rad"]
    image = axes.imshow(
        norm,
        extent=(-view_rad, view_rad, -1, 1),
        origin="lower",
        aspect="auto",
        cmap="cividis",
        vmin=0,
    )
    axes.set_xlabel("bearing Δθ (rad)")
    axes.set_ylabel("action Δv")
    figure.colorbar(image, ax=axes, label="‖f‖² (1 in a table)")


def _draw_steps(axes: Axes, experiment: Experiment, norm: np.ndarray) -> None:
    settings = experiment.jobs[0].settings
    lams = sorted(experiment.values("lam"))
    lam = torch.linspace(lams[0], lams[-1], _GRID, dtype=torch.float64)
    decay = (settings["gamma"] * lam).clamp(max=1 - 1e-9)
    low, median, high = np.quantile(norm, [0.05, 0.5, 0.95])
    for trace, (colour, style) in zip(experiment.values("trace"), LINES, strict=False):
        lowest, middle, highest = (
            effective_step(torch.tensor(x), settings["alpha"], decay, trace).numpy()
            for x in (low, median, high)
        )
        axes.plot(lam, middle, color=colour, linestyle=style, linewidth=1.4)
        axes.fill_between(lam, lowest, highest, color=colour, alpha=0.3, linewidth=0)
    for height, words in ((1, "overshoots"), (2, "ends farther off")):
        axes.hlines(height, lams[0], lams[-1], color=GREY, linewidth=0.8, linestyle=":", zorder=1.5)
        axes.annotate(
            f"above: a last step {words}",
            (lams[0], height),
            (3, 3),
            textcoords="offset points",
            fontsize=8,
            color=GREY,
        )
    axes.set_xlim(lams[0], lams[-1])
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_xlabel("λ")
    axes.set_ylabel("effective step size (share of the error)")
    quiet_grid(axes)
