"""Random numbers: pcg4d equals its twin, and words and numbers pass statistical tests."""

import math
from itertools import pairwise, product

import pytest
import torch
from hypothesis import example, given
from hypothesis import strategies as st
from scipy import stats
from torch import Tensor

from envs.core import streams
from envs.core.streams import Stream
from tests.oracles import pcg as oracle

DTYPES = torch.float32, torch.float64
FAIR = 0.01  # samples are fixed, so a p-value above this stays above it

word = st.integers(0, 2**32 - 1)


def tensors(numbers) -> tuple[Tensor, ...]:
    return tuple(torch.tensor(number) for number in numbers)


def as_words(numbers) -> Tensor:
    return torch.tensor(numbers).int()


def numbers(words: Tensor) -> tuple[int, ...]:
    return tuple(int(word) % 2**32 for word in words)


def sample(size: int = 2**14, stream: Stream = Stream.STEP) -> Tensor:
    """Return the blocks of random words of many runs at many steps."""
    seed, step = torch.arange(128).repeat(size // 128), torch.arange(size) // 128
    return streams.draw(seed, torch.full_like(seed, 7), step, stream)


# -- words ----------------------------------------------------------------------------------------


@given(word, word, word, word)
@example(0, 0, 0, 0)
@example(2**32 - 1, 2**32 - 1, 2**32 - 1, 2**32 - 1)
def test_the_hash_equals_its_twin(x, y, z, w):
    words = streams.pcg4d(as_words((x, y, z, w)))
    assert numbers(words) == oracle.pcg4d((x, y, z, w))


def test_every_bit_of_the_input_changes_half_of_the_output():
    inputs = torch.randint(2**32, (4, 2**11), generator=torch.Generator().manual_seed(0))
    words = streams.pcg4d(inputs.int())
    for position, bit in product(range(4), range(32)):
        changed = inputs.clone()
        changed[position] ^= 1 << bit
        flips = streams.pcg4d(changed.int()) ^ words
        ones = torch.stack([(flips >> i) & 1 for i in range(32)]).double().mean(-1)
        # A change of the highest input bits spreads less.
        assert (ones - 0.5).abs().max() < (0.06 if bit < 24 else 0.5)
        assert ones.mean() == pytest.approx(0.5, abs=0.05)


@given(
    st.integers(0, 2**63 - 1),
    st.integers(0, 2**33 - 1),
    st.integers(0, 2**29 - 1),
    st.sampled_from(Stream),
)
@example(2**32, 2**32, 0, Stream.STEP)
@example(2**63 - 1, 2**33 - 1, 2**29 - 1, Stream.START)
def test_a_draw_is_keyed_by_run_and_counted_by_time(seed, episode, step, stream):
    words = streams.draw(*tensors((seed, episode, step)), stream)
    assert numbers(words) == oracle.draw(seed, episode, step, stream)


def test_every_run_time_and_stream_has_words_of_its_own():
    seeds = [0, 1, 2, 2**32 - 1, 2**32, 2**32 + 1, 2**33, 2**62, 2**63 - 1]
    episodes = [0, 1, 2, 119, 2**32 - 1, 2**32, 2**32 + 1, 2**33 - 1]
    steps = [0, 1, 2, 119, 120, 2**29 - 1]
    when = torch.tensor(list(product(seeds, episodes, steps))).T
    blocks = torch.cat([streams.draw(*when, stream).T for stream in Stream])
    assert len(blocks) == len(Stream) * len(seeds) * len(episodes) * len(steps)
    assert len(blocks.unique(dim=0)) == len(blocks)
    assert len(blocks.unique()) == blocks.numel()  # two equal words in 3,456 can happen by chance


COUNT = 2**18


@pytest.mark.parametrize(
    ("seed_bits", "episode_bits"), [(0, 0), (18, 0), (0, 18), (9, 0), (0, 9), (6, 6)]
)
def test_bytes_of_neighbours_are_even_and_independent(seed_bits, episode_bits):
    """Seeds, episodes and steps are small consecutive numbers; the words must not show it."""
    n = torch.arange(COUNT)
    seed, rest = n % 2**seed_bits, n >> seed_bits
    episode, step = rest % 2**episode_bits, rest >> episode_bits
    words = streams.draw(seed, episode, step, Stream.STEP)
    parts = torch.stack([(words >> shift) & 0xFF for shift in (0, 8, 16, 24)]).flatten(0, 1)
    p_values = [evenness(part, 256) for part in parts]
    # Pairs of bytes: of two neighbours in the sequence, and of the same block.
    p_values += [evenness(part[::2] * 256 + part[1::2], 2**16) for part in parts]
    p_values += [evenness(a * 256 + b, 2**16) for a, b in pairwise(parts)]
    assert min(p_values) > FAIR / len(p_values)


def evenness(values: Tensor, cells: int) -> float:
    return stats.chisquare(values.bincount(minlength=cells).numpy()).pvalue


def test_words_dont_depend_on_the_batch():
    words = sample(256)
    for i in (0, 100, 255):
        seed, episode, step = torch.tensor(i % 128), torch.tensor(7), torch.tensor(i // 128)
        assert streams.draw(seed, episode, step, Stream.STEP).equal(words[:, i])


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
    u = streams.uniform(sample(), torch.float64).view(4, 128, 128)  # word, step, run
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
