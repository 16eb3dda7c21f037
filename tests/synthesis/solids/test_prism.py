"""Areas, masses and inertias of flat parts agree with closed forms and fine polygons.

A hole that is counted twice, or a wrong sign of an arc, would show here.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.assembly.shapes import Shape
from synthesis.assembly.shapes import disc as disc_at
from synthesis.solids.prism import Prism
from synthesis.solids.solid import FITS, tolerance

LAW = settings(derandomize=True, deadline=None, max_examples=60)


def approximately(value, expected, scale=1.0):
    assert value == pytest.approx(expected, rel=1e-12, abs=1e-12 * scale)


def test_a_disc_and_a_ring_have_the_closed_forms() -> None:
    around = disc_at(3 + 4j, 2)
    disc, ring = Prism(around, 5), Prism(around, 5, (disc_at(3 + 4j, 1),))
    approximately(disc.volume, 20 * np.pi)
    approximately([disc.moments.xx, disc.moments.yy, disc.moments.xy], [4 * np.pi, 4 * np.pi, 0], 10)
    approximately(ring.moments.area, 3 * np.pi)
    approximately(ring.moments.xx, 15 / 4 * np.pi)
    approximately(ring.moments.centre, 3 + 4j)
    mass = disc.mass(2.0)
    approximately(mass.mass, 40 * np.pi)
    approximately(np.diag(mass.inertia), 40 * np.pi * np.array([4 / 4 + 25 / 12, 4 / 4 + 25 / 12, 4 / 2]))
    approximately(mass.centre, [3, 4, 2.5])


@LAW
@given(st.floats(1, 40), st.floats(-50, 50), st.floats(3, 50), st.floats(1, 20))
def test_a_rounded_triangle_is_what_fine_polygons_tend_to(base, x, y, radius) -> None:
    prism = Prism(Shape((0j, complex(base), complex(x, y)), radius), 1)
    # sampled far finer than the mesh's
    points = []
    for start, arc in prism.contours[0]:
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
    plate = Prism(Shape((0j, 72 + 0j), 7.125), 3)
    mass, base = plate.mass(2e-6), plate.moments
    across = 72 * 14.25**3 / 12 + np.pi * 7.125**4 / 4  # about the line between its holes
    approximately(mass.inertia[0, 0], 2e-6 * 3 * across + mass.mass * 9 / 12)
    approximately(mass.inertia[1, 1], 2e-6 * 3 * base.xx + mass.mass * 9 / 12)
    approximately(mass.inertia[2, 2], 2e-6 * 3 * (base.xx + across))
    assert mass.inertia[0, 0] < mass.inertia[1, 1] < mass.inertia[2, 2]
    turn = np.exp(0.6j)
    there = Prism(plate.shape.times(turn), 3).mass(2e-6, 5 - 2j, 4.0)
    rotation = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
    approximately(there.centre, rotation @ mass.centre + [5.0, -2.0, 4.0], 100)
    approximately(there.inertia, rotation @ mass.inertia @ rotation.T, 1.0)
