"""Plates to cut have closed contours that do not cross, with holes at the joints.

A contour in a wrong unit, or a hole beside its joint, would show here.
"""

import io
from itertools import combinations

import ezdxf
import ezdxf.path
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.linkage import Linkage, four_bar
from synthesis.solids.plates import to_plates

LINKS = ("CRANK", "COUPLER", "ROCKER", "GROUND")
LAW = settings(derandomize=True, deadline=None, max_examples=30)


def crosses_itself(ring: np.ndarray) -> bool:
    """Return true if two sides of a closed polygon cross, by the sides on which their ends lie."""
    a, b = ring[:, None], np.roll(ring, -1)[:, None]
    c, d = a.T, b.T

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return np.sign((np.conj(q - p) * (r - p)).imag)

    return bool(np.any((side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)))


def polygon(entity) -> np.ndarray:
    """A contour as a polygon, its arcs divided finely."""
    path = ezdxf.path.make_path(entity)
    return np.array([complex(*point.vec2) for point in path.flattening(0.05, segments=16)])


def read(text: str):
    document = ezdxf.read(io.StringIO(text))
    audit = document.audit()
    assert not audit.errors and not audit.fixes
    return document.modelspace()


def check(linkage: Linkage, text: str, unit_mm: float, hole: float, width: float) -> None:
    space, outlines = read(text), []
    for name, length in zip(LINKS, linkage.links):
        (contour,) = space.query(f'LWPOLYLINE[layer=="{name}"]')
        assert contour.closed
        ring = polygon(contour)
        assert abs(ring[0] - ring[-1]) < 1e-9 * np.abs(ring).max()
        ring = ring[:-1]
        assert not crosses_itself(ring)
        assert np.sum((np.conj(ring) * np.roll(ring, -1)).imag) > 0, "counter-clockwise, with an inside"
        centres = [complex(*circle.dxf.center.vec2) for circle in space.query(f'CIRCLE[layer=="{name}"]')]
        assert abs(abs(centres[1] - centres[0]) - length * unit_mm) < 1e-9 * length * unit_mm
        for circle in space.query(f'CIRCLE[layer=="{name}"]'):
            assert circle.dxf.radius == pytest.approx(hole / 2 * unit_mm)
        for centre in centres:
            turned = np.sum(np.angle((np.roll(ring, -1) - centre) / (ring - centre)))
            assert turned == pytest.approx(2 * np.pi), "inside"
            # a polygon cuts the arcs by at most 0.05 mm
            assert np.abs(ring - centre).min() > width / 2 * unit_mm * (1 - 1e-6) - 0.05
        for first, second in combinations(centres, 2):
            assert abs(first - second) > hole * unit_mm
        outlines.append(ring)
        if name == "COUPLER" and linkage.coupler_point_polar is not None:
            (mark,) = space.query('POINT[layer=="MARK"]')
            radius, angle = linkage.coupler_point_polar
            position = complex(*mark.dxf.location.vec2)
            expected = radius * np.exp(1j * angle) * unit_mm
            off = (position - centres[0]) / ((centres[1] - centres[0]) / (length * unit_mm)) - expected
            assert abs(off) < 1e-6 * unit_mm * length
            assert len(centres) == 3 or min(abs(position - centre) for centre in centres) <= hole * unit_mm * (
                1 + 1e-9
            )
    for first, second in combinations(outlines, 2):
        assert first.imag.min() > second.imag.max() or second.imag.min() > first.imag.max(), "side by side"


@LAW
@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.95), st.floats(1.1, 6.0), st.sampled_from([1.0, 25.4]))
def test_plates_are_closed_and_hold_their_joints(seed, hole, width, unit_mm) -> None:
    random = np.random.default_rng(seed)
    links = tuple(random.uniform(5, 100, 4).tolist())
    point = (float(random.uniform(0, 120)), float(random.uniform(-3.2, 3.2)))
    linkage = four_bar(links, coupler_point_polar=point)
    hole *= min(links)
    check(linkage, to_plates(linkage, unit_mm, hole, width * hole), unit_mm, hole, width * hole)


ON_THE_LINE = [(0.0, 0.0), (72.0, 0.0), (36.0, 0.0), (100.0, 0.0), (30.0, np.pi), (30.0, 1e-13), (72.0, 1e-6)]


@pytest.mark.parametrize("point", [None, *ON_THE_LINE, (1e-9, 2.0)])
def test_a_body_point_on_the_coupler_line_or_at_a_pin_leaves_a_bar(point) -> None:
    linkage = four_bar((19.0, 72.0, 144.0, 165.0), coupler_point_polar=point)
    check(linkage, to_plates(linkage), 1.0, 5.7, 14.25)
