"""Parts with slits are apart in every position, and their files read back as the exact parts.

A slit that is too short or has a wrong area would show here.
"""

import io
from contextlib import suppress

import ezdxf
import numpy as np
import pytest
import shapely

from synthesis.assembly.shapes import Shape, disc
from synthesis.assembly.stacks import StackRequest, arrange
from synthesis.errors import FieldError
from synthesis.solids.mesh import mesh_of
from synthesis.solids.plates import to_plates
from synthesis.solids.prism import Prism, material_between
from synthesis.solids.solid import FITS, parts_list, solids_of
from synthesis.solids.step import to_step
from synthesis.work import Work
from tests.conftest import some_of
from tests.oracles.assembly import motors_elsewhere, six_bars, sliders
from tests.oracles.solids import deepest, manufacture, step_shells
from tests.oracles.surface import euler_characteristic, open_edges

SLIT = Shape((23 - 3j, 47 + 7j), 3.0)
PLATE = Prism(Shape((0j, 70 + 0j, 30 + 40j), 14), 4.0, (SLIT, disc(0j, 3.0), disc(30 + 40j, 4.0)))


def parts_of(machine, fit: str = "H7"):
    """Return the parts of a machine in free layers; None if it has no such layers, or a plate has no room for a hole."""
    for boards in ("below", "both"):
        found = arrange(machine, StackRequest(boards), Work())
        if found.status == "free":
            # models of a hand's size
            unit = 200.0 / machine.size
            with suppress(FieldError):
                return solids_of(machine, found.stack, manufacture(machine, fit, unit), unit)
    return None


@pytest.fixture(scope="module")
def slides():
    """Return the parts of a linkage of each pair of guides, and of six-bars."""
    found = [
        parts_of(machine) for machines in (sliders(10), six_bars(2), motors_elsewhere(2)) for machine in machines
    ]
    found = [solids for solids in found if solids is not None]
    slits = sum(len(hole.core) > 1 for solids in found for part in solids.parts for hole in part.prism.holes)
    assert len(found) >= 9 and slits >= 6
    return found


def area(hole: Shape) -> shapely.Polygon:
    line = shapely.LineString([(end.real, end.imag) for end in hole.core])
    return line.buffer(hole.radius, quad_segs=4096)


def test_a_plate_with_a_slit_weighs_what_shapely_says() -> None:
    plate = shapely.Polygon([(0, 0), (70, 0), (30, 40)]).buffer(14, quad_segs=4096)
    left = plate.difference(shapely.unary_union([area(hole) for hole in PLATE.holes[:1]]))
    for hole in PLATE.holes[1:]:
        left = left.difference(
            shapely.Point(hole.core[0].real, hole.core[0].imag).buffer(hole.radius, quad_segs=4096)
        )
    assert PLATE.moments.area == pytest.approx(left.area, rel=1e-6)
    assert PLATE.moments.centre == pytest.approx(complex(left.centroid.x, left.centroid.y), rel=1e-6)
    assert PLATE.volume == pytest.approx(4 * left.area, rel=1e-6)
    # its thinnest wall, by shapely too
    walls = [area(SLIT).distance(plate.exterior), 4.0]
    for hole in PLATE.holes[1:]:
        centre = shapely.Point(hole.core[0].real, hole.core[0].imag)
        walls += [outline.distance(centre) - hole.radius for outline in (area(SLIT), plate.exterior)]
    assert PLATE.thinnest_wall == pytest.approx(min(walls), abs=1e-5)
    factor = 2 * np.exp(0.7j)
    turned = Prism(PLATE.shape.times(factor), 8.0, tuple(hole.times(factor) for hole in PLATE.holes))
    assert turned.volume == pytest.approx(8 * PLATE.volume)
    assert turned.moments.xx + turned.moments.yy == pytest.approx(16 * (PLATE.moments.xx + PLATE.moments.yy))
    # slits that cross, or meet a hole, leave no wall
    for second in (Shape((35 - 1j, 35 + 5j), 2.0), disc(47 + 7j, 2.0), Shape((43.9 - 6j, 44.1 + 10j), 1.0)):
        assert material_between(SLIT, second) == pytest.approx(material_between(second, SLIT))
        assert material_between(SLIT, second) <= 0


@pytest.mark.parametrize("positions", some_of([10, 50], 1))
def test_parts_with_slits_are_apart_everywhere(slides, positions) -> None:
    for solids in slides:
        deep, who = deepest(solids, positions)
        assert deep <= 1e-9 * solids.unit * solids.machine.size + 1e-9, who
        for part in solids.parts:
            mesh = mesh_of(part.prism)
            assert open_edges(mesh) == 0 and euler_characteristic(mesh) == 2 - 2 * len(part.prism.holes)
            assert part.prism.thinnest_wall > 0
        names = [part.name for part in solids.parts]
        assert len(set(names)) == len(names)
        table = parts_list(solids, FITS["H7"])
        cut = dict(zip(table["name"], table["holes"]))
        for part in solids.parts:
            for hole in part.prism.holes:
                if len(hole.core) > 1:
                    long = 2 * hole.radius + abs(hole.core[1] - hole.core[0])
                    assert f"1 x {2 * hole.radius:.6g} x {long:.6g}" in cut[part.name]


def test_step_shells_are_closed_and_dxf_contours_too(slides) -> None:
    plates = cut = 0
    for solids in slides[:6]:
        shells = step_shells(to_step(solids.parts, solids.posed(), "linkage"))
        for shell, part in zip(shells, solids.parts, strict=True):
            assert shell["closed"] and shell["euler"] == 2 - 2 * len(part.prism.holes), part.name
        document = ezdxf.read(io.StringIO(to_plates(solids)))
        assert not document.audit().errors
        space = document.modelspace()
        for part in solids.parts:
            slits = [hole for hole in part.prism.holes if len(hole.core) > 1]
            layer = part.name.upper()
            plates += bool(space.query(f'LWPOLYLINE CIRCLE[layer=="{layer}"]'))
            found = space.query(f'LWPOLYLINE[layer=="{layer}"]')
            if found:
                assert len(found) == 1 + len(slits)
                cut += len(slits)
                for line, hole in zip(found[1:], slits):
                    assert line.closed
                    bulges = [point[4] for point in line.get_points()]
                    assert bulges == pytest.approx([0, -1, 0, -1])
                    corners = [complex(*point[:2]) for point in line.get_points()]
                    assert abs(corners[1] - corners[0]) == pytest.approx(abs(hole.core[1] - hole.core[0]))
                    assert abs(corners[2] - corners[1]) == pytest.approx(2 * hole.radius)
    assert plates > 3 * len(slides[:6]) and cut >= 6
