"""Files of the slot and the groove, read back by other libraries and compared with the exact path.

The tests would detect walls that intersect, contours that are not closed, and digits lost in a file.
"""

import io
import math

import ezdxf
import numpy as np
import pytest

from synthesis.scenes.chain.crescent import Dimensions
from synthesis.scenes.chain.groove import to_dxf
from synthesis.scenes.chain.slot import crescent_slot
from tests.conftest import some_of


@pytest.fixture(scope="module")
def slot():
    return crescent_slot(Dimensions(131.0, 16, 181.78))[1]


@pytest.fixture(scope="module")
def dense(slot):
    return np.linspace(slot.start, slot.end, 4001)


def distances_to(points, curve):
    """Return the distance of each point from a dense polyline."""
    start, along = curve[:-1], np.diff(curve)
    share = ((points[:, None] - start) / along).real
    return np.abs(points[:, None] - start - np.clip(share, 0, 1) * along).min(axis=1)


# The groove


def intersections(points) -> int:
    """Count the pairs of sides of a closed polygon that intersect, by orientations of every side with every other side."""
    ends, count = np.roll(points, -1), 0
    for start, end in zip(points, ends):
        side = [((np.conj(end - start)) * (orientations - start)).imag for orientations in (points, ends)]
        orientations = [(np.conj(ends - points) * (here - points)).imag for here in (start, end)]
        count += int(np.count_nonzero((side[0] * side[1] < 0) & (orientations[0] * orientations[1] < 0)))
    return count // 2


def polygon(rows, step: float = 0.02):
    """Return points of a closed polyline with bulges, every ``step`` rad; a bulge is the tangent of a quarter of the turn."""
    points = []
    for (x, y, bulge), (x1, y1, _) in zip(rows, [*rows[1:], rows[0]]):
        start, end, turn = complex(x, y), complex(x1, y1), 4 * math.atan(bulge)
        parts = max(2, math.ceil(abs(turn) / step))
        share = np.arange(parts) / parts
        if bulge:
            centre = (start + end) / 2 + 1j * (end - start) / 2 * (1 - bulge**2) / (2 * bulge)
            points.extend(centre + (start - centre) * np.exp(1j * turn * share))
        else:
            points.extend(start + (end - start) * share)
    return np.array(points)


STEPPED = {"wheel_radius": 92.63, "lower_radius": 381.5, "eccentricity": 90.22}
CASES = {
    "closed": (lambda: crescent_slot(Dimensions(131.0, 16, 181.78))[1], 25.0),
    "slack: a step of 0.14 at the ends": (lambda: crescent_slot(Dimensions(131.0, 16, 181.78, **STEPPED))[1], 20.0),
    "a step of 4.2": (lambda: crescent_slot(Dimensions(131.0, 16, 181.78), math.radians(75))[1], 20.0),
}


@pytest.mark.parametrize("name", some_of([*CASES], 2))
def test_the_dxf_holds_the_whole_groove_as_closed_contours(name) -> None:
    make, roller = CASES[name]
    slot = make()
    document = ezdxf.read(io.StringIO(to_dxf(slot, roller)))
    assert not document.audit().errors and not document.audit().fixes
    space = document.modelspace()
    assert not space.query("ARC LINE SPLINE"), "only closed polylines are written"
    found = {entity.dxf.layer: entity for entity in space.query("LWPOLYLINE")}
    assert set(found) == {"PATH", "GROOVE_LEFT", "GROOVE_RIGHT"} and len(space.query("POINT")) == slot.chain.links
    shapes = {}
    for layer, entity in found.items():
        assert entity.closed
        rows = [tuple(row) for row in entity.get_points("xyb")]
        steps = [abs(complex(x1 - x, y1 - y)) for (x, y, _), (x1, y1, _) in zip(rows, [*rows[1:], rows[0]])]
        assert min(steps) > 1e-9 * slot.chain.pitch, "every element has a length"
        shapes[layer] = polygon(rows)
        assert intersections(shapes[layer]) == 0 or "step" in name, layer
    # each wall is at a roller radius from the path all round, and the two walls lie on different sides of it
    exact = polygon([tuple(row) for row in found["PATH"].get_points("xyb")], 0.004)
    for layer in ("GROOVE_LEFT", "GROOVE_RIGHT"):
        off = distances_to(shapes[layer], np.append(exact, exact[0]))
        assert off.max() < roller + (0.5 * roller if "step" in name else 1e-3)
        assert np.mean(np.abs(off - roller) < 1e-3) > (0.9 if "step" in name else 0.999)
    area = {layer: 0.5 * np.sum((np.conj(p) * np.roll(p, -1)).imag) for layer, p in shapes.items()}
    assert area["GROOVE_LEFT"] < area["PATH"] < area["GROOVE_RIGHT"]
