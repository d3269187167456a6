import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl.compose import load_config
from fnnq_torchrl.config import Config
from fnnq_torchrl.evaluation import FIRST_EPISODE, Evaluation
from fnnq_torchrl.policy import EpsilonGreedyPolicy
from fnnq_torchrl.values import make_value_network

from .oracles import peng
from .oracles.follow_ball import FollowBallTwin
from .oracles.fuzzy import action_value
from .programs import config

CANDIDATES = torch.linspace(-1, 1, 21, dtype=torch.float64)


def make_evaluation(settings: Config) -> Evaluation:
    network = make_value_network(settings.value, CANDIDATES, runs=1)
    policy = EpsilonGreedyPolicy(network, epsilon=1.0)
    situations = torch.tensor(settings.evaluation.situations, dtype=torch.float64)
    return Evaluation(policy, settings.env, situations)


def make_snapshots(weights: torch.Tensor) -> TensorDict:
    count = len(weights)
    return TensorDict(
        {
            "weights": {"weight": weights},
            "seed": torch.arange(count).unsqueeze(-1) % 4 + 100,
            "evaluation": torch.arange(count).unsqueeze(-1) // 4,
        },
        batch_size=[count],
    )


@pytest.fixture
def snapshots() -> TensorDict:
    weights = torch.randn(12, 5, 4, generator=torch.Generator().manual_seed(4)).double()
    weights[3] = 0
    weights[5] = followers_weights()
    return make_snapshots(weights)


def followers_weights() -> torch.Tensor:
    """The further left the ball is, the better are actions that turn left (Δv < 0)."""
    wanted = torch.tensor([1.0, 0.5, 0.0, -0.5, -1.0]).double()
    actions = torch.tensor([-1.0, -0.4, 0.4, 1.0]).double()
    return -(wanted.unsqueeze(1) - actions).square()


def is_caught(
    settings: Config, weights: list[float], seed: int, episode: int, situation: tuple[float, float]
) -> bool:
    """One situation, one step after the other, in plain Python."""
    labels = [settings.value.inputs["bearing"], settings.value.action]
    world = FollowBallTwin(settings.env, seed, episode, situation)
    over = False
    while not over:
        points = [(world.bearing, action) for action in CANDIDATES.tolist()]
        values = [action_value(weights, point, labels) for point in points]
        action = CANDIDATES[peng.epsilon_greedy(values, 0.0, world.chance)].item()
        reward, over = world.move(action)
    return reward > 0


def test_counts_what_playing_one_situation_after_the_other_catches(snapshots: TensorDict) -> None:
    settings = config()
    situations = settings.evaluation.situations
    counts = []
    for snapshot in snapshots:
        weights = snapshot["weights", "weight"].flatten().tolist()
        seed, first = int(snapshot["seed"]), int(snapshot["evaluation"]) * len(situations)
        episodes = enumerate(situations, FIRST_EPISODE + first)
        counts.append(
            sum(is_caught(settings, weights, seed, episode, start) for episode, start in episodes)
        )
    with torch.no_grad():
        assert make_evaluation(settings).score(snapshots).tolist() == counts
    assert len(set(counts)) >= 4


@torch.no_grad()
def test_a_rule_base_that_steers_towards_the_ball_catches_it_always() -> None:
    untrained = torch.zeros(5, 4).double()
    weights = torch.stack([followers_weights(), -followers_weights(), untrained])
    scores = make_evaluation(load_config()).score(make_snapshots(weights))
    assert scores.dtype == torch.int64
    assert scores.tolist()[:2] == [5, 0]
    assert scores[2] <= 1


@pytest.mark.parametrize(("time_limit", "catches"), [(11, 1), (10, 0)])
@torch.no_grad()
def test_a_catch_in_the_last_step_counts(time_limit: int, catches: int) -> None:
    # Straight ahead at 0.03 m a step to a ball at 0.5 m that rolls by: nearer than 0.2 m after
    # step 11, by (0.166, 0.066) m, and not yet after step 10, (0.196, 0.060) m.
    settings = config(f"env.time_limit_steps={time_limit}", "evaluation.situations=[[0,0.12]]")
    straight = torch.tensor([-1.0, 1.0, 1.0, -1.0]).double().expand(1, 5, 4)
    assert make_evaluation(settings).score(make_snapshots(straight)).tolist() == [catches]


@torch.no_grad()
def test_snapshots_together_score_as_one_by_one(snapshots: TensorDict) -> None:
    evaluation = make_evaluation(config())
    together = evaluation.score(snapshots)
    one_by_one = [evaluation.score(snapshots[i : i + 1]) for i in range(len(snapshots))]
    assert torch.equal(together, torch.cat(one_by_one))


@torch.no_grad()
def test_so_many_snapshots_that_they_are_played_in_slices(snapshots: TensorDict) -> None:
    evaluation = make_evaluation(config())
    times = 300
    progress: list[int] = []
    scores = evaluation.score(torch.cat([snapshots] * times), progress.append)
    assert torch.equal(scores, evaluation.score(snapshots).repeat(times))
    assert len(progress) > 1
    assert progress == sorted(progress)
    assert progress[-1] == 5 * len(snapshots) * times


@torch.no_grad()
def test_every_evaluation_and_every_seed_has_random_numbers_of_its_own() -> None:
    snapshots = make_snapshots(torch.zeros(400, 5, 4).double())  # all candidates tied
    other_seeds, other_evaluations = snapshots.clone(), snapshots.clone()
    other_seeds["seed"] += 1000
    other_evaluations["evaluation"] += 1000
    evaluation = make_evaluation(config())
    scores = [evaluation.score(s) for s in (snapshots, snapshots, other_seeds, other_evaluations)]
    assert torch.equal(scores[0], scores[1])
    assert not torch.equal(scores[0], scores[2])
    assert not torch.equal(scores[0], scores[3])


@torch.no_grad()
def test_it_changes_no_weights_and_draws_no_global_random_numbers(snapshots: TensorDict) -> None:
    evaluation = make_evaluation(config())
    kept, generator = snapshots.clone(), torch.get_rng_state()
    evaluation.score(snapshots)
    assert (snapshots == kept).all()
    assert (evaluation.policy.value_network.weight == 0).all()
    assert evaluation.policy.epsilon == 1
    assert torch.equal(torch.get_rng_state(), generator)
