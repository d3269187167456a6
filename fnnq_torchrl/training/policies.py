"""Loads the policy of a finished job."""

from pathlib import Path

from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.rules import RuleBase, rule_bases
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.checking import to_config
from fnnq_torchrl.training.results import best_run, read_evaluations
from fnnq_torchrl.training.weights import load_checkpoint


def load_rules(run: str | Path, seed: int | None = None, *, own: bool = False) -> RuleBase:
    """Load the rules that a finished job of ``fnnq``, ``fnnq_sum`` or ``fuzzy_q`` has learned.

    A sum of rule bases is loaded as the single rule base with the same Q.

    Args:
        run: the job's directory.
        seed: of one of its runs; if not given, the mean over all of them.
        own: as in :func:`load_policy`.

    Raises:
        OSError: the job's checkpoint.pt can't be read.
        ValueError: it is damaged, there is no such run, its value function has no rules, or as in
            :meth:`.RuleBase.from_sum`.
    """
    network = load_policy(run, seed, own=own).value_network
    config = to_config(load_checkpoint(Path(run) / "checkpoint.pt").config, own=own)
    parts = rule_bases(network, config.value, config.env)
    if not parts:
        raise ValueError(f"{run}: its value function has no rules; value=fnnq has")
    return RuleBase.from_sum(parts, network.in_keys)


def load_policy(
    run: str | Path, seed: int | None = None, *, own: bool = False
) -> EpsilonGreedyPolicy:
    """Load the greedy policy that a finished job has learned.

    Args:
        run: the job's directory.
        seed: the seed of one run. Without it, the policy has a row for each run of the job.
        own: whether to import classes from outside this package, such as a world, that the job's
            configuration names (``module:Class``). Don't set this for somebody else's job.

    Returns:
        A policy for environments of batch size ``[1]``, or ``[runs]`` without a seed.

    Raises:
        OSError: if the job's checkpoint.pt can't be read.
        ValueError: if checkpoint.pt is damaged, or the job has no run with this seed. The message
            is one line.
    """
    checkpoint = load_checkpoint(Path(run) / "checkpoint.pt")
    config = to_config(checkpoint.config, own=own)
    seeds = checkpoint.seed.tolist()
    if seed is not None and seed not in seeds:
        raise ValueError(f"{run} has no run with seed={seed}; it has {_span(seeds)}")
    rows = slice(None) if seed is None else slice(seeds.index(seed), seeds.index(seed) + 1)
    weights = {name: weight[rows] for name, weight in checkpoint.weights.items()}
    dtype = next(iter(weights.values())).dtype
    runs = len(seeds[rows])
    network = make_value_network(config.value, make_candidates(config, dtype), runs)
    network.load_state_dict(network.state_dict() | weights)
    return EpsilonGreedyPolicy(network, epsilon=0.0).requires_grad_(False)


def best_seed(run: str | Path) -> int:
    """Return the seed of a finished job's run with the best final score.

    The commands that show, play, replay or export a single run take this one by default.

    Args:
        run: the job's directory.

    Raises:
        OSError: if checkpoint.pt or evaluations.csv can't be read.
        ValueError: if one of them is damaged. The message is one line.
    """
    checkpoint = load_checkpoint(Path(run) / "checkpoint.pt")
    if len(checkpoint.seed) == 1:
        return int(checkpoint.seed[0])
    measure = to_config(checkpoint.config).env.tested.measure
    evaluations = read_evaluations(Path(run) / "evaluations.csv", measure)
    return int(evaluations.seed[best_run(evaluations)])


def _span(seeds: list[int]) -> str:
    return f"{min(seeds)} to {max(seeds)}" if len(seeds) > 1 else str(seeds[0])
