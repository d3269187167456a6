"""A figure of ``trace=output`` beside ``trace=gradient``, the two readings of step h."""

import numpy as np
import torch

from envs.pictures import Axes, Figure, LineCollection
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

from .lines import INTERVAL, draw_lines, means
from .outliers import CUT_OFF, limits

_GRID = 201


def readings_figure(experiment: Experiment, measure: str = "mean_score") -> Figure:
    """Draw ‖f‖², the effective step size and a measure, for an experiment on ``trace`` and ``lam``.

    Raises:
        NoResults: if a combination of the two keys' values is missing.
    """
    traces = experiment.values("trace")
    words = [setting_words("trace", trace) for trace in traces]
    over = count_words([experiment.runs])
    found = means(experiment, "lam", "trace", measure)
    shown = limits(*found)
    cut_off = f"; {CUT_OFF}" if (found[0] < shown.low).any() else ""
    norm = norms(experiment)
    low, median = np.quantile(norm, [0.05, 0.5])
    figure = new_figure(
        11,
        7.6,
        f"{' and '.join(words)}: ‖f‖², the effective step size, and the score",
        f"above: at the median of ‖f‖², {median:.2f} (solid), and at its 5 % quantile, {low:.2f} "
        f"(dashed)\nbelow: mean over {over}, band: its {INTERVAL}{cut_off}",
    )
    grid = figure.add_gridspec(2, 2)
    steps, scores = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    _draw_norm(figure, figure.add_subplot(grid[:, 0]), experiment, norm)
    _draw_steps(steps, experiment, low, median)
    draw_lines(scores, experiment, "lam", measure, found, shown)
    figure.draw_without_rendering()
    label_ends(steps, words)
    label_ends(scores, words)
    return figure


def norms(experiment: Experiment) -> np.ndarray:
    """Return ‖f‖² on a grid of bearings and actions, ``[actions, bearings]``."""
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
    figure.colorbar(image, ax=axes, location="bottom", label="‖f‖² (1 in a table)")


def _draw_steps(axes: Axes, experiment: Experiment, low: float, median: float) -> None:
    settings = experiment.jobs[0].settings
    lams = sorted(experiment.values("lam"))
    lam = torch.linspace(lams[0], lams[-1], _GRID, dtype=torch.float64)
    decay = (settings["gamma"] * lam).clamp(max=1 - 1e-9)
    dashed = []
    for trace, (colour, _) in zip(experiment.values("trace"), LINES, strict=False):
        at_median, at_low = (
            effective_step(torch.tensor(norm), settings["alpha"], decay, trace).numpy()
            for norm in (median, low)
        )
        axes.plot(lam, at_median, color=colour, linewidth=1.4)
        dashed.append(np.stack([lam.numpy(), at_low], axis=1))
    # A collection, because `label_ends` expects a label for each of the axes' lines.
    colours = [colour for colour, _ in LINES[: len(dashed)]]
    axes.add_collection(LineCollection(dashed, colors=colours, linestyles="--", linewidths=1.4))
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
