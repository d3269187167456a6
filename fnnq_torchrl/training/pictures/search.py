"""Optuna's figures of a search."""

import warnings
from pathlib import Path

import numpy as np
from optuna import Study

from envs.pictures import own_style

from .style import save

# After envs.pictures, which copes with settings that make the import of Matplotlib fail.
import matplotlib  # isort: skip
from optuna.visualization import matplotlib as plots  # isort: skip

matplotlib.use("agg")  # Optuna draws with pyplot, which would load the user's backend


@own_style()
def search_picture(study: Study, name: str, picture: Path) -> None:
    """Draw one of Optuna's figures.

    Args:
        study: the search, with at least one finished trial.
        name: the name of the figure, as in Optuna's ``plot_<name>``.
        picture: the file to write, atomically; its suffix gives the format.

    Raises:
        OSError: if the file can't be written.
        ValueError: if Optuna can't draw the figure, for example from a single trial.
    """
    from matplotlib import pyplot

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Optuna's warnings, none of which is about the file
        axes = np.ravel(getattr(plots, f"plot_{name}")(study))
    figure = axes[0].figure
    try:
        save(figure, picture)
    finally:
        pyplot.close(figure)
