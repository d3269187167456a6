"""The schema of the settings of ``hydra/sweeper=optuna``, which searches for the best values."""

from dataclasses import dataclass

from envs.core.parameters import Parameters, matching, one_of, whole

SAMPLERS = ("tpe", "random", "grid", "cmaes")


@dataclass
class SearchConfig(Parameters):
    """The settings of the search, explained in ``conf/hydra/sweeper/optuna.yaml``."""

    n_trials: int = whole(1)
    n_jobs: int = whole(1)
    sampler: str = one_of(*SAMPLERS)
    seed: int = whole(0)
    direction: str = one_of("maximize", "minimize")
    storage: str = matching(r"(\w[\w+]*:.+)?", "the URL of a database, as sqlite:///search.db")
    study_name: str = matching(r".{1,200}", "1 to 200 characters")
