"""A segment crosses a triangle if and only if it does so in rational arithmetic.

Rounding near an edge, degenerate triangles and parallel segments would otherwise give a wrong verdict.
"""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.scenes.knotter.segment_triangle import crosses_inside, orientations

TRIANGLE = ((0.0, 16.0, -12.0), (0.0, 8.0, -28.0), (0.0, 0.0, 0.0))


def naive_crosses(p, q, a, b, c) -> bool:
    """Solve for the crossing by Cramer's rule in rational arithmetic."""
    p, q, a, b, c = ([Fraction(float(x)) for x in point] for point in (p, q, a, b, c))

    def minus(u, v):
        return [x - y for x, y in zip(u, v)]

    def determinant(u, v, w):
        return sum(u[k] * (v[(k + 1) % 3] * w[(k + 2) % 3] - v[(k + 2) % 3] * w[(k + 1) % 3]) for k in range(3))

    ab, ac, pq, ap = minus(b, a), minus(c, a), minus(q, p), minus(p, a)
    denominator = -determinant(ab, ac, pq)
    if denominator == 0:
        return False
    t = determinant(ab, ac, ap) / denominator
    u, v = -determinant(ap, ac, pq) / denominator, -determinant(ab, ap, pq) / denominator
    return 0 < t < 1 and min(u, v, 1 - u - v) > 0


grid_point = st.tuples(*[st.integers(-2, 2).map(float)] * 3)


@settings(derandomize=True, max_examples=400, deadline=None)
@given(st.tuples(*[grid_point] * 5))
def test_all_cases_on_a_coarse_lattice(points) -> None:
    assert crosses_inside(orientations(*points)) == naive_crosses(*points)


@pytest.mark.parametrize("offset", [(0.0, 0.0), (333.0, -1429.0)])
@pytest.mark.parametrize("distance", [1e-1, 1e-6, 1e-10, 1e-12, 1e-14])
def test_no_wrong_sign_next_to_an_edge(distance: float, offset) -> None:
    """The orientations are correct at distances at which a sum of angles decides at random."""
    random = np.random.default_rng(7)
    a, b, c = (np.add(point, (0.0, *offset)) for point in TRIANGLE)
    along = b - a
    inward = np.cross(along, (1.0, 0.0, 0.0))
    inward *= np.sign(inward @ (c - a)) / np.linalg.norm(inward)
    for side in (-1, 1):
        points = a + random.uniform(0.01, 0.99, (60, 1)) * along + side * distance * inward
        p, q = np.add(points, (3.0, 0.0, 0.0)), np.subtract(points, (2.0, 0.0, 0.0))
        expected = [naive_crosses(*row, a, b, c) for row in zip(p, q)]
        if distance >= 1e-12:
            assert set(expected) == {side > 0}
        crosses = crosses_inside(orientations(tuple(p.T), tuple(q.T), tuple(a), tuple(b), tuple(c)))
        assert list(crosses) == expected
