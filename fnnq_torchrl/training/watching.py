"""Replays of a finished job's test situations, and pictures of them."""

from collections.abc import Sequence
from pathlib import Path

import torch
from PIL import Image
from tensordict import TensorDict

from envs.canvas import Canvas, Shot
from envs.core.pure import PureEnv
from envs.drawing import shot_of
from fnnq_torchrl.agent.candidates import make_candidates
from fnnq_torchrl.agent.values import make_value_network
from fnnq_torchrl.config.schema import Config, ConfigError
from fnnq_torchrl.files.atomic import atomic_write
from fnnq_torchrl.training.evaluation import FIRST_EPISODE, GreedyTest, world_of_tests
from fnnq_torchrl.training.start import read_start
from fnnq_torchrl.training.weights import Checkpoint

Film = list[Shot]
"""The shots of a situation: its start and every step up to its end."""

FRAME_S = 0.1
"""The duration of a frame, in s."""


@torch.no_grad()
def play(
    config: Config, checkpoint: Checkpoint, seeds: Sequence[int], situations: int, *, learned: bool
) -> list[list[Film]]:
    """Replay the first situations of a job's last test, or of its test before learning.

    The situations are those that evaluations.csv counts, with the same random numbers.

    Args:
        config: the job's configuration.
        checkpoint: the job's checkpoint.
        seeds: the seeds of the runs to replay.
        situations: the number of situations to replay.
        learned: whether to replay the last test, with the learned weights; otherwise the first
            test, with the weights before learning.

    Returns:
        For each seed, the films of its situations.

    Raises:
        ConfigError: if there is no run with one of the seeds; or as in :func:`.read_start`, for
            the test before learning.
        ConfigError: if the job's world has no pictures.
    """
    known = checkpoint.seed.tolist()
    if missing := [seed for seed in seeds if seed not in known]:
        raise ConfigError(
            f"seed={missing[0]}: must be a seed of the job, {known[0]} to {known[-1]}"
        )
    dtype = getattr(torch, config.machine.dtype)
    lanes = len(seeds) * situations
    network = make_value_network(config.value, make_candidates(config, dtype), lanes)
    start = None if learned else read_start(config)
    if start is not None:
        start.put_into(network)
    rows = [known.index(seed) for seed in seeds for _ in range(situations)]
    seed = checkpoint.seed[rows].unsqueeze(-1)
    weights = network.start(seed)
    if learned:
        weights = {name: checkpoint.weights[name][rows] for name in weights}
    fixed = config.evaluation.fixed
    test = GreedyTest(
        world_of_tests(config),
        network,
        # A job without tests has none to replay, so its situations are new ones.
        (config.evaluation.tests or situations)
        if fixed is None
        else torch.tensor(fixed, dtype=dtype),
    )
    env = test.make_env(lanes)
    situation = torch.arange(situations).repeat(len(seeds))
    evaluation = config.situations // config.evaluation.every if learned else 0
    episode = FIRST_EPISODE + evaluation * test.tests + situation
    world = env.start(seed, episode.unsqueeze(-1), test.starts(situation))
    films = _films(env, test, world, weights)
    return [films[i : i + situations] for i in range(0, lanes, situations)]


def _films(
    env: PureEnv, test: GreedyTest, world: TensorDict, weights: dict[str, torch.Tensor]
) -> list[Film]:
    """Play every situation to its end and return the films."""
    never = torch.zeros_like(world["chance"])
    no = torch.zeros_like(never, dtype=torch.bool)
    stays = TensorDict({"weights": weights, "epsilon": never}, world.batch_size)
    counts = {"over": no, "success": no, "return": never, "length": never.to(torch.int32)}
    state = TensorDict({"world": world} | counts, world.batch_size)
    step = test.make_step(len(world))
    films = [[shot_of(env, world, lane)] for lane in range(len(world))]
    while not state["over"].all():
        before, state = state, step(stays, state)
        for lane in (~before["over"]).squeeze(-1).nonzero().flatten().tolist():
            films[lane].append(
                shot_of(
                    env,
                    state["world"]
                    .clone()
                    .update(
                        {
                            "reward": state["return"] - before["return"],
                            "done": state["over"],
                            "success": state["success"],
                        }
                    ),
                    lane,
                )
            )
    return [film[0].in_view(film) for film in films]


def panel_title(situation: int, learned: bool, seed: int | None = None) -> str:
    """Return a panel's title.

    Args:
        situation: the situation's number in the test, counted from 1.
        learned: whether the film was made after learning.
        seed: the run's seed, if the title should name the run.
    """
    of_run = "" if seed is None else f"run {seed}, "
    return f"{'after' if learned else 'before'} learning, {of_run}situation {situation}"


def write_gif(
    films: Sequence[Film],
    titles: Sequence[str],
    path: Path,
    *,
    size_px: int,
    every: int,
    columns: int | None = None,
) -> None:
    """Write an animated GIF with a panel for each film, atomically.

    Args:
        films: the film of each panel; a shorter film stays at its last shot.
        titles: the titles of the panels.
        path: the file to write.
        size_px: the width of a panel.
        every: the number of steps from one frame to the next.
        columns: the number of columns; by default about the number of rows.
    """
    canvas = Canvas(len(films), size_px, titles, columns)
    last = max(map(len, films)) - 1
    moments = [*range(0, last, every), last]
    frames = [
        Image.fromarray(canvas.draw([film[: moment + 1] for film in films])) for moment in moments
    ]
    # One palette for all frames means less flicker and fewer bytes. The last frame has all colours.
    palette = frames[-1].quantize(
        _COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
    )
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations_ms = [round(1000 * FRAME_S)] * (len(frames) - 1) + [_PAUSE_MS]
    with atomic_write(path) as file:
        first, *others = frames
        first.save(file, "GIF", save_all=True, append_images=others, duration=durations_ms, loop=0)


def write_strip(film: Film, title: str, path: Path, *, size_px: int, stills: int = 5) -> None:
    """Write a PNG of stills side by side, from a situation's start to its end, atomically.

    Args:
        film: the shots of the situation.
        title: the title of the first still.
        path: the file to write.
        size_px: the width of a still.
        stills: the number of stills, at least 2.
    """
    canvas = Canvas(stills, size_px, [title] + [" "] * (stills - 1), columns=stills)
    moments = [round(number * (len(film) - 1) / (stills - 1)) for number in range(stills)]
    image = Image.fromarray(canvas.draw([film[: moment + 1] for moment in moments]))
    with atomic_write(path) as file:
        image.save(file, "PNG")


_COLOURS = 64
_PAUSE_MS = 1500  # duration of the last frame
