"""The value functions besides the fuzzy network, in plain Python, for one state and action."""

import math
from collections.abc import Sequence

Labels = Sequence[tuple[float, float]]


def gaussian(x: float, centre: float, sigma: float) -> float:
    return math.exp(-((x - centre) ** 2) / (2 * sigma**2))


def radial(weights: Sequence[Sequence[float]], states: Labels, actions: Labels, s: float, a: float):
    """Return Σ w·μ(s)·μ(a)."""
    return sum(
        weights[i][j] * gaussian(s, *state) * gaussian(a, *action)
        for i, state in enumerate(states)
        for j, action in enumerate(actions)
    )


def looked_up(
    weights: Sequence[Sequence[float]], states: Labels, actions: Labels, s: float, a: float
):
    """Return the weight of the cell whose labels have the highest membership."""

    def best(x: float, labels: Labels) -> int:
        return max(range(len(labels)), key=lambda i: gaussian(x, *labels[i]))

    return weights[best(s, states)][best(a, actions)]


def tile(x: float, low: float, high: float, tiles: int, offset: float) -> int:
    """Return the index of an input's tile in a tiling that is moved down by ``offset`` tiles.

    An input beyond the range has the tile at the edge. A tiling with offset 0 has ``tiles`` tiles;
    any other tiling has one more, so that it covers the range too.
    """
    number = math.floor((x - low) / (high - low) * tiles + offset)
    return min(max(number, 0), tiles if offset > 0 else tiles - 1)


def coded(weights, spans: Sequence[tuple[float, float]], tilings: int, tiles: int, s, a):
    """Return the sum over the tilings of the tile's weight at (s, a), ``weights[i][j][tiling]``."""
    total = 0.0
    for tiling in range(tilings):
        i = tile(s, *spans[0], tiles, (tiling % tilings) / tilings)
        j = tile(a, *spans[1], tiles, (3 * tiling % tilings) / tilings)
        total += weights[i][j][tiling]
    return total


def perceptron(layers, activation, normalise: bool, s: float, a: float) -> float:
    """Return a perceptron's output; its layers are (weights, biases) with a row for each unit."""
    values = [s, a]
    for number, (weights, biases) in enumerate(layers):
        if number:
            if normalise:
                mean = sum(values) / len(values)
                variance = sum((value - mean) ** 2 for value in values) / len(values)
                values = [(value - mean) / math.sqrt(variance + 1e-5) for value in values]
            values = [activation(value) for value in values]
        values = [
            sum(w * value for w, value in zip(row, values, strict=True)) + bias
            for row, bias in zip(weights, biases, strict=True)
        ]
    (value,) = values
    return value
