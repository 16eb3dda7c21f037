"""The unit of a motion's lengths reaches every file of its solutions.

This catches a table in centimetres that is saved as a drawing ten times too small.
"""

import csv
import io
import re
import zipfile

import ezdxf
import pytest
from ezdxf import bbox

import linkage_atlas as la
from linkage_atlas.formats import FORMATS

TABLE = "x [{0}];y [{0}];angle\n0;0;0\n22;5;12\n41;17;27\n52;36;45\n50;58;66\n"
UNITS = {"in": 25.4, "um": 0.001}


def solved(path, unit: str, **more):
    path.write_text(TABLE.format(unit))
    motion = la.Motion.from_table(path, **more)
    return motion, la.synthesize(motion, top=1, budget=5).best


@pytest.fixture(scope="module")
def in_cm(tmp_path_factory):
    return solved(tmp_path_factory.mktemp("units") / "poses.csv", "cm")


@pytest.mark.parametrize("kind", FORMATS)
def test_files_of_every_format_are_in_the_unit_of_the_table(in_cm, kind) -> None:
    motion, best = in_cm
    assert motion.length_unit == best.linkage.length_unit == "cm"
    request = {"solids": {"allow_collisions": True}} if kind in ("step", "3mf", "stl", "parts", "plates") else {}
    own, named, second = (
        comparable(kind, best.linkage.file(kind, **unit, **request))
        for unit in ({}, {"length_unit": "cm"}, {"length_unit": "mm"})
    )
    assert own == named != second


def comparable(kind: str, content: bytes):
    """Return the content of a file without times and identifiers."""
    if kind in ("3mf", "stl"):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return {name: archive.read(name) for name in archive.namelist()}
    if kind in ("dxf", "plates"):
        document = ezdxf.read(io.StringIO(content.decode()))
        extents = bbox.extents(document.modelspace())
        return [round(value, 3) for corner in extents for value in corner]
    return re.sub(rb"FILE_NAME.*", b"", content)


def test_text_files_name_the_unit(in_cm) -> None:
    _, best = in_cm
    rows = list(csv.DictReader(io.StringIO(best.linkage.file("csv").decode())))
    assert {row["length_unit"] for row in rows} == {"cm"}
    assert "lengths in cm" in best.linkage.file("svg").decode()


@pytest.mark.parametrize("unit", UNITS)
def test_a_drawing_has_the_size_that_the_table_says(tmp_path, unit) -> None:
    _, best = solved(tmp_path / "poses.csv", unit)
    best.linkage.save(path := tmp_path / "linkage.dxf")
    lines = [line for line in ezdxf.readfile(path).modelspace().query("LINE") if line.dxf.layer == "LINKS"]
    longest = max(line.dxf.start.distance(line.dxf.end) for line in lines)
    expected = max(best.links.crank, best.links.rocker, best.links.coupler) * UNITS[unit]
    assert longest == pytest.approx(expected, rel=1e-6)


def test_the_table_converts_to_the_units_that_are_asked_for(tmp_path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("x [cm],y [cm],theta [rad]\n0,0,0\n1,2,1\n3,4,2\n")
    motion = la.Motion.from_table(path, length_unit="mm", tolerances={"rotation": 1.0})
    assert motion.requested.position.tolist() == pytest.approx([0, 10 + 20j, 30 + 40j])
    assert motion.length_unit == "mm" and motion.degrees
    assert motion.tolerances.rotation[0] == pytest.approx(0.0174533), (
        "an option is in degrees whatever the table is in"
    )
    radians = la.Motion.from_table(path, degrees=False)
    assert radians.requested.rotation.tolist() == pytest.approx([0, 1, 2]) and not radians.degrees
    with pytest.raises(la.FieldError, match="length_unit"):
        la.Motion.from_table(path, length_unit="furlong")


def test_notes_say_how_the_table_was_read(tmp_path) -> None:
    path = tmp_path / "poses.csv"
    path.write_text("Frame,TX,TY,TZ,RX,RZ\n1,0,0,0,0,0\n2,10,2,0,0,5\n3,22,5,0,0,12\n")
    notes = la.synthesize(la.Motion.from_table(path), top=1, budget=1).report.notes
    assert sum("Columns read" in note for note in notes) == 1
    motion = la.Motion.from_table(path, columns={"x": "TX", "y": "TY", "angle": "RX"})
    assert motion.requested.rotation.tolist() == [0, 0, 0]


def test_analysis_and_drives_use_the_unit_of_the_motion(in_cm) -> None:
    _, best = in_cm
    load = {"masses": [{"link": "coupler", "mass": 1.0, "centre": [5, 1]}], "gravity": [0, 0]}
    torques = {
        unit: best.linkage.analysis(3600.0, load, length_unit=unit).drive_load[1] for unit in (None, "cm", "mm")
    }
    assert torques[None] == torques["cm"] != torques["mm"]
