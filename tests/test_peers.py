"""The comparison with other learners: the same test and actions, and conclusions that are true."""

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from benchmarks.peers.fuzzy import enough, scores_at
from benchmarks.peers.learners import PEERS
from benchmarks.peers.page import conclusions, write_page
from benchmarks.peers.results import (
    ALONE,
    EAGER,
    NO_TRACE,
    OURS,
    WORDS,
    at_last,
    read_results,
    score_interval,
    write_results,
)
from benchmarks.peers.runs import Run
from benchmarks.peers.task import moments, score
from benchmarks.peers.tune import LEARNING_RATES, best_rate, read_tuning
from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.training.trainer import Trainer
from tests.compositions import config_of

SEED = 3


class AsPeer(nn.Module):
    """One run's network in the peers' form: it maps bearings to the candidates' values."""

    def __init__(self, network: ValueNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, bearing: Tensor) -> Tensor:
        return self.network(bearing.unsqueeze(0)).squeeze(0)


def test_peers_are_tested_as_ours_are():
    """The peers' test gives a network the score that our evaluation gives it."""
    config = config_of("situations=50", f"seed={SEED}", "engine=eager")
    trainer = Trainer.of(config)
    candidates = torch.linspace(-1, 1, config.action.candidates)
    weights = trainer.ledger.book.pages["weights", "weight"].detach()
    weights.normal_(generator=torch.Generator().manual_seed(SEED))  # arbitrary weights
    networks = []
    for weight in weights:
        network = make_value_network(config.value, candidates, runs=1)
        network.load_state_dict({"weight": weight}, strict=False)
        networks.append(AsPeer(network))
    trainer.ledger.learned.fill_(config.situations)
    ours = trainer.evaluate().catches[0].tolist()
    assert len(set(ours)) > 2  # policies that never catch would show nothing
    assert score(networks, SEED, config) == ours


@pytest.mark.filterwarnings(
    r"ignore:Creating \w+ which inherits from WeightUpdaterBase is deprecated:DeprecationWarning"
)
def test_torchrls_learner_chooses_among_the_same_actions():
    from torchrl.envs import check_env_specs

    from benchmarks.peers.torchrl_dqn import discrete

    config = config_of()
    env = discrete(FollowBall(config.env, seed=0), config.action.candidates)
    check_env_specs(env)
    assert env.action_spec.shape == ()
    state = env.reset()
    last = config.action.candidates - 1
    chosen = [state.clone().set("action", torch.tensor(i)) for i in (0, last // 2, last)]
    driven = torch.cat([env.transform.inv(each)["action"] for each in chosen])
    assert driven.tolist() == [-1, 0, 1]


def test_a_score_is_that_of_the_last_evaluation():
    taken, catches = np.array([0, 300, 500, 900]), np.array([0, 2, 1, 5])
    at = scores_at(np.array([0, 299, 300, 800, 900, 2000]), taken, catches)
    assert at.tolist() == [0, 0, 2, 1, 5, 5]


def test_enough_situations_for_the_steps():
    config = config_of()
    fewest = config.env.fewest_steps
    for steps in (1, 400, 12_000):
        situations = enough(config, steps)
        assert situations % config.evaluation.every == 0
        assert situations * fewest >= steps
        assert (situations - config.evaluation.every) * fewest < steps


def runs_of(score: int, count: int, **other: object) -> list[Run]:
    """Return runs of 1,200 steps with ``score`` of 5 catches, or one more in every second run."""
    steps = moments(1_200)
    some = [min(5, score + run % 2) for run in range(count)]
    return [
        Run(run, steps, [s / 100 for s in steps], [0] + [catches] * 3, {"library": "1.0"}, **other)
        for run, catches in enumerate(some)
    ]


def results_with(ours: int, theirs: int) -> dict[str, list[Run]]:
    peers = {name: runs_of(theirs, 6, world_seconds=1.0) for name in PEERS}
    short = Run(0, [0, 400], [0.0, 8.0], [0, ours], {"library": "1.0"})
    own = {OURS: runs_of(ours, 10), NO_TRACE: runs_of(ours, 10), ALONE: runs_of(ours, 3)}
    return own | {EAGER: [short]} | peers


@pytest.mark.parametrize(
    ("ours", "theirs", "said", "arrives"),
    [
        (4, 2, ": an advantage.", "doesn't come to 4 catches on average, or doesn't stay there"),
        (2, 4, ": a disadvantage.", "is at 4 catches on average or above from 400 steps on"),
        (
            3,
            3,
            ": this may be chance.",
            "doesn't come to 4 catches on average, or doesn't stay there",
        ),
    ],
)
def test_what_the_page_concludes(ours, theirs, said, arrives):
    own, *others = conclusions(results_with(ours, theirs))
    assert said in others[0]
    assert said in others[1]
    assert all(peer.words in line for peer, line in zip(PEERS.values(), others, strict=False))
    assert arrives in others[0]
    assert ("from 400 steps on" in own) == (ours == 4)
    # The peer's 12 s against our 12 s compiled, and against 24 s of eager steps.
    assert "takes 1.00 times as long" in others[2]
    assert "It takes about 0.5 times as long" in others[2]


@pytest.mark.parametrize(
    ("scores", "place"),
    [([0, 4, 5], 1), ([5, 3, 4], 2), ([4, 4, 4], 0), ([4, 5, 3], None), ([0, 0, 3], None)],
)
def test_good_luck_before_learning_is_no_arrival(scores, place):
    run = Run(0, [0, 400, 800], [0.0, 1.0, 2.0], scores, {})
    assert at_last([run], 4) == place


def test_the_page_is_written_from_the_results_file(tmp_path):
    results = results_with(4, 2)
    write_results(tmp_path / "new" / "results.json", "a machine", results)
    machine, read = read_results(tmp_path / "new" / "results.json")
    assert read == results
    write_page(tmp_path / "peers.md", machine, read)
    page = (tmp_path / "peers.md").read_text(encoding="utf-8")
    assert "$" not in page
    assert "a machine" in page
    assert all(words in page for words in WORDS.values())


def test_no_interval_of_a_score_leaves_the_scale():
    scores = np.array([[0, 4, 5], [0, 5, 5], [1, 5, 5]])
    mean, low, high = score_interval(scores, best=5)
    np.testing.assert_allclose(mean, scores.mean(axis=0))
    assert low.tolist()[0] == 0
    assert high.tolist()[1:] == [5, 5]
    assert ((low <= mean) & (mean <= high)).all()


def test_every_peer_has_been_tuned():
    scores = read_tuning()
    assert scores.keys() == PEERS.keys()
    for by_rate in scores.values():
        assert sorted(by_rate) == sorted(LEARNING_RATES)
        assert best_rate(by_rate) in LEARNING_RATES
    assert best_rate({1.0: [3, 3], 2.0: [1, 6], 3.0: [2, 2]}) == 2.0
