"""Result files of experiments that were never run, for figures and the reproduction's page."""

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
from omegaconf import OmegaConf

from fnnq_torchrl.compose import load_config
from fnnq_torchrl.config import Config, to_config
from fnnq_torchrl.results import Evaluations, Outcome, summarise, write_evaluations, write_summary

Level = Callable[[Config], float]
"""The score at which a job's runs end up, of 5."""


@cache
def _default() -> Config:
    return load_config()


def invented(config: Config, level: float) -> Evaluations:
    """Runs that rise to a level of score, each with chances of its own."""
    evaluations = config.situations // config.evaluation.every + 1
    rng = np.random.default_rng([config.num_seeds, int(1000 * level)])
    progress = 1 - np.exp(-np.arange(evaluations) / 4)
    own = rng.normal(0, 0.05, size=(config.num_seeds, 1))
    chance = np.clip(level / 5 + own, 0, 1) * progress
    catches = rng.binomial(len(config.evaluation.situations), chance)
    return Evaluations(
        seed=np.arange(config.num_seeds),
        lam=np.full(config.num_seeds, float(config.lam)),
        situations=config.evaluation.every * np.arange(evaluations),
        steps=60 * config.evaluation.every * np.tile(np.arange(evaluations), (config.num_seeds, 1)),
        catches=catches,
    )


def write_experiment(
    sweep: Path, jobs: list[tuple[str, ...]], level: Level, runs: int = 22
) -> None:
    """A sweep's directory with a job for each tuple of overrides."""
    for number, overrides in enumerate(jobs):
        node = OmegaConf.create(asdict(_default()) | {"num_seeds": runs})
        node.merge_with_dotlist(list(overrides))
        config = to_config(node)
        directory = sweep / str(number)
        (directory / ".hydra").mkdir(parents=True)
        OmegaConf.save(OmegaConf.create(asdict(config)), directory / ".hydra" / "config.yaml")
        evaluations = invented(config, level(config))
        write_evaluations(directory / "evaluations.csv", evaluations)
        outcome = Outcome(
            **vars(evaluations), train_seconds=1.0, compile_seconds=0.0, evaluate_seconds=1.0
        )
        write_summary(directory / "summary.json", summarise(outcome))


def grid(values: Mapping[str, str], *common: str) -> list[tuple[str, ...]]:
    """All combinations of the keys' values, which are separated by commas."""
    sweeps = [[f"{key}={value}" for value in text.split(",")] for key, text in values.items()]
    return [(*common, *job) for job in product(*sweeps)]


LAMS = "0,0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.8,0.9,1"
EXPERIMENTS = {
    "fig2": grid({"lam": "0,0.1,0.4,0.8"}),
    "fig3": grid({"lam": "0,0.2"}),
    "traces": grid({"trace": "output,gradient", "lam": LAMS}),
    "decay": grid({"alpha": "0.1,0.4", "alpha_decay": "0.9,0.97,0.99,0.997,1"}),
    "exploration": [
        *grid({"epsilon": "0,0.1,0.3"}, "exploration=epsilon_greedy"),
        *grid({"temperature": "0.01,0.1"}, "exploration=boltzmann"),
        *grid({"noise_std": "0.1,1"}, "exploration=noise"),
    ],
    "variants": [
        *grid({"variant": "peng,watkins,naive", "trace": "output,replacing", "lam": "0.2,0.8"}),
        *grid({"window": "1,5", "lam": "0.2,0.8"}, "trace=window"),
    ],
    "open_choices": [
        *grid({"lam": "0,0.2"}),
        *grid({"env.speed_mps": "0.2,0.4", "lam": "0,0.2"}),
        *grid({"env.bearing_noise_rad": "0,0.05", "lam": "0,0.2"}),
        *grid({"action.candidates": "5,101", "lam": "0,0.2"}),
        *grid({"value.width": "variance", "lam": "0,0.2"}),
        *grid({"trace": "gradient", "lam": "0,0.2"}),
        *grid({"alpha_decay": "0.97,1", "lam": "0,0.2"}),
    ],
}
EXPERIMENTS |= {
    "fig2_large": EXPERIMENTS["fig2"],
    "fig3_large": EXPERIMENTS["fig3"],
    "decay_large": grid({"alpha_decay": "0.9,0.97,0.99,0.997,1"}),
}


def paper_level(config: Config) -> float:
    """As the paper has it: λ = 0.2 is best, and the more beyond it, the worse."""
    lam = config.lam if config.trace == "output" else -0.2 * config.lam
    return 4.5 - 4 * abs(lam - 0.2) + 0.5 * (config.lam <= 0.1 and config.trace == "output")
