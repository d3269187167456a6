"""All figures of experiments by name, and the function that writes their files."""

from collections.abc import Callable, Mapping
from pathlib import Path

from envs.pictures import Figure, own_style
from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.figures.curves import experiment_curves_figure
from fnnq_torchrl.studies.figures.job_words import change_words
from fnnq_torchrl.training.pictures.style import save

from .chain import chain_figure
from .dots import dots_figure
from .lines import lines_figure
from .readings import readings_figure

Draw = Callable[[Experiment], Figure]


def _sensitivity(results: Experiment, trace: str) -> Figure:
    return lines_figure(
        results.where("trace", trace), "epsilon", "lam", ["mean_score"], panels="variant"
    )


FIGURES: dict[str, tuple[str, Draw]] = {
    "fig2": ("fig2", lambda results: experiment_curves_figure(results, "lam")),
    "fig3": ("fig3", lambda results: experiment_curves_figure(results, "lam")),
    "traces": (
        "traces",
        lambda results: lines_figure(results, "lam", "trace", ["mean_score", "final_score"]),
    ),
    "readings": ("traces", readings_figure),
    "decay": (
        "decay",
        lambda results: lines_figure(
            results, "alpha_decay", "alpha", ["final_score", "forgetting"]
        ),
    ),
    "adaptive": (
        "adaptive",
        lambda results: lines_figure(results, "alpha", "step_size", ["mean_score"], "lam"),
    ),
    "step_sizes": (
        "step_sizes",
        lambda results: lines_figure(
            results.where("variant", "peng"), "alpha", "step_size", ["mean_score"], "lam"
        ),
    ),
    "stability": (
        "stability",
        lambda results: lines_figure(
            results, "alpha", "step_size", ["mean_score"], "value.layer_norm"
        ),
    ),
    "exploration": ("exploration", lambda results: dots_figure(results, "mean_score")),
    "variants": ("variants", lambda results: dots_figure(results, "mean_score", "lam")),
    "open_choices": (
        "open_choices",
        lambda results: dots_figure(results, "mean_score", "lam", change_words),
    ),
    "sensitivity": ("sensitivity", lambda results: _sensitivity(results, "output")),
    "sensitivity_gradient": ("sensitivity", lambda results: _sensitivity(results, "gradient")),
    "best_exploration": (
        "best_exploration",
        lambda results: dots_figure(results, "mean_score"),
    ),
    "chain": ("chain", chain_figure),
}
"""Each figure by its file name: the experiment that it shows, and the function that draws it."""


@own_style()
def draw(experiments: Mapping[str, Experiment], pictures: Path) -> list[Path]:
    """Draw figures as PNG and SVG.

    Args:
        experiments: the experiment to draw for each figure, by the figures' names.
        pictures: the directory to write to; it is made if it doesn't exist.

    Returns:
        The files written.

    Raises:
        NoResults: if an experiment lacks a job.
        OSError: if a file can't be written.
    """
    pictures.mkdir(parents=True, exist_ok=True)
    written = []
    for name, experiment in experiments.items():
        figure = FIGURES[name][1](experiment)
        for suffix in (".png", ".svg"):
            save(figure, (pictures / name).with_suffix(suffix))
            written.append((pictures / name).with_suffix(suffix))
    return written
