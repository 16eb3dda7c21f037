"""One set of part settings: what layers are checked with is what every file holds, and defaults are sizes that can be bought.

Bugs that these tests would catch: plates cut with another hole than was checked for collisions, a scale that changes STEP and not
the plates, and a default pin of 4.37 mm.
"""

import csv
import io
import re
from typing import Any

import ezdxf
import ezdxf.path
import numpy as np
import pytest
import shapely
import shapely.affinity

import linkage_atlas as la
from linkage_atlas.part_settings import HOLES, SHEETS, WASHERS

LINKAGES = [(19, 72, 144, 165), (51.31, 83.79, 101.4, 115.14), (30, 60, 70, 50), (6.3, 9.9, 11.2, 14.1)]


def circles(text: bytes, layer: str) -> set[float]:
    space = ezdxf.read(io.StringIO(text.decode())).modelspace()
    return {round(2 * entity.dxf.radius, 9) for entity in space.query(f'CIRCLE[layer=="{layer}"]')}


def length(text: bytes, layer: str) -> float:
    """Longest distance of two vertices of a layer's contour along x, plus its ends."""
    (outline,) = ezdxf.read(io.StringIO(text.decode())).modelspace().query(f'LWPOLYLINE[layer=="{layer}"]')
    points = np.array([[x, y] for x, y, *_ in outline.get_points()])
    return float(np.ptp(points[:, 0]) + np.ptp(points[:, 1]))


def step_of(linkage: la.FourBar, settings: dict[str, Any]) -> str:
    return linkage.file("step", assembly=settings or True).decode()


@pytest.mark.parametrize("links", LINKAGES)
@pytest.mark.parametrize("unit, millimetres", [("mm", 1.0), ("in", 25.4), ("cm", 10.0)])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_default_sizes_are_standard_ones_as_made(
    links: tuple[float, ...], unit: str, millimetres: float, scale: float
) -> None:
    sizes = la.FourBar(*links).assembly(length_unit=unit, scale=scale).sizes
    built = {name: value * millimetres * scale for name, value in sizes._asdict().items()}
    if built["hole"] < 1:
        return
    largest = min(0.3 * min(links), 0.05 * max(links))
    assert sizes.hole <= largest * (1 + 1e-9)
    assert built["width"] == pytest.approx(round(built["width"]))
    for name, known in (("hole", HOLES), ("thickness", SHEETS), ("washer", WASHERS)):
        assert min(abs(built[name] - standard) for standard in known) < 1e-9, name


@pytest.mark.parametrize(
    "settings",
    [{}, {"hole": 5, "width": 14, "thickness": 4}, {"scale": 0.5}, {"hole": 6, "width": 16, "scale": 2, "kerf": 0.3}],
)
def test_every_file_has_the_sizes_that_were_checked(settings: dict[str, Any]) -> None:
    linkage = la.FourBar(40, 90, 80, 110, coupler_point_polar=(50, 20))
    checked, scale, kerf = linkage.assembly(**settings).sizes, settings.get("scale", 1.0), settings.get("kerf", 0.0)
    plates = linkage.file("plates", assembly={"boards": "below", **settings})
    assert circles(plates, "CRANK") == {round(checked.hole * scale - kerf, 9)}
    ends = 40 * scale + checked.width * scale + kerf
    assert length(plates, "CRANK") == pytest.approx(ends)
    rows = csv.DictReader(io.StringIO(linkage.file("parts", assembly=settings or True).decode()))
    crank = next(row for row in rows if row["name"] == "crank")
    assert float(crank["length"]) == pytest.approx((40 + checked.width) * scale)
    assert float(crank["thickness"]) == pytest.approx(checked.thickness * scale)
    assert linkage.solids(**settings).scale == scale
    radii = {
        round(float(value), 9)
        for value in re.findall(r"CYLINDRICAL_SURFACE\('',#\d+,([\d.E+-]+)\)", step_of(linkage, settings))
    }
    assert round(checked.hole * scale / 2, 9) in radii


def test_a_kerf_leaves_parts_of_their_size() -> None:
    """The contour lies half a kerf outside of the part: also around a body with sharp corners."""
    body = [[-20, -10], [60, -10], [60, 15], [10, 40], [-20, 15]]
    linkage = la.FourBar(40, 90, 80, 110, coupler_point_polar=(50, 20), body_offset=0)
    by_kerf = {}
    for kerf in (0.0, 0.4):
        parts = linkage.solids(body=body, kerf=kerf, hole=4, width=12, allow_collisions=True)
        text = parts.file("plates").decode()
        (outline,) = ezdxf.read(io.StringIO(text)).modelspace().query('LWPOLYLINE[layer=="BODY"]')
        path = ezdxf.path.make_path(outline).flattening(1e-4)
        by_kerf[kerf] = shapely.Polygon([point.vec2 for point in path])
    plain, wide = by_kerf.values()
    shift = [a - b for a, b in zip(wide.bounds, plain.buffer(0.2).bounds)]
    expected = shapely.affinity.translate(plain.buffer(0.2, quad_segs=64), *shift[:2])
    assert wide.symmetric_difference(expected).area < 1e-4 * wide.area
    with pytest.raises(la.FieldError) as error:
        linkage.solids(kerf=4, hole=4, width=12).file("plates")
    assert error.value.field == "/assembly/kerf"
