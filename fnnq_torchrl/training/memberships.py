"""Labels found by clustering before a job learns, and gaps between labels."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import log, sqrt
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from envs.core.registry import is_own
from envs.worlds import make_world
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import make_policy
from fnnq_torchrl.agent.rules import partition
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.extras import installing
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.config.values import CLUSTERED, LabelsConfig
from fnnq_torchrl.equations.membership_functions import Membership
from fnnq_torchrl.equations.names import EXPLORATIONS
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.weights import load_checkpoint

Choice = Callable[[TensorDictBase], TensorDictBase]
"""A function that sets the actions of a batch of states."""

_LEAST = 0.1
"""The least width of a mixture's component, as a share of the distance to its nearest neighbour."""


def with_found_labels(jobs: Sequence[Job]) -> Sequence[Job]:
    """Return the jobs of a batch, with found labels if ``value.membership`` is ``clustered``.

    The visited states and the labels don't depend on the jobs' seeds. The new configurations
    contain the labels as if a user had given them.

    Raises:
        ConfigError: if scikit-learn isn't installed, if there are fewer different states than
            labels, or if the job of ``value.visited`` has other observations or is damaged.
        OSError: if the checkpoint.pt of the job of ``value.visited`` can't be read.
    """
    config = jobs[0].config
    value = config.value
    if not isinstance(value, LabelsConfig) or value.membership != CLUSTERED:
        return jobs
    states = visited_states(config)
    names = states if value.inputs is None else value.inputs
    found = {
        name: find_labels(name, states[name], value.labels_of_input, value.clustering)
        for name in names
    }
    known = value.found(found, config.env)
    return [replace(job, config=replace(job.config, value=known)) for job in jobs]


@torch.no_grad()
def visited_states(config: Config) -> dict[str, NDArray[np.float64]]:
    """Return the states visited in ``value.warm_up`` situations.

    The actions are random. With ``value.visited``, they are instead those of another job's learned
    runs, with that job's exploration.

    Returns:
        The values ``[states]`` of each observation, by its name.

    Raises:
        ConfigError, OSError: as in :func:`with_found_labels`.
    """
    lanes, visited = config.value.warm_up, config.value.visited
    choose = _random(config) if visited is None else _as(Path(visited), config, lanes)
    world = config.env
    env = make_world(world, [lanes], dtype=torch.float32)
    number = torch.arange(lanes).unsqueeze(-1)
    state = env.start(torch.zeros_like(number), number)
    goes_on = torch.ones(lanes, dtype=torch.bool)
    seen: dict[str, list[Tensor]] = {name: [] for name in world.observations}
    for _ in range(world.time_limit_steps):
        for name, values in seen.items():
            values.append(state[name].squeeze(-1)[goes_on])
        after = env.step(choose(state))["next"]
        goes_on = goes_on & ~after["done"].squeeze(-1)
        if not goes_on.any():
            break
        state = after.select(*state.keys(), strict=False)
    return {name: torch.cat(values).double().numpy() for name, values in seen.items()}


def _random(config: Config) -> Choice:
    candidates, generator = make_candidates(config), torch.Generator().manual_seed(0)

    def choose(state: TensorDictBase) -> TensorDictBase:
        drawn = torch.randint(len(candidates), (len(state), 1), generator=generator)
        return state.copy().set("action", candidates[drawn])

    return choose


def _as(directory: Path, config: Config, lanes: int) -> Choice:
    """Return the exploring policy of a finished job; batch element i takes its run i mod runs."""
    try:
        checkpoint = load_checkpoint(directory / "checkpoint.pt")
        theirs = to_config(checkpoint.config)
    except ValueError as error:
        raise ConfigError(f"value.visited={directory}: {error}") from error
    if is_own(theirs.exploration):
        named = f"exploration={theirs.exploration} names code from outside fnnq_torchrl"
        raise ConfigError(f"value.visited={directory}: {named}")
    network = make_value_network(theirs.value, make_candidates(theirs), runs=1)
    if unknown := [name for name in network.in_keys if name not in config.env.observations]:
        raise ConfigError(
            f"value.visited={directory}: its runs observe {unknown[0]}, but {config.env.kind} "
            "has no such observation"
        )
    run = torch.arange(lanes) % len(checkpoint.seed)
    weights = {name: weight[run].float() for name, weight in checkpoint.weights.items()}
    exploring: float = getattr(theirs, EXPLORATIONS[theirs.exploration])
    policy = make_policy(theirs.exploration, network, exploring)
    amount = torch.full((lanes, 1), exploring, dtype=torch.float32)
    return lambda state: act(policy, weights, amount, state)


def find_labels(
    name: str, states: NDArray[np.float64], count: int, clustering: str
) -> list[Membership]:
    """Return Gaussian labels at the clusters of one observation's values, by rising centre.

    The widths with ``kmeans`` follow from the mean distance to the neighbours: evenly spaced
    neighbours have membership ½ halfway between their centres. The widths with ``mixture`` are the
    components' standard deviations.

    Args:
        name: the observation's name, for messages.
        states: the observation's values, ``[states]``.
        count: the number of labels.
        clustering: ``kmeans`` or ``mixture``.

    Raises:
        ConfigError: if scikit-learn isn't installed, or there are fewer different values than
            ``count``.
    """
    try:  # an optional dependency
        from sklearn.cluster import KMeans
        from sklearn.mixture import GaussianMixture
    except ImportError as error:
        raise ConfigError(
            f"value.membership=clustered: needs scikit-learn; {installing('clusters')}"
        ) from error
    if (different := len(np.unique(states))) < count:
        raise ConfigError(
            f"value.labels_of_input={count}: must be at most {different}, the number of different "
            f"values of {name} in the visited states"
        )
    column = states.reshape(-1, 1)
    if clustering == "kmeans":
        found = KMeans(count, n_init=10, random_state=0).fit(column)
        centres = np.sort(found.cluster_centers_[:, 0])
        widths = _spacing(centres, states, np.mean) / sqrt(8 * log(2))
    else:
        mixture = GaussianMixture(count, n_init=3, random_state=0).fit(column)
        order = np.argsort(mixture.means_[:, 0])
        centres = mixture.means_[order, 0]
        widths = np.sqrt(mixture.covariances_[order, 0, 0])
        widths = np.maximum(widths, _LEAST * _spacing(centres, states, np.min))
    # The numbers are rounded because their last bits depend on the number of threads.
    pairs = zip(centres.tolist(), widths.tolist(), strict=True)
    return [("gaussian", (_rounded(centre), _rounded(width))) for centre, width in pairs]


def _spacing(
    centres: NDArray[np.float64],
    states: NDArray[np.float64],
    of_both: Callable[[NDArray[np.float64]], np.float64],
) -> NDArray[np.float64]:
    """Return each centre's mean or least distance to its neighbours.

    A single centre gets twice the standard deviation of the states.
    """
    if len(centres) == 1:
        return np.array([2 * states.std()])
    gaps = np.diff(centres)
    return np.array([of_both(gaps[max(i - 1, 0) : i + 1]) for i in range(len(centres))])


def _rounded(number: float) -> float:
    return float(f"{number:.6g}")


def gaps_in_words(config: Config) -> str | None:
    """Return a line that lists the ranges in which no label fires; None if there are none."""
    if not isinstance(config.value, LabelsConfig):
        return None
    told = []
    for variable in partition(config.value, config.env):
        for low, high in variable.gaps():
            told.append(f"{variable.name} {low:g}" + (f" to {high:g}" if low < high else ""))
    if not told:
        return None
    nearest = config.value.elsewhere == "nearest"
    fires = "the nearest label fires" if nearest else "the value is 0"
    return f"no label fires at {', '.join(told)}: there {fires} (value.elsewhere)"
