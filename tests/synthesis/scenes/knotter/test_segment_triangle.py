"""Does a segment cross a triangle: against rational arithmetic, and in every named case."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.scenes.knotter.conditions import (
    Crossing,
    classify,
    crossing_point,
    inside,
    orientations,
    segment_distance,
    segment_triangle_distance,
)

TRIANGLE = ((0.0, 16.0, -12.0), (0.0, 8.0, -28.0), (0.0, 0.0, 0.0))


def naive_classify(p, q, a, b, c) -> Crossing:
    """Cramer's rule over the rationals: the crossing's place on the segment and in the triangle."""
    p, q, a, b, c = ([Fraction(float(x)) for x in point] for point in (p, q, a, b, c))

    def minus(u, v):
        return [x - y for x, y in zip(u, v)]

    def determinant(u, v, w):
        return sum(u[k] * (v[(k + 1) % 3] * w[(k + 2) % 3] - v[(k + 2) % 3] * w[(k + 1) % 3]) for k in range(3))

    ab, ac, pq, ap = minus(b, a), minus(c, a), minus(q, p), minus(p, a)
    normal = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]]
    if normal == [0, 0, 0]:
        return Crossing.DEGENERATE
    whole = -determinant(ab, ac, pq)
    if whole == 0:
        return Crossing.PARALLEL if determinant(ab, ac, ap) else Crossing.IN_PLANE
    t = determinant(ab, ac, ap) / whole
    u, v = -determinant(ap, ac, pq) / whole, -determinant(ab, ap, pq) / whole
    if not 0 <= t <= 1:
        return Crossing.SAME_SIDE
    least = min(u, v, 1 - u - v)
    if least < 0:
        return Crossing.MISSES
    return Crossing.CROSSES if least > 0 and 0 < t < 1 else Crossing.TOUCHES


grid_point = st.tuples(*[st.integers(-2, 2).map(float)] * 3)
any_point = st.tuples(*[st.floats(-50, 50, allow_nan=False)] * 3)


@settings(derandomize=True, max_examples=400, deadline=None)
@given(st.tuples(*[grid_point] * 5))
def test_every_case_on_a_coarse_lattice(points) -> None:
    assert classify(*points) == naive_classify(*points)


@settings(derandomize=True, max_examples=200, deadline=None)
@given(st.tuples(*[any_point] * 5))
def test_every_case_anywhere(points) -> None:
    assert classify(*points) == naive_classify(*points)


@pytest.mark.parametrize("scale", [1e-100, 1e-9, 1e9, 1e60])
def test_size_does_not_matter(scale: float) -> None:
    points = [np.array(point) * scale for point in ((1.0, 4.0, -10.0), (-1.0, 7.0, -12.0), *TRIANGLE)]
    assert classify(*points) == Crossing.CROSSES


@pytest.mark.parametrize("offset", [(0.0, 0.0), (333.0, -1429.0)])
@pytest.mark.parametrize("distance", [1e-1, 1e-6, 1e-10, 1e-12, 1e-14])
def test_no_wrong_sign_beside_an_edge(distance: float, offset) -> None:
    """Where a sum of angles decides at random, the orientations are right; truth by rational arithmetic."""
    random = np.random.default_rng(7)
    a, b, c = (np.add(point, (0.0, *offset)) for point in TRIANGLE)
    along = b - a
    inward = np.cross(along, (1.0, 0.0, 0.0))
    inward *= np.sign(inward @ (c - a)) / np.linalg.norm(inward)
    for side in (-1, 1):
        at = a + random.uniform(0.01, 0.99, (60, 1)) * along + side * distance * inward
        p, q = np.add(at, (3.0, 0.0, 0.0)), np.subtract(at, (2.0, 0.0, 0.0))
        truth = [naive_classify(*row, a, b, c) for row in zip(p, q)]
        assert list(classify(p, q, a, b, c)) == truth
        if distance >= 1e-12:
            assert set(truth) == {Crossing.CROSSES if side > 0 else Crossing.MISSES}
        plain = inside(orientations(tuple(p.T), tuple(q.T), tuple(a), tuple(b), tuple(c)))
        assert list(plain) == [case == Crossing.CROSSES for case in truth]


NAMED = {
    "inside": (((1, 4, -10), (-1, 4, -10)), Crossing.CROSSES),
    "outside": (((1, 40, -10), (-1, 40, -10)), Crossing.MISSES),
    "edge": (((1, 12, -20), (-1, 12, -20)), Crossing.TOUCHES),
    "vertex": (((1, 16, -12), (-1, 16, -12)), Crossing.TOUCHES),
    "end in plane": (((0, 6, -10), (-1, 6, -10)), Crossing.TOUCHES),
    "end in plane outside": (((0, 60, -10), (-1, 60, -10)), Crossing.MISSES),
    "one side": (((1, 6, -10), (2, 60, -10)), Crossing.SAME_SIDE),
    "parallel": (((1, 6, -10), (1, 60, -10)), Crossing.PARALLEL),
    "in the plane": (((0, 6, -10), (0, 60, -10)), Crossing.IN_PLANE),
    "a point": (((1, 6, -10), (1, 6, -10)), Crossing.PARALLEL),
}


@pytest.mark.parametrize("name", NAMED)
def test_named_cases(name: str) -> None:
    (p, q), expected = NAMED[name]
    found = classify(p, q, *TRIANGLE)
    assert found == expected
    assert Crossing(int(found)).sentence
    assert classify(q, p, TRIANGLE[1], TRIANGLE[0], TRIANGLE[2]) == expected  # neither direction nor turn matters


@pytest.mark.parametrize("triangle", [(TRIANGLE[0],) * 3, (TRIANGLE[0], TRIANGLE[0], TRIANGLE[1])])
def test_triangle_without_area_is_named(triangle) -> None:
    assert classify((1, 1, 1), (-1, 1, 1), *triangle) == Crossing.DEGENERATE
    assert classify((1, 1, 1), (-1, 1, 1), (0, 0, 0), (0, 1, 2), (0, 3, 6)) == Crossing.DEGENERATE


def test_crossing_point_without_the_printed_ratio() -> None:
    """Eq 11 as printed divides by a coordinate: S1 at x = 0 gives NaN there, S0 beyond S1 a crossing."""
    p, q = (30.0, 1.0, 2.0), (0.0, 14.0, -39.0)
    assert np.array(crossing_point(p, q, *TRIANGLE)) == pytest.approx([0.0, 14.0, -39.0], abs=1e-12)
    assert classify((30, 0, 0), (22, 14, -39), *TRIANGLE) == Crossing.SAME_SIDE
    assert np.array(crossing_point((22.0, 0.0, 0.0), (22.0, 5.0, 5.0), *TRIANGLE)) == pytest.approx([22.0, 0.0, 0.0])


def test_many_at_once_are_each_alone() -> None:
    random = np.random.default_rng(1)
    p, q, a, b, c = random.integers(-3, 4, (5, 300, 3)).astype(float)
    assert list(classify(p, q, a, b, c)) == [int(classify(*points)) for points in zip(p, q, a, b, c)]


def naive_segment_triangle_distance(p, q, a, b, c) -> float:
    """The same as a quadratic programme, left to scipy."""
    from scipy.optimize import minimize

    def gap2(x) -> float:
        gap = p + x[0] * (q - p) - (a + x[1] * (b - a) + x[2] * (c - a))
        return float(gap @ gap)

    inside_edge = {"type": "ineq", "fun": lambda x: 1 - x[1] - x[2]}
    done = minimize(gap2, [0.5, 0.3, 0.3], bounds=[(0, 1)] * 3, constraints=[inside_edge], options={"ftol": 1e-14})
    return float(np.sqrt(done.fun))


@pytest.mark.parametrize("seed", range(40))
def test_distance_of_segment_and_triangle(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-10, 10, (5, 3))
    found = segment_triangle_distance(*(tuple(map(np.array, point)) for point in points))
    assert found == pytest.approx(naive_segment_triangle_distance(*points), abs=1e-5)
    assert (found == 0) == (classify(*points) == Crossing.CROSSES)


@settings(derandomize=True, max_examples=150, deadline=None)
@given(st.tuples(*[grid_point] * 4))
def test_distance_of_segments_is_symmetric_and_attained(points) -> None:
    p, q, a, b = (tuple(map(np.array, point)) for point in points)
    there, back = segment_distance(p, q, a, b), segment_distance(a, b, p, q)
    assert there == pytest.approx(float(back), abs=1e-12)
    t = np.linspace(0, 1, 101)
    on_pq = np.array(points[0]) + t[:, None, None] * (np.array(points[1]) - points[0])
    on_ab = np.array(points[2]) + t[None, :, None] * (np.array(points[3]) - points[2])
    sampled = np.sqrt(np.sum((on_pq - on_ab) ** 2, axis=-1)).min()
    assert there <= sampled + 1e-12
    assert there >= sampled - 0.15
