"""Random numbers: SplitMix64 against known answers and its twin, and what is made of its words."""

import math
from itertools import product

import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats
from torch import Tensor

from envs import streams
from envs.streams import Stream
from tests.oracles import splitmix as oracle

DTYPES = torch.float32, torch.float64
FAIR = 0.01  # samples are fixed, so a p-value above this stays above it

word = st.integers(0, 2**32 - 1)


def tensors(numbers) -> tuple[Tensor, ...]:
    return tuple(torch.tensor(number) for number in numbers)


def numbers(words: tuple[Tensor, ...]) -> tuple[int, ...]:
    return tuple(int(word) for word in words)


def sample(size: int = 2**14, stream: Stream = Stream.STEP) -> tuple[Tensor, ...]:
    """The blocks of many runs at many steps."""
    seed, step = torch.arange(128).repeat(size // 128), torch.arange(size) // 128
    return streams.draw(seed, torch.full_like(seed, 7), step, stream)


# -- words ----------------------------------------------------------------------------------------


def test_splitmix_gives_the_known_answers():
    # The first outputs from the state 1234567, as the reference implementation in C has them.
    answers = [
        6457827717110365317,
        3203168211198807973,
        9817491932198370423,
        4593380528125082431,
        16408922859458223821,
    ]
    states = [1234567 + n * oracle.GAMMA for n in range(1, 6)]
    outputs = streams.mix(torch.tensor([streams._signed(state) for state in states]))
    assert [int(output) % 2**64 for output in outputs] == answers
    assert [oracle.splitmix(1234567, n) for n in range(1, 6)] == answers


@given(st.integers(-(2**63), 2**63 - 1))
def test_mix_equals_its_twin(z):
    assert int(streams.mix(torch.tensor(z))) % 2**64 == oracle.mix(z % 2**64)


@given(
    st.integers(0, 2**63 - 1),
    st.integers(0, 2**63 - 1),
    st.integers(0, 2**32 - 1),
    st.sampled_from(Stream),
)
@example(2**32, 2**32, 0, Stream.STEP)
@example(2**63 - 1, 2**63 - 1, 2**32 - 1, Stream.START)
def test_a_draw_is_keyed_by_run_and_counted_by_time(seed, episode, step, stream):
    words = streams.draw(*tensors((seed, episode, step)), stream)
    assert numbers(words) == oracle.draw(seed, episode, step, stream)


def test_every_run_time_and_stream_has_words_of_its_own():
    seeds = [0, 1, 2, 2**32 - 1, 2**32, 2**32 + 1, 2**33, 2**62, 2**63 - 1]
    episodes = [0, 1, 2, 119, 2**32 - 1, 2**32, 2**32 + 1, 2**62]
    steps = [0, 1, 2, 119, 120, 2**32 - 1]
    when = torch.tensor(list(product(seeds, episodes, steps))).T
    blocks = torch.cat([torch.stack(streams.draw(*when, stream), -1) for stream in Stream])
    assert len(blocks) == len(Stream) * len(seeds) * len(episodes) * len(steps)
    assert len(blocks.unique(dim=0)) == len(blocks)
    assert len(blocks.unique()) == blocks.numel()  # by chance two words in 3,456 may be the same


def test_words_dont_depend_on_the_batch():
    words = torch.stack(sample(256))
    for i in (0, 100, 255):
        seed, episode, step = torch.tensor(i % 128), torch.tensor(7), torch.tensor(i // 128)
        assert torch.stack(streams.draw(seed, episode, step, Stream.STEP)).equal(words[:, i])


# -- numbers --------------------------------------------------------------------------------------


@given(word)
@example(0)
@example(2**32 - 1)
def test_uniform_is_the_same_number_in_both_precisions(w):
    single, double = (streams.uniform(torch.tensor(w), dtype) for dtype in DTYPES)
    assert (single.dtype, double.dtype) == DTYPES
    assert float(single) == float(double) == (w >> 8) / 2**24
    assert 0 <= float(double) < 1


@given(word, word, word)
@example(2**32 - 1, 2**32 - 1, 2**32 - 1)
def test_spare_uniform_is_the_same_number_in_both_precisions(high, middle, low):
    words = tensors((high, middle, low))
    single, double = (streams.spare_uniform(words, dtype) for dtype in DTYPES)
    assert (single.dtype, double.dtype) == DTYPES
    exact = ((high % 256) * 2**16 + (middle % 256) * 2**8 + low % 256) / 2**24
    assert float(single) == float(double) == exact < 1


@given(word, st.integers(0, 255))
def test_uniform_leaves_the_lowest_byte_to_coin_and_spare_uniform(w, byte):
    other = torch.tensor((w & ~0xFF) | byte)
    assert streams.uniform(other, torch.float64) == streams.uniform(torch.tensor(w), torch.float64)
    assert bool(streams.coin(other)) == byte % 2
    spare = streams.spare_uniform((other, other, other), torch.float64)
    assert float(spare) == byte * 0x010101 / 2**24


@pytest.mark.parametrize("stream", Stream)
@pytest.mark.parametrize("i", range(4))
def test_uniform_is_uniform(i, stream):
    u = streams.uniform(sample(stream=stream)[i], torch.float64).numpy()
    assert stats.kstest(u, "uniform").pvalue > FAIR


def test_spare_uniform_is_uniform():
    w = sample()
    spare = streams.spare_uniform(w[:3], torch.float64)
    assert stats.kstest(spare.numpy(), "uniform").pvalue > FAIR
    for i in range(3):
        u = streams.uniform(w[i], torch.float64)
        assert stats.spearmanr(spare.numpy(), u.numpy()).pvalue > FAIR


def test_neighbours_have_nothing_to_do_with_each_other():
    u = streams.uniform(torch.stack(sample()), torch.float64).view(4, 128, 128)  # word, step, run
    for one, other in [
        (u[:, :, 1:], u[:, :, :-1]),  # the next run
        (u[:, 1:], u[:, :-1]),  # the next step
        (u[1:], u[:-1]),  # the next word
    ]:
        assert stats.spearmanr(one.flatten().numpy(), other.flatten().numpy()).pvalue > FAIR


def test_coin_is_fair_and_independent_of_uniform():
    w = sample()[1]
    heads, u = streams.coin(w), streams.uniform(w, torch.float64)
    assert heads.dtype == torch.bool
    assert stats.binomtest(int(heads.sum()), len(heads)).pvalue > FAIR
    assert stats.ks_2samp(u[heads].numpy(), u[~heads].numpy()).pvalue > FAIR


def test_normal_is_normal():
    z = streams.normal(*sample()[:2], torch.float64).numpy()
    assert stats.kstest(z, "norm").pvalue > FAIR
    assert z.mean() == pytest.approx(0, abs=3 / math.sqrt(len(z)))
    assert z.std() == pytest.approx(1, abs=3 / math.sqrt(2 * len(z)))
    assert stats.skewtest(z).pvalue > FAIR
    assert stats.kurtosistest(z).pvalue > FAIR


def test_normal_is_finite_and_alike_in_both_precisions():
    extreme = torch.tensor([0, 255, 256, 2**31, 2**32 - 257, 2**32 - 1])
    one, other = torch.cartesian_prod(extreme, extreme).T
    single, double = (streams.normal(one, other, dtype) for dtype in DTYPES)
    assert (single.dtype, double.dtype) == DTYPES
    assert double.abs().max() <= math.sqrt(2 * 24 * math.log(2))
    torch.testing.assert_close(single.double(), double, atol=1e-6, rtol=1e-6)
