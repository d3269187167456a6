"""SplitMix64 in plain integers, as in the paper of Steele, Lea and Flood (OOPSLA'14)."""

Words = tuple[int, int, int, int]

GAMMA = 0x9E3779B97F4A7C15
STREAMS = 2


def mix(z: int) -> int:
    """The generator's output for a state."""
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
    return z ^ (z >> 31)


def splitmix(state: int, n: int) -> int:
    """The n-th output, counted from 1: every output adds γ to the state, and mixes it."""
    return mix((state + n * GAMMA) % 2**64)


def draw(seed: int, episode: int, step: int, stream: int) -> Words:
    """The block of a run at a step of an episode, for one purpose."""
    key = splitmix(splitmix(0, seed + 1), episode + 1)
    block = 2 * (STREAMS * step + stream)
    first, second = (splitmix(key, block + n) for n in (1, 2))
    return *divmod(first, 2**32), *divmod(second, 2**32)
