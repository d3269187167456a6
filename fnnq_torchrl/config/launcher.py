"""The schema of the launcher, which runs the jobs of a sweep."""

from dataclasses import dataclass

from envs.core.parameters import Parameters, matching, number, one_of, whole


@dataclass
class LauncherConfig(Parameters):
    """The settings of the launcher, explained in ``conf/hydra/launcher/batch.yaml``."""

    max_batch_size: int = whole(1)
    pictures_up_to: int = whole(0)
    cluster: str = one_of("none", "local", "slurm")
    partition: str = matching(r"[\w,-]*", "the name of a partition, or several with commas")
    time_min: int = whole(1)
    memory_gb: float = number(above=0)
    cpus: int = whole(1)
    gpus: int = whole(0)
