"""Labels that a job finds before it learns, and the gaps that labels leave."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import log, sqrt
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torch import Tensor

from envs.worlds import make_world
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.learning_step import act
from fnnq_torchrl.agent.policy import make_policy
from fnnq_torchrl.agent.rules import partition
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.config.values import CLUSTERED, LabelsConfig
from fnnq_torchrl.equations.membership_functions import Membership
from fnnq_torchrl.equations.names import EXPLORATIONS
from fnnq_torchrl.training.jobs import Job
from fnnq_torchrl.training.weights import load_checkpoint

Choice = Callable[[TensorDictBase], TensorDictBase]
"""Sets the action of every lane."""

_LEAST = 0.1
"""A mixture's components are no narrower than this share of the distance to a neighbour."""


def with_found_labels(jobs: Sequence[Job]) -> Sequence[Job]:
    """The jobs of a batch with the labels that clustering finds, where they ask for that.

    The states are the same whatever the jobs' seeds are, and so are the labels. In the resulting
    configurations they stand as if given by hand.

    Raises:
        ConfigError: scikit-learn isn't installed, there are fewer different states than labels, or
            the job that they come from has other observations, or is damaged.
        OSError: that job's checkpoint.pt can't be read.
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
    """The states of ``value.warm_up`` situations, by the observations' names, each ``[states]``.

    The play is random or, with ``value.visited``, that of another job's runs, as they explored
    while learning.

    Raises:
        ConfigError, OSError: as of :func:`with_found_labels`.
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
    """What the runs of a finished job do, one after the other in as many lanes."""
    try:
        checkpoint = load_checkpoint(directory / "checkpoint.pt")
        theirs = to_config(checkpoint.config)
    except ValueError as error:
        raise ConfigError(f"value.visited={directory}: {error}") from error
    network = make_value_network(theirs.value, make_candidates(theirs), runs=1)
    if unknown := [name for name in network.in_keys if name not in config.env.observations]:
        raise ConfigError(
            f"value.visited={directory}: its runs observe {unknown[0]}, which {config.env.kind} "
            "doesn't offer"
        )
    run = torch.arange(lanes) % len(checkpoint.seed)
    weights = {name: weight[run].float() for name, weight in checkpoint.weights.items()}
    exploring: float = getattr(theirs, EXPLORATIONS[theirs.exploration])
    policy = make_policy(theirs.exploration, network, exploring)
    amount = torch.full((lanes, 1), exploring)
    return lambda state: act(policy, weights, amount, state)


def find_labels(
    name: str, states: NDArray[np.float64], count: int, clustering: str
) -> list[Membership]:
    """Gaussian labels at the clusters of one observation's values, rising.

    With k-means neighbours have the same membership, ½, halfway between them, if they are evenly
    spaced; with a mixture of Gaussians the widths are those of its components.

    Args:
        name: the observation's, for messages.
        states: its values, ``[states]``.
        count: how many labels there are to be.
        clustering: ``kmeans`` or ``mixture``.

    Raises:
        ConfigError: scikit-learn isn't installed, or there are fewer different values.
    """
    try:  # which only few need
        from sklearn.cluster import KMeans
        from sklearn.mixture import GaussianMixture
    except ImportError as error:
        raise ConfigError(
            "value.membership=clustered: needs scikit-learn; pip install 'fnnq_torchrl[clusters]'"
        ) from error
    if (different := len(np.unique(states))) < count:
        raise ConfigError(
            f"value.labels_of_input={count}: must be at most {different}, as many different values "
            f"as {name} had in the states that were visited"
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
    # Rounded, since the last bits depend on the number of threads.
    pairs = zip(centres.tolist(), widths.tolist(), strict=True)
    return [("gaussian", (_rounded(centre), _rounded(width))) for centre, width in pairs]


def _spacing(
    centres: NDArray[np.float64],
    states: NDArray[np.float64],
    of_both: Callable[[NDArray[np.float64]], np.float64],
) -> NDArray[np.float64]:
    """The distance of each centre from its neighbours; of a single one, twice the spread."""
    if len(centres) == 1:
        return np.array([2 * states.std()])
    gaps = np.diff(centres)
    return np.array([of_both(gaps[max(i - 1, 0) : i + 1]) for i in range(len(centres))])


def _rounded(number: float) -> float:
    return float(f"{number:.6g}")


def gaps_in_words(config: Config) -> str | None:
    """One line on the parts of the ranges where no label fires; None if there are none."""
    if not isinstance(config.value, LabelsConfig):
        return None
    told = []
    for variable in partition(config.value, config.env):
        for low, high in variable.gaps():
            told.append(f"{variable.name} {low:g}" + (f" to {high:g}" if low < high else ""))
    if not told:
        return None
    nearest = config.value.elsewhere == "nearest"
    fires = "the nearest label does" if nearest else "the value is 0"
    return f"no label fires at {', '.join(told)}: there {fires} (value.elsewhere)"
