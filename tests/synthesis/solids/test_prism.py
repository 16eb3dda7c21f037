"""Flat parts: closed forms, Monte-Carlo-free counterparts by polygons, and rigid bodies of several parts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.solids.prism import Hole, Prism, arc_between, rounded
from synthesis.solids.solid import FITS, tolerance

LAW = settings(derandomize=True, deadline=None, max_examples=60)


def near(value, wanted, scale=1.0):
    assert value == pytest.approx(wanted, rel=1e-12, abs=1e-12 * scale)


def test_a_disc_and_a_ring_have_the_closed_forms() -> None:
    disc, ring = Prism.disc(3 + 4j, 2, 0, 5), Prism.disc(3 + 4j, 2, 0, 5, 1)
    near(disc.volume, 20 * np.pi)
    near([disc.moments.xx, disc.moments.yy, disc.moments.xy], [4 * np.pi, 4 * np.pi, 0], 10)
    near(ring.moments.area, 3 * np.pi)
    near(ring.moments.xx, 15 / 4 * np.pi)
    near(ring.moments.centre, 3 + 4j)
    mass = disc.mass(2.0)
    near(mass.mass, 40 * np.pi)
    near(np.diag(mass.inertia), 40 * np.pi * np.array([4 / 4 + 25 / 12, 4 / 4 + 25 / 12, 4 / 2]))
    near(mass.centre, [3, 4, 2.5])


def test_holes_count_against_the_area_and_far_away_loses_no_digits() -> None:
    holes = (Hole(0j, 2.85), Hole(72 + 0j, 2.85))
    plate = Prism(rounded((0j, 72 + 0j), 7.125), 0, 3, holes)
    full = Prism(plate.outline, 0, 3)
    near(plate.moments.area, full.moments.area - 2 * np.pi * 2.85**2)
    near(plate.moments.xx, full.moments.xx - 2 * np.pi * 2.85**2 * (36**2 + 2.85**2 / 4))
    there = plate.moved(np.exp(0.7j), 1e6 + 2e6j, 3.0)
    assert there.moments.area == pytest.approx(plate.moments.area, rel=1e-9)
    near(there.moved(np.exp(-0.7j), -np.exp(-0.7j) * (1e6 + 2e6j)).outline[:, 2], plate.outline[:, 2])
    near(plate.scaled(0.5).volume, plate.volume / 8)
    near(plate.thinnest_wall, 3.0)
    near(Prism(plate.outline, 0, 9, holes).thinnest_wall, 7.125 - 2.85)


@LAW
@given(st.floats(1, 40), st.floats(-50, 50), st.floats(3, 50), st.floats(1, 20))
def test_a_rounded_triangle_is_what_fine_polygons_tend_to(base, x, y, radius) -> None:
    prism = Prism(rounded((0j, complex(base), complex(x, y)), radius), 0, 1)
    # sampled far finer than the mesh's
    points = []
    for start, arc in zip(prism.corners, prism.arcs):
        points += [start] if arc is None else list(arc.at(np.arange(2000) / 2000))
    ring = np.array(points)
    on = np.roll(ring, -1)
    cross = np.imag(np.conj(ring) * on)
    area = cross.sum() / 2
    assert prism.moments.area == pytest.approx(area, rel=1e-6)
    assert prism.moments.centre == pytest.approx(((ring + on) * cross).sum() / 6 / area, rel=1e-5, abs=1e-5)
    xx = ((ring.real**2 + ring.real * on.real + on.real**2) * cross).sum() / 12
    assert prism.moments.xx + area * prism.moments.centre.real**2 == pytest.approx(xx, rel=1e-5)
    both = 2 * ring.real * ring.imag + ring.real * on.imag + on.real * ring.imag + 2 * on.real * on.imag
    xy = np.sum(cross * both)
    mixed = prism.moments.xy + area * prism.moments.centre.real * prism.moments.centre.imag
    assert mixed == pytest.approx(xy / 24, rel=1e-5, abs=1e-5 * xx)


@LAW
@given(st.complex_numbers(max_magnitude=10), st.complex_numbers(min_magnitude=1, max_magnitude=9), st.floats(0.05, 3))
def test_an_arc_ends_where_its_bulge_says(start, way, bulge) -> None:
    for sign in (1, -1):
        arc = arc_between(start, start + way, sign * bulge)
        ends = arc.at(np.array([0.0, 1.0]))
        assert max(abs(ends[0] - start), abs(ends[1] - start - way)) < 1e-9 * max(1, arc.radius)
        middle = arc.at(np.array([0.5]))[0]
        # the sagitta is the bulge times half the chord, to the right of the way where the bulge is positive
        assert (start + way / 2 - 1j * way / 2 * sign * bulge) == pytest.approx(middle, abs=1e-8 * max(1, arc.radius))


@pytest.mark.parametrize(
    ("diameter", "hole", "pin"),
    # ISO 286-2: tables of H7 and g6
    [
        (3, "H7 +0.01/0", "g6 -0.002/-0.008"),
        (5.7, "H7 +0.012/0", "g6 -0.004/-0.012"),
        (12, "H7 +0.018/0", "g6 -0.006/-0.017"),
        (30, "H7 +0.021/0", "g6 -0.007/-0.02"),
        (100, "H7 +0.035/0", "g6 -0.012/-0.034"),
        (500, "H7 +0.063/0", "g6 -0.02/-0.06"),
        (501, "", ""),
    ],
)
def test_tolerances_are_those_of_the_standard(diameter, hole, pin) -> None:
    assert (tolerance(diameter, True), tolerance(diameter, False)) == (hole, pin)
    assert FITS["print"].turning > FITS["print"].held >= 0


def test_the_inertia_of_a_long_plate_is_least_about_its_length_and_turns_with_it() -> None:
    plate = Prism(rounded((0j, 72 + 0j), 7.125), 0, 3)
    one, base = plate.mass(2e-6), plate.moments
    across = 72 * 14.25**3 / 12 + np.pi * 7.125**4 / 4  # about the line between its holes
    near(one.inertia[0, 0], 2e-6 * 3 * across + one.mass * 9 / 12)
    near(one.inertia[1, 1], 2e-6 * 3 * base.xx + one.mass * 9 / 12)
    near(one.inertia[2, 2], 2e-6 * 3 * (base.xx + across))
    assert one.inertia[0, 0] < one.inertia[1, 1] < one.inertia[2, 2]
    turn, shift = np.exp(0.6j), 5 - 2j
    there = plate.moved(turn, shift, 4.0).mass(2e-6)
    wanted = one.turned(turn, np.array([5.0, -2.0, 4.0]))
    near(there.centre, wanted.centre, 100)
    near(there.inertia, wanted.inertia, 1.0)
