from collections.abc import Callable

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tensordict import TensorDict
from torch import Tensor, nn
from torchrl.modules import QValueActor
from torchrl.objectives import DQNLoss, ValueEstimators

from envs.robot.follow import FollowBall
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.eligibility_trace import EligibilityTrace
from fnnq_torchrl.agent.loss import PengQLambdaLoss
from fnnq_torchrl.agent.policy import EpsilonGreedyPolicy
from fnnq_torchrl.agent.values import ValueNetwork, make_value_network
from fnnq_torchrl.equations.q_lambda import Rule
from tests.programs import advance, config, make_learner, make_runs

RUNS, STEPS = 4, 45
CANDIDATES = torch.linspace(-1, 1, 21, dtype=torch.float64)
GAMMA = 15 / 16  # exact in float32, in which TorchRL keeps it
READINGS = pytest.mark.parametrize("reading", ["output", "gradient"])


def real(*values: float) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


def fill(network: ValueNetwork, seed: int = 0) -> ValueNetwork:
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for weight in network.parameters():
            weight.normal_(generator=generator)
    return network


def fnn(runs: int = RUNS) -> ValueNetwork:
    return make_value_network(config().value, CANDIDATES, runs)


class Perceptron(ValueNetwork):
    """A value network with one hidden layer and separate weights for each run."""

    def __init__(self, runs: int = RUNS, hidden: int = 6) -> None:
        super().__init__(["bearing"], CANDIDATES)
        self.hidden = nn.Parameter(torch.zeros(runs, 2, hidden, dtype=torch.float64))
        self.bias = nn.Parameter(torch.zeros(runs, hidden, dtype=torch.float64))
        self.output = nn.Parameter(torch.zeros(runs, hidden, dtype=torch.float64))

    def forward(self, bearing: Tensor, *, action: Tensor | None = None) -> Tensor:
        actions = self.candidates if action is None else action
        x = torch.stack(torch.broadcast_tensors(bearing, actions), dim=-1)
        runs, batch = x.shape[0], x.shape[1:-1]
        x = x.reshape(runs, -1, 2)
        x = torch.tanh(torch.baddbmm(self.bias.unsqueeze(1), x, self.hidden))
        return torch.bmm(x, self.output.unsqueeze(-1)).view(runs, *batch)


def plain_perceptron(hidden: Tensor, bias: Tensor, output: Tensor, s: Tensor, a: Tensor) -> Tensor:
    """Return the perceptron's value for one run, one state and one action, in plain Python."""
    return torch.tanh(torch.stack([s, a]) @ hidden + bias) @ output


NETWORKS = pytest.mark.parametrize("make_network", [fnn, Perceptron])


@pytest.fixture(scope="module")
def episodes() -> TensorDict:
    """Return episodes of each run, ``[RUNS, STEPS]``, with catches and misses."""
    env = FollowBall(config().env, [RUNS], seed=2, dtype=torch.float64)
    policy = EpsilonGreedyPolicy(fill(fnn()), 0.3)
    with torch.no_grad():
        history = env.rollout(STEPS, policy, break_when_any_done=False)
    rewards = history["next", "reward"]
    assert (rewards > 0).any()
    assert (rewards < 0).any()
    assert not history["next", "done"][:, -1].all()  # the history cuts off some episodes
    return history


def seen_by(network: ValueNetwork, history: TensorDict) -> TensorDict:
    """Return the history with the action values that a policy of this network would write."""
    with torch.no_grad():
        return history.clone().set("action_value", network.values_in(history))


def torchrl_gradient(
    network: ValueNetwork, history: TensorDict, estimator: ValueEstimators, **kwargs: float
) -> dict[str, Tensor]:
    """Return each run's Σ(G − Q)∇Q by weight name, from TorchRL's own loss Σ(G − Q)²."""

    class AllCandidates(nn.Module):
        def __init__(self) -> None:
            super().__init__()
            self.network = network

        def forward(self, bearing: Tensor) -> Tensor:
            return self.network(bearing)

    actor = QValueActor(AllCandidates(), in_keys=["bearing"], action_space="categorical")
    loss = DQNLoss(actor, delay_value=False, reduction="sum", action_space="categorical")
    loss.make_value_estimator(estimator, gamma=GAMMA, **kwargs)
    batch = history.clone()
    batch["action"] = (batch["action"] - CANDIDATES).abs().argmin(-1)
    value = loss(batch)["loss"]
    names, weights = zip(*network.named_parameters(), strict=True)
    slopes = torch.autograd.grad(value, list(loss.parameters()))
    assert [w.shape for w in weights] == [slope.shape for slope in slopes]
    return {name: -slope / 2 for name, slope in zip(names, slopes, strict=True)}


@NETWORKS
def test_the_backward_view_of_frozen_weights_is_torchrls_forward_view(
    make_network: Callable[[], ValueNetwork], episodes: TensorDict
) -> None:
    network = fill(make_network(), seed=1)
    lams = [0.0, 0.25, 0.75, 1.0]  # of the four runs
    loss = PengQLambdaLoss(network, GAMMA)
    trace = EligibilityTrace(loss, real(*lams).unsqueeze(-1), Rule(trace="gradient"))
    history = seen_by(network, episodes)
    for t in range(STEPS):
        batch = history[:, t]
        trace(batch, loss(batch))["loss"].backward()
    for run, lam in enumerate(lams):
        forward = torchrl_gradient(
            network, history, ValueEstimators.TDLambda, lmbda=lam, vectorized=False
        )
        for name, weight in network.named_parameters():
            backward = -weight.grad[run]
            torch.testing.assert_close(backward, forward[name][run], rtol=1e-11, atol=1e-12)


@NETWORKS
def test_the_loss_alone_is_one_step_q_learning_as_torchrl_has_it(
    make_network: Callable[[], ValueNetwork], episodes: TensorDict
) -> None:
    network = fill(make_network(), seed=1)
    history = seen_by(network, episodes)
    PengQLambdaLoss(network, GAMMA)(history)["loss"].backward()
    expected = torchrl_gradient(network, history, ValueEstimators.TD0)
    for name, weight in network.named_parameters():
        torch.testing.assert_close(-weight.grad, expected[name], rtol=1e-11, atol=1e-12)


@READINGS
@NETWORKS
def test_without_lambda_the_trace_changes_nothing(
    make_network: Callable[[], ValueNetwork], reading: str, episodes: TensorDict
) -> None:
    network = fill(make_network(), seed=1)
    loss = PengQLambdaLoss(network, GAMMA)
    trace = EligibilityTrace(loss, 0.0, Rule(trace=reading))
    history = seen_by(network, episodes)
    for t in range(5):
        batch = history[:, t]
        plain = torch.autograd.grad(loss(batch)["loss"], list(network.parameters()))
        hooked = torch.autograd.grad(trace(batch, loss(batch))["loss"], list(network.parameters()))
        for one, other in zip(plain, hooked, strict=True):
            torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-15)


class Plane(ValueNetwork):
    """Q(s, a) = w₁s + w₂a."""

    def __init__(self) -> None:
        super().__init__(["s"], real(0.0, 1.0))
        self.weight = nn.Parameter(real(1.0, 2.0).view(1, 2))

    def forward(self, s: Tensor, *, action: Tensor | None = None) -> Tensor:
        actions = self.candidates if action is None else action
        return self.weight[:, :1] * s + self.weight[:, 1:] * actions


@pytest.mark.parametrize(
    ("reading", "weights", "traces"),
    [
        (
            "output",
            [(1.5, 2.0), (0.9375, 1.5), (0.955078125, 1.4140625)],
            [(0.5, 0.0), (0.625, 0.5), (0.0, 0.0)],
        ),
        (
            "gradient",
            [(1.5, 2.0), (0.75, 1.5), (1.0625, 1.375)],
            [(2.0, 0.0), (1.5, 1.0), (0.0, 0.0)],
        ),
    ],
)
def test_three_steps_by_hand(
    reading: str, weights: list[tuple[float, float]], traces: list[tuple[float, float]]
) -> None:
    """With actions {0, 1}, w = (1, 2), γ = λ = α = 0.5, so γλ = 0.25: all are binary fractions.

    1. s = 2, a = 0, r = 1, s′ = 1: Q = 2, V = 4, V′ = 3, the target is 2.5, δ = −1.5, δ′ = 0.5.
       e = 0, Δw = 0.5·(2, 0), w = (1.5, 2).
       Step h: output (2, 0)/4 = (0.5, 0); gradient (2, 0).
    2. s = 1, a = 1, r = 0, s′ = 2: Q = V = 3.5, V′ = 5, δ = δ′ = −1.
       output: e = (0.125, 0), Δw = −(1.125, 1), w = (0.9375, 1.5); e + (1, 1)/2 = (0.625, 0.5).
       gradient: e = (0.5, 0), Δw = −(1.5, 1), w = (0.75, 1.5); e + (1, 1) = (1.5, 1).
    3. s = 2, a = 0, r = 2, the end.
       output: Q = 1.875, V = 3.375, δ = −1.375, δ′ = 0.125, e = (0.15625, 0.125),
       Δw = −1.375·e + 0.125·(2, 0) = (0.03515625, −0.171875).
       gradient: Q = 1.5, V = 3, δ = −1, δ′ = 0.5, e = (0.375, 0.25), Δw = (0.625, −0.25).
    """
    network = Plane()
    loss = PengQLambdaLoss(network, gamma=0.5)
    trace = EligibilityTrace(loss, lam=0.5, rule=Rule(trace=reading))
    optimizer = torch.optim.SGD(network.parameters(), lr=0.5)
    steps = [(2, 0, 1, 1, False), (1, 1, 0, 2, False), (2, 0, 2, 9, True)]
    for (s, a, r, after, end), weight, e in zip(steps, weights, traces, strict=True):
        flag = torch.tensor([end])
        arrival = {"s": real(after), "reward": real(r), "terminated": flag, "done": flag}
        batch = TensorDict({"s": real(s), "action": real(a), "next": arrival}).unsqueeze(0)
        batch = seen_by(network, batch)
        losses = trace(batch, loss(batch))
        losses["loss"].backward()
        optimizer.step()
        optimizer.zero_grad()
        assert torch.equal(network.weight[0], real(*weight))
        assert torch.equal(trace.trace["weight"][0], real(*e))


@given(st.integers(0, 2**31), st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1), st.floats(0, 1))
def test_after_step_h_the_trace_networks_output_has_risen_by_exactly_one(
    seed: int, bearing: float, action: float, gamma: float, lam: float
) -> None:
    network = fill(fnn(1), seed)
    loss = PengQLambdaLoss(network, gamma)
    trace = EligibilityTrace(loss, lam, Rule(trace="output"))
    trace.trace = {"weight": fill(fnn(1), seed + 1).weight.detach()}

    def output() -> Tensor:
        """Return the output at (s, a) of a copy of the Q-network whose weights are the trace."""
        weights = {"weight": trace.trace["weight"]}
        return torch.func.functional_call(
            network, weights, (batch["bearing"],), {"action": batch["action"]}
        )

    point = {"bearing": real(bearing), "action": real(action)}
    flag = torch.tensor([False])
    arrival = {"bearing": point["bearing"], "reward": 0 * point["action"]}
    arrival |= {"terminated": flag, "done": flag}
    batch = seen_by(network, TensorDict(point | {"next": arrival}).unsqueeze(0))
    before = output()
    trace(batch, loss(batch))
    torch.testing.assert_close(output() - gamma * lam * before, real(1.0).view(1, 1))


@READINGS
@NETWORKS
def test_with_sgd_the_hook_learns_what_the_program_learns(
    make_network: Callable[[], ValueNetwork], reading: str
) -> None:
    settings = config(f"trace={reading}", "alpha_decay=1", "machine.dtype=float64")
    run = make_runs(settings, RUNS, lam=real(0.0, 0.2, 0.8, 1.0), gamma=real(0.95, 0.9, 0.8, 1.0))
    network = fill(make_network(), seed=1)
    learner = make_learner(settings, run, network)
    expected = advance(learner, run, STEPS)["weights"]

    env = FollowBall(settings.env, [RUNS], dtype=torch.float64, seed=0)
    policy = EpsilonGreedyPolicy(network, run["epsilon"])
    loss = PengQLambdaLoss(network, run["gamma"])
    trace = EligibilityTrace(loss, run["lam"], Rule(trace=reading))
    optimizer = torch.optim.SGD(network.parameters(), lr=settings.alpha)
    state = env.start(run["seed"], torch.zeros_like(run["seed"]))
    for _ in range(STEPS):
        with torch.no_grad():
            batch = env.step(policy(state))
        losses = trace(batch, loss(batch))
        losses["loss"].backward()
        optimizer.step()
        optimizer.zero_grad()
        state = env.restart(batch["next"])
    assert state["episode"].min() > 2
    for name, weight in network.named_parameters():
        torch.testing.assert_close(weight.detach(), expected[name], rtol=1e-9, atol=1e-11)


@pytest.mark.parametrize(("trace_name", "value"), [("dutch", "fnnq"), ("clearing", "table")])
def test_with_sgd_the_hook_learns_sarsa_as_the_program_does(trace_name: str, value: str) -> None:
    """The next action is chosen before the update, and taken in the next step."""
    settings = config(
        "variant=sarsa",
        f"trace={trace_name}",
        f"value={value}",
        "alpha_decay=1",
        "machine.dtype=float64",
    )
    run = make_runs(settings, RUNS, lam=real(0.0, 0.2, 0.8, 1.0))
    candidates = make_candidates(settings, torch.float64)
    network = fill(make_value_network(settings.value, candidates, RUNS), seed=1)
    expected = advance(make_learner(settings, run, network), run, STEPS)["weights", "weight"]

    env = FollowBall(settings.env, [RUNS], dtype=torch.float64, seed=0)
    policy = EpsilonGreedyPolicy(network, run["epsilon"])
    loss = PengQLambdaLoss(network, run["gamma"], bootstrap="chosen")
    trace = EligibilityTrace(loss, run["lam"], Rule("sarsa", trace_name), settings.alpha)
    optimizer = torch.optim.SGD(network.parameters(), lr=settings.alpha)
    with torch.no_grad():
        state = policy(env.start(run["seed"], torch.zeros_like(run["seed"])))
    for _ in range(STEPS):
        with torch.no_grad():
            batch = env.step(state)
            policy(batch["next"])
            ahead = batch["next"].select("action_value", "action").clone()
        losses = trace(batch, loss(batch))
        losses["loss"].backward()
        optimizer.step()
        optimizer.zero_grad()
        with torch.no_grad():
            state = policy(env.restart(batch["next"]))
        goes_on = ~batch["next", "done"]
        state["action"] = torch.where(goes_on, ahead["action"], state["action"])
    assert state["episode"].min() > 2
    torch.testing.assert_close(network.weight.detach(), expected, rtol=1e-9, atol=1e-11)


def test_a_dutch_trace_needs_the_step_size_and_a_variant_its_bootstrap() -> None:
    loss = PengQLambdaLoss(fnn(), GAMMA, bootstrap="chosen")
    with pytest.raises(ValueError, match="alpha=None: a dutch trace needs the step size"):
        EligibilityTrace(loss, 0.5, Rule("sarsa", "dutch"))
    with pytest.raises(ValueError, match="bootstrap='chosen': this variant needs 'best'"):
        EligibilityTrace(loss, 0.5)
    with pytest.raises(ValueError, match="bootstrap='worst': must be best, chosen or expected"):
        PengQLambdaLoss(fnn(), GAMMA, bootstrap="worst")


@READINGS
def test_any_networks_weights_are_credited_as_a_run_by_itself_would_be(
    reading: str, episodes: TensorDict
) -> None:
    network = fill(Perceptron(), seed=1)
    lams = [0.0, 0.2, 0.8, 1.0]
    loss = PengQLambdaLoss(network, GAMMA)
    trace = EligibilityTrace(loss, real(*lams).unsqueeze(-1), Rule(trace=reading))
    names = [name for name, _ in network.named_parameters()]
    traces = [[torch.zeros_like(w[run]) for w in network.parameters()] for run in range(RUNS)]
    history = seen_by(network, episodes)
    for t in range(20):
        batch = history[:, t]
        losses = trace(batch, loss(batch))
        slopes = torch.autograd.grad(losses["loss"], list(network.parameters()))
        for run, lam in enumerate(lams):
            own = tuple(w[run].detach() for w in network.parameters())
            step = batch[run]
            state, after = step["bearing"][0], step["next", "bearing"][0]
            value = max(plain_perceptron(*own, state, a) for a in CANDIDATES)
            ahead = max(plain_perceptron(*own, after, a) for a in CANDIDATES)
            point = state, step["action"][0]
            gradient = torch.func.grad(plain_perceptron, argnums=(0, 1, 2))(*own, *point)
            target = step["next", "reward"] + GAMMA * ahead * ~step["next", "terminated"]
            error, chosen_error = target - value, target - plain_perceptron(*own, *point)
            norm = sum(g.square().sum() for g in gradient)
            for i, (g, name) in enumerate(zip(gradient, names, strict=True)):
                e = GAMMA * lam * traces[run][i]
                torch.testing.assert_close(-slopes[i][run], error * e + chosen_error * g)
                e = e + (g / norm if reading == "output" else g)
                traces[run][i] = e * ~step["next", "done"]
                torch.testing.assert_close(trace.trace[name][run], traces[run][i])


def test_a_run_with_its_own_gamma_on_whole_histories(episodes: TensorDict) -> None:
    network = fill(fnn(), seed=1)
    gamma = real(0.5, 0.9, 0.99, 0.0).unsqueeze(-1)
    with torch.no_grad():
        together = PengQLambdaLoss(network, gamma)(episodes)
        for run in range(RUNS):
            shared = PengQLambdaLoss(network, gamma[run].item())(episodes)
            for key in ("td_error", "chosen_td_error", "chosen_action_value"):
                assert together[key].shape == (RUNS, STEPS, 1)
                torch.testing.assert_close(together[key][run], shared[key][run])


def test_a_step_may_come_as_a_sequence_of_one_but_not_of_more(episodes: TensorDict) -> None:
    loss = PengQLambdaLoss(fill(fnn()), GAMMA)
    one, other = EligibilityTrace(loss, 0.8), EligibilityTrace(loss, 0.8)
    for t in range(3):
        step, sequence = episodes[:, t], episodes[:, t : t + 1]
        losses = one(step, loss(step)), other(sequence, loss(sequence))
        torch.testing.assert_close(losses[0]["loss"], losses[1]["loss"])
        assert torch.equal(one.trace["weight"], other.trace["weight"])
    with pytest.raises(ValueError, match=r"batch of shape \[4, 2\]: must be one step of every run"):
        one(episodes[:, :2], loss(episodes[:, :2]))


def test_truncation_ends_the_trace_but_not_the_value(episodes: TensorDict) -> None:
    loss = PengQLambdaLoss(fill(fnn()), GAMMA)
    trace = EligibilityTrace(loss, 0.8)
    batch = episodes[:, 0].clone()
    going_on = loss(batch)
    batch["next", "done"][1] = True
    truncated = loss(batch)
    assert torch.equal(truncated["td_error"], going_on["td_error"])
    trace(batch, truncated)
    assert (trace.trace["weight"].flatten(1) == 0).all(1).tolist() == [False, True, False, False]


def test_set_keys_renames_what_is_not_an_observation(episodes: TensorDict) -> None:
    names = {
        "action": "steering",
        "reward": "pay",
        "done": "over",
        "terminated": ("end", "true"),
        "td_error": "delta",
        "chosen_td_error": ("deltas", "chosen"),
        "chosen_action_value": "q",
    }
    network = fill(fnn())
    loss, renamed = (PengQLambdaLoss(network, GAMMA) for _ in range(2))
    renamed.set_keys(**names)
    batch = episodes[:, 0]
    other = batch.clone()
    other.rename_key_("action", names["action"])
    for key in ("reward", "done", "terminated"):
        other["next"].rename_key_(key, names[key])

    for module, step in ((loss, batch), (renamed, other)):
        assert {*module(step.select(*module.in_keys)).keys(True, True)} == {*module.out_keys}
    before, after = loss(batch), renamed(other)
    for key in ("td_error", "chosen_td_error", "chosen_action_value"):
        assert torch.equal(before[key], after[names[key]])
    trace, its_trace = EligibilityTrace(loss, 0.8), EligibilityTrace(renamed, 0.8)
    assert torch.equal(trace(batch, before)["loss"], its_trace(other, after)["loss"])
    assert torch.equal(trace.trace["weight"], its_trace.trace["weight"])


@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::FutureWarning")
def test_the_hook_works_in_torchrls_trainer() -> None:
    from torchrl.collectors import Collector
    from torchrl.trainers import Trainer

    settings = config("machine.dtype=float64", "alpha_decay=1", "lam=0.8")
    run = make_runs(settings, RUNS)
    expected = advance(make_learner(settings, run), run, STEPS)["weights", "weight"]

    network = fnn()
    loss = PengQLambdaLoss(network, settings.gamma)
    trainer = Trainer(
        collector=Collector(
            FollowBall(settings.env, [RUNS], dtype=torch.float64, seed=0),
            EpsilonGreedyPolicy(network, settings.epsilon),
            frames_per_batch=RUNS,
            total_frames=RUNS * STEPS,
        ),
        total_frames=RUNS * STEPS,
        frame_skip=1,
        optim_steps_per_batch=1,
        loss_module=loss,
        optimizer=torch.optim.SGD(network.parameters(), lr=settings.alpha),
        clip_grad_norm=False,
        progress_bar=False,
    )
    EligibilityTrace(loss, settings.lam).register(trainer)
    trainer.train()
    torch.testing.assert_close(network.weight.detach(), expected, rtol=1e-9, atol=1e-11)


def test_the_loss_is_a_sum_over_runs_and_trains_q_not_its_target(episodes: TensorDict) -> None:
    network = fill(fnn())
    losses = PengQLambdaLoss(network, GAMMA)(episodes[:, 0])
    errors = losses["chosen_td_error"]
    assert not errors.requires_grad
    assert not losses["td_error"].requires_grad
    torch.testing.assert_close(losses["loss"], 0.5 * errors.square().sum())
    (slope,) = torch.autograd.grad(losses["loss"], [network.weight], retain_graph=True)
    (gradient,) = torch.autograd.grad(losses["chosen_action_value"].sum(), [network.weight])
    torch.testing.assert_close(slope, -errors.unsqueeze(-1) * gradient)


def test_the_trace_can_be_saved(episodes: TensorDict) -> None:
    network = fill(fnn())
    loss = PengQLambdaLoss(network, GAMMA)
    saved, other = EligibilityTrace(loss, 0.8), EligibilityTrace(loss, 0.8)
    saved(episodes[:, 0], loss(episodes[:, 0]))
    other.load_state_dict(saved.state_dict())
    losses = [trace(episodes[:, 1], loss(episodes[:, 1]))["loss"] for trace in (saved, other)]
    assert torch.equal(*losses)
    assert torch.equal(saved.trace["weight"], other.trace["weight"])


@pytest.mark.parametrize("shape", [(RUNS,), (1, RUNS), (RUNS, 1, 1)])
def test_numbers_per_run_have_one_shape(shape: tuple[int, ...]) -> None:
    numbers = torch.full(shape, 0.5)
    with pytest.raises(ValueError, match=r"^gamma must be one number or \[runs, 1\], got"):
        PengQLambdaLoss(fnn(), numbers)
    with pytest.raises(ValueError, match=r"^lam must be"):
        EligibilityTrace(PengQLambdaLoss(fnn(), GAMMA), numbers)
