from collections.abc import Callable

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor

from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.config.schema import Config
from fnnq_torchrl.engine.choice import make_engine
from fnnq_torchrl.engine.scheduler import work_through
from fnnq_torchrl.training.evaluation import FIRST_EPISODE, GreedyTest, Playing, no_results
from tests.compositions import config_of
from tests.oracles import peng
from tests.oracles.follow_ball import FollowBallTwin
from tests.oracles.fuzzy import action_value
from tests.programs import config

CANDIDATES = torch.linspace(-1, 1, 21, dtype=torch.float64)
EVALUATIONS, RUNS = 3, 4
FIRST_SEED = 100


def play(
    settings: Config,
    weights: Tensor,
    *,
    first_seed: int = FIRST_SEED,
    network: ValueNetwork | None = None,
    lanes: int = 64,
    on_progress: Callable[[int], None] = lambda played: None,
) -> Tensor:
    """Return the catches ``[evaluations, runs]`` of weights ``[evaluations, runs, 5, 4]``."""
    evaluations, runs = weights.shape[:2]
    situations = torch.tensor(settings.evaluation.situations, dtype=torch.float64)
    seeds = torch.arange(first_seed, first_seed + runs)
    network = network or make_value_network(settings.value, CANDIDATES, runs=1)
    results = no_results(evaluations, runs, len(situations), torch.float64)
    with torch.no_grad():
        playing = Playing(
            GreedyTest(settings.env, network, situations),
            seed=seeds.unsqueeze(-1),
            weights=TensorDict({"weight": weights}, [evaluations, runs]),
            results=results,
            engine=make_engine("eager", torch.device("cpu")),
            lanes=lanes,
            on_progress=on_progress,
        )
    work_through(playing, playing.jobs, lanes, workers=1)
    return results["success"].sum(-1)


def test_evaluations_draw_where_learning_never_comes() -> None:
    # streams.draw takes episodes below 2³³. No run comes to learn from 2³² situations.
    assert 2**32 <= FIRST_EPISODE < 2**33 - 2**30


@pytest.fixture
def weights() -> Tensor:
    """Return random weights for all evaluations of all runs."""
    generator = torch.Generator().manual_seed(4)
    weights = torch.randn(EVALUATIONS, RUNS, 5, 4, generator=generator).double()
    weights[0, 3] = 0
    weights[1, 1] = followers_weights()
    return weights


def followers_weights() -> Tensor:
    """Return weights that steer towards the ball: left (Δv < 0) if it is on the left."""
    wanted = torch.tensor([1.0, 0.5, 0.0, -0.5, -1.0]).double()
    actions = torch.tensor([-1.0, -0.4, 0.4, 1.0]).double()
    return -(wanted.unsqueeze(1) - actions).square()


def is_caught(
    settings: Config, weights: list[float], seed: int, episode: int, situation: tuple[float, float]
) -> bool:
    """Return True for a catch in one situation, played step by step in plain Python."""
    labels = [settings.value.inputs["bearing"], settings.value.action]
    world = FollowBallTwin(settings.env, seed, episode, situation)
    over = False
    while not over:
        points = [(world.bearing, action) for action in CANDIDATES.tolist()]
        values = [action_value(weights, point, labels) for point in points]
        action = CANDIDATES[peng.epsilon_greedy(values, 0.0, world.chance)].item()
        reward, over = world.move(action)
    return reward > 0


def test_counts_what_playing_one_situation_after_the_other_catches(weights: Tensor) -> None:
    settings = config()
    situations = settings.evaluation.situations
    counts = []
    for evaluation in range(EVALUATIONS):
        first = FIRST_EPISODE + evaluation * len(situations)
        for run in range(RUNS):
            flat, seed = weights[evaluation, run].flatten().tolist(), FIRST_SEED + run
            episodes = enumerate(situations, first)
            counts.append(
                sum(is_caught(settings, flat, seed, episode, start) for episode, start in episodes)
            )
    assert play(settings, weights).flatten().tolist() == counts
    assert len(set(counts)) >= 4


def test_a_rule_base_that_steers_towards_the_ball_catches_it_always() -> None:
    untrained = torch.zeros(5, 4).double()
    weights = torch.stack([followers_weights(), -followers_weights(), untrained])
    [catches] = play(config_of(), weights.unsqueeze(0))
    assert catches.dtype == torch.int64
    assert catches.tolist()[:2] == [5, 0]
    assert catches[2] <= 1


@pytest.mark.parametrize(("time_limit", "catches"), [(11, 1), (10, 0)])
def test_a_catch_in_the_last_step_counts_and_none_after_it(time_limit: int, catches: int) -> None:
    # The robot drives straight ahead, 0.03 m a step, and a ball at 0.5 m rolls by. After step 11
    # the ball is at (0.166, 0.066) m, nearer than 0.2 m. After step 10 it is at (0.196, 0.060) m,
    # which is still farther.
    settings = config(f"env.time_limit_steps={time_limit}", "evaluation.situations=[[0,0.12]]")
    straight = torch.tensor([-1.0, 1.0, 1.0, -1.0]).double().expand(1, 1, 5, 4)
    assert play(settings, straight).tolist() == [[catches]]


def test_a_run_together_with_others_scores_as_alone(weights: Tensor) -> None:
    alone = [
        play(config(), weights[:, run : run + 1], first_seed=FIRST_SEED + run)
        for run in range(RUNS)
    ]
    assert torch.equal(play(config(), weights), torch.cat(alone, dim=1))


def test_the_lanes_do_not_matter(weights: Tensor) -> None:
    many = weights.repeat(1, 8, 1, 1)
    some, more, all_at_once = (play(config(), many, lanes=lanes) for lanes in (64, 96, 480))
    assert torch.equal(some, all_at_once)
    assert torch.equal(more, all_at_once)


def test_it_tells_how_far_it_is(weights: Tensor) -> None:
    progress: list[int] = []
    play(config(), weights, lanes=32, on_progress=progress.append)
    assert len(progress) > 1
    assert progress == sorted(progress)
    assert progress[-1] == 5 * EVALUATIONS * RUNS


def test_every_evaluation_and_every_seed_has_random_numbers_of_its_own() -> None:
    tied = torch.zeros(2, 200, 5, 4).double()  # all candidates are tied, so chance alone decides
    catches, again, other_seeds = (
        play(config(), tied, first_seed=first, lanes=2016) for first in (0, 0, 1000)
    )
    assert torch.equal(catches, again)
    assert not torch.equal(catches[0], catches[1])
    assert not torch.equal(catches, other_seeds)


def test_it_changes_no_weights_and_draws_no_global_random_numbers(weights: Tensor) -> None:
    network = make_value_network(config().value, CANDIDATES, runs=1)
    kept, generator = weights.clone(), torch.get_rng_state()
    play(config(), weights, network=network)
    assert torch.equal(weights, kept)
    assert (network.weight == 0).all()
    assert torch.equal(torch.get_rng_state(), generator)
