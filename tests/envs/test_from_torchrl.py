"""Any TorchRL environment as a world."""

import pytest
import torch
from tensordict import TensorDict
from torchrl.data import Binary, Bounded, Categorical, Composite, OneHot, Unbounded
from torchrl.envs import EnvBase, PendulumEnv, check_env_specs

from envs import PureEnv, make_world
from envs.core.contract import check_world
from fnnq_torchrl.config.schema import ConfigError
from fnnq_torchrl.engine.choice import choose_engine
from fnnq_torchrl.launch.composition import load_config
from fnnq_torchrl.training.results import read_evaluations
from tests.commands import fnnq_train
from tests.compositions import config_of

HERE = "env.kind=torchrl:tests.envs.test_from_torchrl"
PENDULUM = ("env.kind=torchrl:torchrl.envs:PendulumEnv", "action=even", "action.candidates=5")
CART_POLE = ("env.kind=torchrl:torchrl.envs:GymEnv", "+env.arguments.env_name=CartPole-v1")


class Toy(EnvBase):
    """A walk by torch's global random numbers, which is cut off after some steps."""

    def __init__(self, steps: int = 4, hot: bool = False, ends: bool = False) -> None:
        super().__init__()
        self.steps, self.ends = steps, ends
        flag = Binary(1, (1,), dtype=torch.bool)
        self.observation_spec = Composite(
            place=Unbounded((2,)),
            count=Categorical(steps + 1, (), dtype=torch.int64),
            pixels=Bounded(0, 1, (3, 32, 32)),
        )
        self.action_spec = OneHot(3) if hot else Categorical(3, (), dtype=torch.int64)
        self.reward_spec = Unbounded((1,))
        self.done_spec = Composite(done=flag, terminated=flag.clone(), truncated=flag.clone())

    def _now(self) -> dict[str, torch.Tensor]:
        pixels = torch.zeros(3, 32, 32)
        return {"place": self.place, "count": torch.tensor(self.count), "pixels": pixels}

    def _reset(self, tensordict=None, **kwargs):
        self.count, self.place = 0, torch.rand(2)
        return TensorDict(self._now(), [])

    def _step(self, tensordict):
        action = tensordict["action"]
        chosen = action.int().argmax() if action.ndim else action
        self.count, self.place = self.count + 1, self.place + torch.rand(2)
        last = torch.tensor([self.count == self.steps])
        flags = {"done": last, "terminated": last & self.ends, "truncated": last & (not self.ends)}
        return TensorDict({**self._now(), **flags, "reward": chosen.float().view(1)}, [])

    def _set_seed(self, seed):
        torch.manual_seed(seed)


class Two(Toy):
    def __init__(self) -> None:
        super().__init__()
        self.action_spec = Bounded(-1, 1, (2,))


class Rows(Toy):
    def __init__(self) -> None:
        EnvBase.__init__(self, batch_size=[3])


def make(*overrides: str, runs: int = 3) -> PureEnv:
    config = config_of("task=torchrl", *overrides)
    return make_world(config.env, [runs], seed=7, dtype=torch.float64)


def play(env: PureEnv, steps: int) -> TensorDict:
    """Return some steps of alternating actions, ``[steps, runs]``."""
    state, history = env.reset(), []
    for step in range(steps):
        action = torch.full_like(state["chance"], step % 2)
        after = env.step(state.set("action", action))["next"]
        history.append(after.select(*env.seen, "reward", "terminated", "truncated", "chance"))
        state = env.restart(after)
    return torch.stack(history)


@pytest.mark.parametrize("overrides", [PENDULUM, CART_POLE, (f"{HERE}:Toy",)], ids=lambda o: o[0])
def test_it_is_an_environment(overrides: tuple[str, ...]) -> None:
    env = make(*overrides)
    check_env_specs(env)
    check_world(env)


def test_its_steps_are_the_environments() -> None:
    env, theirs = make(*PENDULUM, runs=1), PendulumEnv()
    state, their = env.reset(), theirs.reset()
    for key in ("th", "thdot"):
        their[key] = state[key][0, 0].float()
    for torque in (-2.0, 1.5, 0.0, 2.0):
        state = env.step(state.set("action", torch.tensor([[torque]]).double()))["next"]
        stepped = theirs.step(their.set("action", torch.tensor([torque])))
        for key in ("th", "thdot", "reward"):
            assert state[key].item() == stepped["next", key].item()
        their = stepped["next"].exclude("reward")


def test_observations_have_the_names_and_ranges_of_the_specs() -> None:
    world = make(f"{HERE}:Toy").world
    assert [*world.observations] == ["place_0", "place_1", "count"]  # without the picture
    assert world.observations["count"] == (0, 4)
    assert world.observations["place_0"] == (-float("inf"), float("inf"))
    low, high = world.usual["place_0"]
    assert 0 <= low < 0.1
    assert 2 < high < 5
    assert world.actions == 3
    assert make(*PENDULUM).world.actions == (-2, 2)


@pytest.mark.parametrize(("hot", "ends"), [("true", "false"), ("false", "true")])
def test_a_run_has_its_own_random_numbers_and_leaves_the_global_ones_alone(
    hot: str, ends: str
) -> None:
    toy = (f"{HERE}:Toy", f"+env.arguments.hot={hot}", f"+env.arguments.ends={ends}")
    torch.manual_seed(1)
    before = torch.get_rng_state()
    many = play(make(*toy), 9)
    assert torch.equal(torch.get_rng_state(), before)
    config = config_of("task=torchrl", *toy)
    alone = play(make_world(config.env, [1], seed=8, dtype=torch.float64), 9)
    assert (many[:, 1:2] == alone).all()
    assert len(many["place_0"].unique()) == many["place_0"].numel()
    assert many["reward"][:, 0, 0].tolist() == [step % 2 for step in range(9)]
    last = [step % 4 == 3 for step in range(9)]
    assert many["terminated"][:, 0, 0].tolist() == [each and ends == "true" for each in last]
    assert many["truncated"][:, 0, 0].tolist() == [each and ends == "false" for each in last]


def test_a_state_is_all_that_another_environment_needs_to_go_on() -> None:
    one, other = make(f"{HERE}:Toy"), make(f"{HERE}:Toy")
    state = one.reset()
    for _ in range(6):
        state = one.restart(one.step(state.set("action", state["chance"].round()))["next"])
    action = torch.ones(3, 1, dtype=torch.float64)
    ours, its = (env.step(state.clone().set("action", action))["next"] for env in (one, other))
    assert (ours == its).all()
    assert (ours["step"] == 3).all()


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        ((f"{HERE}:Two",), "its only action must be Categorical, OneHot or one bounded number"),
        ((f"{HERE}:Rows",), r"must have no batch size, not \[3\], since each run has an env"),
        (("env.kind=torchrl:math:pi",), "TypeError: .*; env.arguments has its arguments"),
        ((f"{HERE}:Nothing",), "has no attribute 'Nothing'"),
        (("env.kind=torchrl:builtins:dict",), "must make an environment of TorchRL's EnvBase"),
        ((f"{HERE}:Toy", "+env.arguments.colour=red"), "unexpected keyword argument 'colour'"),
        ((f"{HERE}:Toy", "+env.arguments.steps=[1]"), r"env\.arguments\.steps=\[1\]: must be a te"),
        ((f"{HERE}:Toy", "action=even"), "must be null, for all 3 actions"),
        (("env.kind=torchrl",), r"env\.kind=torchrl: must be acrobot, .* or your own"),
        (("env.kind=jax:brax:Ant",), r"env\.kind=jax:brax:Ant: jax adapts no other library's"),
    ],
)
def test_what_does_not_suit_is_told_in_one_line(overrides: tuple[str, ...], line: str) -> None:
    with pytest.raises(ConfigError, match=line) as refused:
        load_config("task=torchrl", *overrides)
    assert "\n" not in str(refused.value)


def test_it_is_one_command_and_runs_eagerly(tmp_path) -> None:
    assert choose_engine(config_of("task=torchrl", *CART_POLE), 1_000).name == "eager"
    words = ("task=torchrl", f"{HERE}:Toy", "situations=5", "num_seeds=2", "evaluation=none")
    assert fnnq_train(*words, f"hydra.run.dir={tmp_path}") == 0
    evaluations = read_evaluations(tmp_path / "evaluations.csv")
    assert evaluations.steps[:, -1].tolist() == [20, 20]
