"""Slots as files: read back by other programs' eyes, and compared with the exact path."""

from __future__ import annotations

import csv
import io
import math
import xml.etree.ElementTree as ElementTree

import ezdxf
import numpy as np
import pytest

from synthesis.chain import crescent as chain
from synthesis.chain.closure import Chain
from synthesis.chain.export import bezier, roller_walls, smooth_nodes, to_csv, to_dxf, to_svg
from synthesis.chain.report import report
from synthesis.chain.slot import find_slot
from synthesis.errors import FieldError

ROLLER = 25.0


@pytest.fixture(scope="module")
def slot():
    return chain.crescent_slot(131.0, 16, 181.78)[1]


@pytest.fixture(scope="module")
def dense(slot):
    return np.linspace(slot.start, slot.end, 4001)


def nearest(points, curve):
    """Distance of each point from a dense polyline."""
    start, along = curve[:-1], np.diff(curve)
    share = ((points[:, None] - start) / along).real
    return np.abs(points[:, None] - start - np.clip(share, 0, 1) * along).min(axis=1)


def test_walls_are_a_roller_away_from_the_path(slot, dense) -> None:
    phases = dense[::40]
    walls = roller_walls(slot, phases, ROLLER)
    path = slot.path(dense)
    for wall in walls.values():
        assert np.abs(nearest(wall, path) - ROLLER).max() < 1e-4
    # The slot is travelled from right to left: its left wall is the lower one.
    assert np.all(walls["left"].imag < walls["right"].imag)


def test_a_roller_too_large_is_refused(slot, dense) -> None:
    with pytest.raises(FieldError) as caught:
        roller_walls(slot, dense[:3], 52.1)
    assert caught.value.field == "/roller_radius" and caught.value.details["constraint"] == "undercut"


def test_csv_has_full_precision(slot, dense) -> None:
    phases = dense[::100]
    walls = roller_walls(slot, phases, ROLLER)
    unit = math.radians(1) * 131 / math.sqrt(2)
    rows = list(csv.DictReader(io.StringIO(to_csv(slot, phases, "theta1_deg", unit, ROLLER), newline="")))
    assert len(rows) == len(phases)
    assert np.array_equal([complex(float(row["x"]), float(row["y"])) for row in rows], slot.path(phases))
    assert float(rows[0]["theta1_deg"]) == pytest.approx(29.553192, abs=1e-6)
    assert np.array_equal([float(row["left_x"]) for row in rows], walls["left"].real)
    assert "left_x" not in to_csv(slot, phases, "theta1_deg", unit, None)


@pytest.mark.parametrize(("samples", "offset"), [(91, 0.0), (91, ROLLER), (91, -ROLLER), (3, 0.0)])
def test_cubic_pieces_follow_the_path(samples, offset, slot, dense) -> None:
    pieces = bezier(slot, smooth_nodes(slot, samples), offset)
    t = np.linspace(0, 1, 9)
    weights = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3], axis=1)
    points = (pieces @ weights.T).ravel()
    exact = slot.path(dense) + offset * slot.normals(dense)
    assert nearest(points, exact).max() < (2e-5 if samples == 91 else 0.1)


def test_svg_is_xml_and_shows_track_slot_walls_and_pins(slot) -> None:
    root = ElementTree.fromstring(to_svg(slot, 91, ROLLER))
    space = "{http://www.w3.org/2000/svg}"
    names = [path.get("id") for path in root.iter(f"{space}path")]
    assert names == ["track", "slot", "roller-left", "roller-right", "chain"]
    assert len(list(root.iter(f"{space}circle"))) == 16
    x0, y0, width, height = map(float, root.get("viewBox").split())
    for circle in root.iter(f"{space}circle"):
        assert x0 <= float(circle.get("cx")) <= x0 + width and y0 <= float(circle.get("cy")) <= y0 + height
    track = next(path.get("d") for path in root.iter(f"{space}path"))
    assert track.count("A") == 8 and track.endswith("Z")


def test_dxf_is_read_back_with_the_exact_geometry(slot, dense) -> None:
    document = ezdxf.read(io.StringIO(to_dxf(slot, 91, ROLLER)))
    space = document.modelspace()
    track = slot.chain.track
    arcs = list(space.query("ARC"))
    assert sorted(arc.dxf.radius for arc in arcs) == pytest.approx(
        sorted(1 / abs(segment.curvature) for segment in track.segments)
    )
    for entity, segment, start in zip(arcs, track.segments, track.joints):
        ends = np.array([complex(p.x, p.y) for p in (entity.start_point, entity.end_point)])
        wanted = track.points(track.place(np.array([start, (start + segment.length) % track.total])))
        assert min(np.abs(ends - wanted).max(), np.abs(ends[::-1] - wanted).max()) < 1e-9
    splines = {entity.dxf.layer: entity for entity in space.query("SPLINE")}
    assert set(splines) == {"SLOT", "ROLLER_LEFT", "ROLLER_RIGHT"}
    points = np.array([complex(p.x, p.y) for p in splines["SLOT"].construction_tool().approximate(500)])
    assert nearest(points, slot.path(dense)).max() < 2e-5
    assert len(space.query("POINT")) == 16
    assert not document.audit().errors
    assert "ROLLER_LEFT" not in {e.dxf.layer for e in ezdxf.read(io.StringIO(to_dxf(slot, 9, None))).modelspace()}


def test_a_stadium_is_drawn_with_lines() -> None:
    track = chain.critical_stadium(50.0, 16, 60.0)
    slot = find_slot(Chain(track, 50.0, 16), float(track.joints[2] + 0.5 * track.length[2]))
    document = ezdxf.read(io.StringIO(to_dxf(slot, 31, None)))
    assert len(document.modelspace().query("LINE")) == 2 and len(document.modelspace().query("ARC")) == 2
    assert to_svg(slot, 31, None).count(" L ") >= 2


@pytest.mark.parametrize("scale", [1e-9, 1e7])
def test_any_unit(scale) -> None:
    slot = chain.crescent_slot(scale, 16, 181.78 / 131 * scale)[1]
    root = ElementTree.fromstring(to_svg(slot, 21, None))
    width = float(root.get("viewBox").split()[2])
    assert width == pytest.approx(scale * 733 / 131 * 1.1, rel=0.1)
    assert report(slot, np.array([slot.start])).radius_min == pytest.approx(52.0923 / 131 * scale, rel=1e-4)
