import pytest
import torch
from tensordict import TensorDict

from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy, make_policy
from fnnq_torchrl.agent.values import FNNQValue, make_value_network
from fnnq_torchrl.equations.names import EXPLORATIONS
from tests.oracles import peng
from tests.programs import config

CANDIDATES = torch.linspace(-1, 1, 21, dtype=torch.float64)
EPSILON = torch.tensor([0.0, 0.0, 0.3, 0.6, 1.0], dtype=torch.float64).unsqueeze(-1)


@pytest.fixture
def network() -> FNNQValue:
    network = make_value_network(config().value, CANDIDATES, runs=5)
    with torch.no_grad():
        network.weight.normal_(generator=torch.Generator().manual_seed(3))
        network.weight[1] = 0  # all candidates tied
    return network


@pytest.fixture
def history(network: FNNQValue) -> TensorDict:
    env = FollowBall(config().env, [5], seed=8, dtype=torch.float64)
    policy = EpsilonGreedyPolicy(network, EPSILON)
    with torch.no_grad():
        return env.rollout(40, policy, break_when_any_done=False)


def test_it_drives_a_rollout(network: FNNQValue, history: TensorDict) -> None:
    assert history.shape == (5, 40)
    assert history["action"].shape == (5, 40, 1)
    with torch.no_grad():
        values = network(history["bearing"])
    torch.testing.assert_close(history["action_value"], values)


def test_each_run_chooses_with_its_own_epsilon_by_the_chance_of_its_state(
    history: TensorDict,
) -> None:
    for run, epsilon in enumerate(EPSILON.flatten().tolist()):
        for state in history[run]:
            values = state["action_value"].tolist()
            chosen = peng.epsilon_greedy(values, epsilon, state["chance"].item())
            assert state["action"].item() == CANDIDATES[chosen].item()


def test_runs_explore_as_often_as_their_epsilon_says(history: TensorDict) -> None:
    best = CANDIDATES[history["action_value"].argmax(-1)]
    elsewhere = (history["action"].squeeze(-1) != best).double().mean(-1)
    assert elsewhere[0] == 0
    assert 0.1 < elsewhere[2] < 0.5
    assert 0.35 < elsewhere[3] < 0.85
    assert elsewhere[4] > 0.8
    assert history["action"][1].unique().numel() > 10  # ties are broken at random


def test_a_shared_epsilon_is_one_number(network: FNNQValue) -> None:
    env = FollowBall(config().env, [5], dtype=torch.float64, seed=0)
    state = env.reset()
    shared = EpsilonGreedyPolicy(network, 0.5)(state.copy())
    own = EpsilonGreedyPolicy(network, torch.full((5, 1), 0.5).double())(state.copy())
    assert torch.equal(shared["action"], own["action"])


def test_it_names_what_it_reads_and_writes(network: FNNQValue) -> None:
    policy = EpsilonGreedyPolicy(network, EPSILON)
    state = (
        FollowBall(config().env, [5], dtype=torch.float64, seed=0).reset().select(*policy.in_keys)
    )
    assert set(policy(state).keys()) == {*policy.in_keys, *policy.out_keys}


@pytest.mark.parametrize("exploration", EXPLORATIONS)
@pytest.mark.parametrize("batch_size", [(1,), (3,), (21,), (5, 3), (1, 21)])
def test_it_drives_batches_of_any_shape(batch_size: tuple[int, ...], exploration: str) -> None:
    network = make_value_network(config().value, CANDIDATES, runs=1)
    env = FollowBall(config().env, batch_size, dtype=torch.float64, seed=0)
    with torch.no_grad():
        history = env.rollout(3, make_policy(exploration, network, 0.5))
    assert history["action"].shape == (*batch_size, 3, 1)
    assert (history["action"].abs() <= 1).all()
    assert torch.isin(history["action"], CANDIDATES).all() == (exploration != "noise")


def test_there_is_no_other_policy(network: FNNQValue) -> None:
    with pytest.raises(ValueError, match=r"=softmax: must be epsilon_greedy, boltzmann, noise or"):
        make_policy("softmax", network, 0.5)


def test_a_batch_without_runs_is_refused(network: FNNQValue) -> None:
    state = FollowBall(config().env, (), dtype=torch.float64, seed=0).reset()
    with pytest.raises(ValueError, match=r"batch_size=\[1\]"):
        EpsilonGreedyPolicy(network, 0.5)(state)
