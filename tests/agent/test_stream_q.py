"""Learning with running normalisation of observations and scaling of rewards."""

from copy import deepcopy
from itertools import islice
from statistics import mean, variance

import pytest
import torch
from tensordict import TensorDictBase

from envs import make_world
from fnnq_torchrl.agent.values import MLPValue
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.engine.lanes import LANES
from fnnq_torchrl.engine.native import NativeLoop
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.evaluation import GreedyTest
from fnnq_torchrl.training.trainer import Trainer
from tests.compositions import config_of
from tests.oracles.stream_q import stream_q
from tests.programs import advance, in_lanes, make_learner, make_runs

STEPS = 60


def stream(*overrides: str) -> Config:
    """Return the configuration of a small Stream Q(λ) with episodes of at most 12 steps."""
    return config_of(
        *("task=cart_pole", "env=cart_pole_gymnasium", "env.time_limit_steps=12"),
        *("value=mlp", "value.widths=[6,5]", "value.layer_norm=true", "value.sparsity=0.5"),
        *("value.activation=leaky_relu", "value.outputs=each", "value.normalise=true"),
        *("scale_rewards=true", "step_size=obgd", "variant=watkins", "trace=gradient"),
        *("lam=0.8", "gamma=0.9", "epsilon=0.2", "machine.dtype=float64", *overrides),
    )


@torch.no_grad()
def test_it_is_the_twin_that_keeps_all_observations() -> None:
    settings, seed = stream("env.largest_angle_rad=0.06"), 3
    run = make_runs(settings, 1, seed=seed)
    learner = make_learner(settings, run)
    state = learner.begin(run)
    env = make_world(settings.env, [1], seed=seed, dtype=torch.float64)
    names = [name for name, _ in learner.loss.value_network.named_parameters()]
    first = {name: state["weights", name][0].clone() for name in names}
    numbers = {key: settings.of_run(key) for key in ("alpha", "kappa", "gamma", "lam", "epsilon")}
    ends = set()
    with torch.enable_grad():
        twin = stream_q(env, first, numbers=numbers)
        for layers, rows, sums in islice(twin, STEPS):
            with torch.no_grad():
                world = state["world"]
                state = learner.step(run, state)
            if state["situations"] > len(ends):
                ends.add(int(world["step"]))
            for name, expected in zip(_in_layers(names), layers, strict=True):
                torch.testing.assert_close(
                    state["weights", name][0], expected.detach(), rtol=1e-8, atol=1e-10
                )
            assert state["weights", "seen_samples"][0].tolist() == [len(rows)] * 4
            columns = [*zip(*rows, strict=True)]
            assert state["weights", "seen_mean"][0].tolist() == pytest.approx([*map(mean, columns)])
            assert state["reward_scale", "trace"].item() == pytest.approx(sums[-1])
            squares = variance(sums) * (len(sums) - 1) if len(sums) > 1 else 0
            assert state["reward_scale", "squares"].item() == pytest.approx(squares)
    assert len(ends) > 1  # falls and truncations


def _in_layers(names: list[str]) -> list[str]:
    return sorted(names, key=lambda name: (name.rpartition("_")[2], name.startswith("bias")))


@pytest.mark.usefixtures("compiler")
@torch.no_grad()
def test_compiled_it_is_the_eager_learner_and_a_run_alone_is_the_run_in_a_batch() -> None:
    settings = stream()
    runs = make_runs(settings, LANES + 20)
    many = in_lanes(runs)
    learner = make_learner(settings, many)
    loop = NativeLoop(
        lambda lanes: make_learner(settings, many[:lanes]).step, many, learner.begin(many)
    )
    running = loop(many, learner.begin(many))
    running.advance(STEPS)
    compiled, eager = running.state, advance(learner, many, STEPS)
    for (key, found), expected in zip(
        sorted(compiled.flatten_keys("/").items()),
        [eager.flatten_keys("/")[key] for key in sorted(compiled.flatten_keys("/").keys())],
        strict=True,
    ):
        torch.testing.assert_close(found, expected, rtol=1e-7, atol=1e-9, msg=key)
    alone = in_lanes(runs[40:41])
    for engine in (loop, None):
        state = learner_state(engine, settings, alone)
        together = compiled if engine else eager
        for name, weight in state["weights"].items():
            assert torch.equal(weight[0], together["weights", name][40]), name


def learner_state(loop, settings: Config, runs):
    learner = make_learner(settings, runs)
    if loop is None:
        return advance(learner, runs, STEPS)
    running = loop(runs, learner.begin(runs))
    running.advance(STEPS)
    return running.state


@torch.no_grad()
def test_a_test_uses_the_statistics_of_the_snapshot_and_leaves_them_alone() -> None:
    trainer = Trainer.of(stream("situations=4", "evaluation.every=2", "evaluation.situations=3"))
    trainer.learn()
    pages = trainer.ledger.book.pages["weights"].clone()
    trainer.evaluate()
    assert (trainer.ledger.book.pages["weights"] == pages).all()
    counts = pages["seen_samples"][:, 0, 0].tolist()
    steps = trainer.ledger.book.pages["steps"][:, 0].tolist()
    # An observation for each step, and one for the start of each situation, also of the next.
    assert counts == [0, steps[1] + 3, steps[2] + 5]
    test = GreedyTest(trainer.config.env, trainer._value_network(1), 3)
    env, page = test.make_env(1), pages[2]
    state = env.reset()
    raw = torch.cat([state[key] for key in env.seen], -1)
    spread = page["seen_squares"] / (page["seen_samples"] - 1)
    by_hand = (raw - page["seen_mean"]) / (spread + 1e-8).sqrt()
    plain = MLPValue(
        env.seen,
        test.network.candidates,
        widths=[6, 5],
        activation="leaky_relu",
        layer_norm=True,
        outputs="each",
    )
    plain.load_state_dict({k: w for k, w in page.items() if "seen" not in k}, strict=False)
    test.network.load_state_dict({**page}, strict=False)
    torch.testing.assert_close(test.network.values_in(state), plain(*by_hand.split(1, -1)))


class Interruption:
    """A keeper that saves the ledger at its third visit and ends the training there."""

    def __init__(self, trainer: Trainer) -> None:
        self.trainer, self.visits = trainer, 0

    def visit(self, worker: int, jobs: torch.Tensor, state: TensorDictBase) -> None:
        self.visits += 1
        if self.visits == 3:
            self.saved = deepcopy(self.trainer.ledger.state_dict([(jobs, state)]))
            raise InterruptedError


def test_an_interrupted_training_comes_to_the_same_end() -> None:
    settings = stream("situations=9", "evaluation.every=3", "num_seeds=32", "engine=eager")
    whole, first, again = (Trainer.of(settings) for _ in range(3))
    whole.learn()
    keeper = Interruption(first)
    with pytest.raises(InterruptedError):
        first.learn(keeper=keeper)
    again.ledger.load_state_dict(keeper.saved, torch.arange(32))
    assert 0 < int(again.ledger.learned.sum()) < 9 * 32
    again.learn()
    assert (again.ledger.book.pages == whole.ledger.book.pages).all()


@torch.no_grad()
def test_scores_are_of_the_worlds_rewards() -> None:
    trainer = Trainer.of(stream("evaluation=none", "situations=4", "evaluation.every=2"))
    trainer.learn()
    outcome = trainer.evaluate()
    assert outcome.returns[:, 1:].tolist() == outcome.lengths[:, 1:].tolist()  # +1 a step


def test_noise_needs_values_between_the_candidates() -> None:
    noisy = ("value=mlp", "value.outputs=each", "exploration=noise")
    with pytest.raises(ConfigError, match="exploration=noise: must be epsilon_greedy or boltzmann"):
        load_config(*noisy)
    with pytest.raises(ValueError, match="outputs='two': must be one or each"):
        MLPValue(["x"], torch.zeros(2), widths=[2], activation="relu", outputs="two")
