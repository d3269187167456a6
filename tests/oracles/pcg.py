"""pcg4d with a third round in plain integers, after Jarzynski and Olano's listing (JCGT, 2020)."""

Words = tuple[int, int, int, int]

CHANCE = 2


def couple(x: int, y: int, z: int, w: int) -> Words:
    x = (x + y * w) % 2**32
    y = (y + z * x) % 2**32
    z = (z + x * y) % 2**32
    w = (w + y * z) % 2**32
    return x, y, z, w


def pcg4d(words: Words) -> Words:
    x, y, z, w = couple(*((word * 1664525 + 1013904223) % 2**32 for word in words))
    x, y, z, w = couple(*(word ^ (word >> 16) for word in (x, y, z, w)))
    return couple(*(word ^ (word >> 16) for word in (x, y, z, w)))


def draw(seed: int, episode: int, step: int, stream: int) -> Words:
    """Return the block of random words of a run at a step of an episode, for one stream."""
    upper = seed // 2**32 + 2**31 * (episode // 2**32)
    quarter = 2**29
    counter = 4 * quarter + (stream - CHANCE) * quarter + step
    if stream < CHANCE:
        counter = 2 * step + stream
    return pcg4d((seed % 2**32, upper, episode % 2**32, counter))
