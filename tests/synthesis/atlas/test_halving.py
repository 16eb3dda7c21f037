"""The order of cells: as a plain recursion has it, however many types are worked on at a time."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from synthesis.atlas import halving
from synthesis.atlas.series import Bucket, in_memory


def bucket(count: int, harmonics: int, seed: int) -> Bucket:
    """Types with coefficients that repeat, so that ties are many, and some beyond what is told apart."""
    rng = np.random.default_rng(seed)
    series = rng.normal(size=(count, 6 * harmonics)).round(1) * rng.choice([1e-3, 1.0, 9.0], 6 * harmonics)
    nothing = np.zeros(count)
    return Bucket(np.arange(count), 0, harmonics, series, nothing, nothing)


def naive(features: np.ndarray, members: list[int], depth: int) -> list[list[int]]:
    """Cells by a recursion over lists of Python's whole numbers."""
    if not depth:
        return [members]
    values = [[int(features[place, k]) for place in members] for k in range(features.shape[1])]
    spreads = [len(some) * sum(v * v for v in some) - sum(some) ** 2 for some in values]
    widest = spreads.index(max(spreads))
    ranked = sorted(members, key=lambda place: (int(features[place, widest]), place))
    half = len(members) // 2
    low, high = sorted(ranked[:half]), sorted(ranked[half:])
    return naive(features, low, depth - 1) + naive(features, high, depth - 1)


@pytest.mark.parametrize(
    ("count", "harmonics", "seed"), [(1, 5, 0), (7, 5, 1), (500, 5, 2), (1031, 3, 3), (2048, 8, 4)]
)
def test_the_order_is_that_of_a_plain_recursion(count, harmonics, seed, monkeypatch) -> None:
    types = bucket(count, harmonics, seed)
    columns = 2 * min(halving.HARMONICS, harmonics)
    limit = halving._LARGEST
    features = np.rint(types.periodic[:, :columns] / halving.STEP).clip(-limit, limit).astype(int)
    found: list[Any] = []
    for at_once in (16, 100, 1 << 18):
        monkeypatch.setattr(halving, "AT_ONCE", at_once)
        order, begins = halving.halve(types, 6, in_memory)
        found.append((order.tolist(), begins.tolist()))
    assert found[0] == found[1] == found[2]
    order, begins = found[0]
    cells = [order[begin:end] for begin, end in pairwise(begins)]
    assert cells == naive(features, list(range(count)), len(cells).bit_length() - 1)
    assert max(map(len, cells)) <= 6 and sorted(order) == list(range(count))
