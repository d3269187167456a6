from itertools import islice, product

import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl.agent.learning_step import Learner
from fnnq_torchrl.agent.values import FNNQValue
from fnnq_torchrl.config.schema import PER_RUN
from fnnq_torchrl.engine import graphs
from fnnq_torchrl.equations.names import EXPLORATIONS, TRACES, VARIANTS
from fnnq_torchrl.equations.q_lambda import Rule
from fnnq_torchrl.equations.step_size import STEP_SIZES, make_step_size
from tests.oracles.peng import peng_q_lambda
from tests.oracles.q_lambdas import q_lambda
from tests.oracles.random_mdp import ACTIONS, STATES, RandomMDP, Walk
from tests.programs import advance, config, make_learner, make_runs

CRISP = 0.01  # width of labels at a distance of 1: at a centre, all other memberships are 0
STEPS = 150


@pytest.fixture(scope="module")
def mdp_runs() -> TensorDict:
    """Return runs that differ in every value; each λ comes three times with small and large ε."""
    generator = torch.Generator().manual_seed(1)
    lam = torch.tensor([0.0, 0.2, 0.8, 1.0]).double().repeat(6)
    runs = len(lam)

    def between(low: float, high: float) -> torch.Tensor:
        return low + (high - low) * torch.rand(runs, generator=generator, dtype=torch.float64)

    columns = {
        "seed": torch.randperm(2**20, generator=generator)[:runs],
        "lam": lam,
        "alpha": between(0.1, 0.9),
        "alpha_decay": between(0.9, 1.0),
        "gamma": between(0.5, 1.0),
        "epsilon": torch.tensor([0.0, 0.1, 0.1, 0.5, 0.5, 1.0]).double().repeat_interleave(4),
        "situations": torch.full((runs,), STEPS),
    }
    return TensorDict({key: value.unsqueeze(-1) for key, value in columns.items()}, [runs])


def mdp_learner(runs: int, rule: Rule, step_size: str = "decay") -> Learner:
    candidates = torch.linspace(-1, 1, ACTIONS, dtype=torch.float64)
    network = FNNQValue(
        {"place": [(place, CRISP) for place in range(STATES)]},
        [(action, CRISP) for action in candidates.tolist()],
        candidates,
        runs=runs,
    )
    return Learner(
        RandomMDP(runs),
        network,
        rule=rule,
        step_size=make_step_size(step_size),
        exploration="epsilon_greedy",
        evaluate_every=1,
        largest_value=1e6,
    )


def own_values(runs: TensorDict, i: int) -> dict[str, float]:
    """Return the arguments that give the plain-Python learner the values of run i."""
    return {key: runs[key][i].item() for key in set(runs.keys()) - {"situations"}}


@pytest.fixture(scope="module")
def tables(mdp_runs: TensorDict) -> dict[str, torch.Tensor]:
    """Return the plain-Python learners' values after every step, ``[runs, STEPS, …]``."""
    histories = []
    for i in range(len(mdp_runs)):
        values = own_values(mdp_runs, i)
        walk = Walk(values.pop("seed"))
        histories.append([*islice(peng_q_lambda(walk, STATES, ACTIONS, **values), STEPS)])
    return {
        name: torch.tensor(
            [[getattr(learned, name) for learned in history] for history in histories],
            dtype=torch.float64,
        )
        for name in ("q", "trace", "alpha")
    }


@pytest.mark.parametrize("reading", ["output", "gradient"])
@torch.no_grad()
def test_with_crisp_labels_it_is_pengs_tabular_q_lambda_to_the_last_bit(
    mdp_runs: TensorDict, tables: dict[str, torch.Tensor], reading: str
) -> None:
    learner = mdp_learner(len(mdp_runs), Rule(trace=reading))
    state = learner.begin(mdp_runs)
    for step in range(STEPS):
        state = learner.step(mdp_runs, state)
        assert torch.equal(state["weights", "weight"], tables["q"][:, step]), step
        assert torch.equal(state["trace", "weight"], tables["trace"][:, step]), step
        assert torch.equal(state["alpha"].squeeze(-1), tables["alpha"][:, step]), step


OFF_POLICY = ("peng", "watkins", "naive")
PAIRS = [(v, t) for v, t in product(VARIANTS, TRACES) if t != "dutch" or v == "sarsa"]
"""All variants with all traces that suit them."""

LONG = 30  # more steps than an episode has
SOME = 60


@pytest.mark.parametrize(
    ("variant", "trace", "window"),
    [
        *((variant, trace, LONG) for variant, trace in product(OFF_POLICY, TRACES[:4])),
        *(("sarsa", trace, LONG) for trace in TRACES if trace not in ("output", "window")),
        *((variant, "clearing", LONG) for variant in ("peng", "watkins")),
        ("expected_sarsa", "gradient", LONG),
        *(("peng", "window", window) for window in (1, 3)),
        ("watkins", "window", 2),
    ],
)
@torch.no_grad()
def test_with_crisp_labels_every_q_lambda_is_the_tabular_one(
    mdp_runs: TensorDict, variant: str, trace: str, window: int
) -> None:
    learner = mdp_learner(len(mdp_runs), Rule(variant, trace, window))
    learned = advance(learner, mdp_runs, SOME)
    for i in range(len(mdp_runs)):
        values = own_values(mdp_runs, i)
        walk = Walk(values.pop("seed"))
        rule = {"variant": variant, "trace": trace, "window": window}
        table = q_lambda(walk, STATES, ACTIONS, **rule, **values)
        q = torch.tensor(next(islice(table, SOME - 1, None)).q, dtype=torch.float64)
        torch.testing.assert_close(learned["weights", "weight"][i], q, rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("step_size", ["obgd", "alpha_bound"])
@pytest.mark.parametrize(
    ("variant", "trace"), [("peng", "output"), ("watkins", "gradient"), ("naive", "replacing")]
)
@torch.no_grad()
def test_with_crisp_labels_every_step_size_is_the_tabular_one(
    mdp_runs: TensorDict, step_size: str, variant: str, trace: str
) -> None:
    kappa = torch.linspace(1.1, 3, len(mdp_runs), dtype=torch.float64)
    runs = mdp_runs.clone().set("kappa", kappa.unsqueeze(-1))
    learned = advance(mdp_learner(len(runs), Rule(variant, trace), step_size), runs, SOME)
    for i in range(len(runs)):
        values = own_values(runs, i)
        walk = Walk(values.pop("seed"))
        rule = {"variant": variant, "trace": trace, "window": LONG, "step_size": step_size}
        table = next(islice(q_lambda(walk, STATES, ACTIONS, **rule, **values), SOME - 1, None))
        q, alpha = (torch.tensor(x, dtype=torch.float64) for x in (table.q, table.alpha))
        torch.testing.assert_close(learned["weights", "weight"][i], q, rtol=1e-10, atol=1e-12)
        torch.testing.assert_close(learned["alpha"][i, 0], alpha, rtol=1e-10, atol=0)


@pytest.mark.long
@torch.no_grad()
def test_no_two_q_lambdas_are_the_same() -> None:
    """The readings of the trace differ too, because the labels overlap."""
    settings = config("machine.dtype=float64", "lam=0.7", "epsilon=0.3")
    run = make_runs(settings, 8)
    weights = {}
    for variant, trace in PAIRS:
        if trace == "clearing":
            continue  # for tables and tiles only
        rule = (f"variant={variant}", f"trace={trace}", "window=3")
        learner = make_learner(config("machine.dtype=float64", *rule), run)
        weights[variant, trace] = advance(learner, run, 28)["weights", "weight"]
    kept = torch.stack([*weights.values()]).flatten(1)
    apart = (kept.unsqueeze(0) - kept.unsqueeze(1)).abs().amax(-1) + torch.eye(len(kept))
    assert apart.min() > 1e-3


@pytest.mark.long
@pytest.mark.parametrize("variant", VARIANTS)
@torch.no_grad()
def test_a_window_as_long_as_the_episode_is_the_gradient_trace(variant: str) -> None:
    settings = ("machine.dtype=float64", "lam=0.9", f"variant={variant}")
    run = make_runs(config(*settings), 4)
    learned = [
        advance(make_learner(config(*settings, *trace), run), run, 45)["weights", "weight"]
        for trace in (("trace=gradient",), ("trace=window", "window=14"))
    ]
    torch.testing.assert_close(*learned, rtol=1e-11, atol=1e-13)


@torch.no_grad()
def learned_without_lambda(*rule: str) -> torch.Tensor:
    settings = config("machine.dtype=float64", "lam=0", *rule)
    run = make_runs(settings, 4)
    return advance(make_learner(settings, run), run, 30)["weights", "weight"]


@pytest.fixture(scope="module")
def q_learned() -> torch.Tensor:
    return learned_without_lambda()


@pytest.mark.parametrize(("variant", "trace"), [*product(OFF_POLICY, TRACES[:4])])
def test_without_lambda_every_q_lambda_is_q_learning(
    variant: str, trace: str, q_learned: torch.Tensor
) -> None:
    learned = learned_without_lambda(f"variant={variant}", f"trace={trace}")
    torch.testing.assert_close(learned, q_learned, rtol=1e-11, atol=1e-13)


def test_the_table_has_learned_something(tables: dict[str, torch.Tensor]) -> None:
    # Otherwise the test above would compare zeros.
    assert (tables["q"][:, -1].abs() > 1e-3).sum(dim=(-1, -2)).min() >= 3
    assert (tables["trace"].abs() > 1e-3).any()
    assert (tables["alpha"][:, -1] < tables["alpha"][:, 0]).all()


CHANGES = {"seed": 99, "lam": 0.9, "alpha": 0.2, "alpha_decay": 0.5, "gamma": 0.8}
AMOUNTS = {"epsilon": 0.6, "temperature": 1.0, "noise_std": 1.0}


@pytest.mark.parametrize("exploration", EXPLORATIONS)
def test_every_value_of_a_run_acts_on_that_run_alone(exploration: str) -> None:
    settings = config(f"exploration={exploration}")
    annealing = {"epsilon_final", "epsilon_over"}
    adaptive = {key for key in PER_RUN if key.startswith("adaptive_")}
    of_steps = {number for rule in STEP_SIZES.values() for number in rule.numbers}
    assert CHANGES.keys() | AMOUNTS.keys() | of_steps | annealing | adaptive == set(PER_RUN)
    base = make_runs(settings, 12)
    changed = base.clone()
    amount = EXPLORATIONS[exploration]
    for key in AMOUNTS.keys() - {amount} | of_steps | {"epsilon_over"} | adaptive:
        changed[key] += 0.1  # a value that this policy, step size or scheme doesn't use
    for lane, (key, value) in enumerate((CHANGES | {amount: AMOUNTS[amount]}).items()):
        changed[key][lane] = value
    learner = make_learner(settings, base)
    before, after = (advance(learner, run, 80)["weights", "weight"] for run in (base, changed))
    differs = (before != after).flatten(1).any(1).tolist()
    changes = len(CHANGES) + 1
    assert differs == [True] * changes + [False] * (12 - changes)


@torch.no_grad()
def test_a_step_is_a_function() -> None:
    settings = config()
    run = make_runs(settings, 4)
    learner = make_learner(settings, run)
    state = advance(learner, run, 20)
    kept_run, kept_state = run.clone(), state.clone()
    one, other = learner.step(run, state), learner.step(run, state)
    assert (one == other).all()
    assert (run == kept_run).all()
    assert (state == kept_state).all()
    assert (learner.loss.value_network.weight == 0).all()


@torch.no_grad()
def test_alpha_decays_after_a_catch_only_and_situations_are_counted() -> None:
    settings = config()
    run = make_runs(settings, 16)
    learner = make_learner(settings, run)
    state = learner.begin(run)
    seen = {"catch": 0, "miss": 0}
    for step in range(1, 40):
        before, state = state, learner.step(run, state)
        ended = state["situations"] - before["situations"]
        caught = state["alpha"] < before["alpha"]
        assert torch.equal(state["alpha"][caught], before["alpha"][caught] * 0.99)
        assert torch.equal(state["alpha"][~caught], before["alpha"][~caught])
        assert torch.equal(ended == 1, state["world", "step"] == 0)
        assert ended[caught].all()
        assert (state["trace", "weight"][ended.squeeze(-1) == 1] == 0).all()
        assert (state["steps"] == step).all()
        assert torch.equal(state["world", "episode"], state["situations"])
        seen["catch"] += int(caught.sum())
        seen["miss"] += int(ended.sum() - caught.sum())
    assert min(seen.values()) > 0


@torch.no_grad()
def test_a_run_whose_values_leave_all_bounds_has_diverged_and_stops_counting() -> None:
    settings = config("evaluation.every=1", "situations=100")
    run = make_runs(settings, 4)
    learner = make_learner(settings, run)
    state = learner.begin(run)
    bound = learner.largest_value
    assert bound == 100  # in units of the largest return, that of a catch
    for i, weight in enumerate((0.99 * bound, -1.01 * bound, torch.nan, 1.01 * bound)):
        state["weights", "weight"][i] = weight
    state["over"][3] = True  # the values of a run that is over don't count
    first = learner.step(run, state)
    assert first["diverged"].squeeze(-1).tolist() == [False, True, True, False]
    assert first["over"].squeeze(-1).tolist() == [False, True, True, False]
    assert first["steps"].squeeze(-1).tolist() == [1, 0, 0, 1]
    for _ in range(30):
        state = learner.step(run, state)
    assert torch.equal(state["diverged"][1:3], torch.ones(2, 1, dtype=torch.bool))
    assert (state["steps"][1:3] == 0).all()
    assert (state["situations"][1:3] == 0).all()
    assert state["situations"][0] > 0


def test_no_two_entries_of_the_first_state_share_memory() -> None:
    run = make_runs(config(), 2)
    state = make_learner(config(), run).begin(run)
    leaves = [*state.values(include_nested=True, leaves_only=True), *run.values()]
    assert len({leaf.data_ptr() for leaf in leaves}) == len(leaves)


@pytest.mark.parametrize(
    "options",
    [
        # tests/engine/test_loops.py has the default and trace=dutch, compiled.
        ("variant=watkins", "trace=window", "window=3", "exploration=boltzmann"),
        ("variant=naive", "trace=replacing", "exploration=noise"),
        ("variant=watkins", "trace=gradient", "step_size=obgd", "scale_rewards=true"),
        ("value=mlp", "value.normalise=true", "trace=gradient", "step_size=alpha_bound"),
        ("trace=window", "window=3", "step_size=alpha_bound"),
        ("variant=expected_sarsa", "trace=clearing", "value=table", "exploration=boltzmann"),
        ("variant=sarsa", "trace=gradient", "step_size=alpha_bound", "exploration=noise"),
    ],
    ids=" ".join,
)
@torch.no_grad()
def test_a_step_traced_is_the_step(options: tuple[str, ...]) -> None:
    """The graph that a compiled loop is made of maps plain tensors to plain tensors."""
    settings = config("machine.dtype=float64", *options)
    run = make_runs(settings, 3)
    learner = make_learner(settings, run)
    graph = graphs.trace(learner.step, run, learner.begin(run))
    state = advance(learner, run, 9)
    for _ in range(6):  # the six steps include the end of an episode
        before = graphs.leaves(state)
        traced = graph(*graphs.leaves(run).values(), *before.values())
        state = learner.step(run, state)
        expected = graphs.leaves(state)
        for key, value in zip(before, traced, strict=True):
            torch.testing.assert_close(value, expected[key], rtol=1e-12, atol=1e-14, msg=key)
    assert state["situations"].max() > 0
