"""A requested drive is in every file that can hold it, with the arm that carries its pin.

Catches files that are the same with and without `drives`, a cylinder whose rod ends in the air, and STEP, plates
and a parts list that drop the cylinder.
"""

import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import ezdxf
import numpy as np
import pytest
from fastapi.testclient import TestClient

import linkage_atlas as la
from synthesis.assembly.stacks import StackRequest, StackSearch
from synthesis.target import Target
from synthesis.work import Work
from tests.conftest import some_of
from tests.oracles.assembly import disagreements, nearest

DEGREES = np.pi / 180
CASEMENT = la.FourBar(
    240.0105, 101.3106, 83.7877, 155.1378, 1, pivot_a=(-100, 22.4436), ground_angle=-25.6394, start_angle=17.9219,
    coupler_point_polar=(162.3637, 115.7082),
)  # fmt: skip
ANGLES = [0.0, -10.0, -20.0, -33.7138]
KINDS: dict[str, tuple[dict[str, Any], list[str]]] = {
    "cylinder": (
        {
            "kind": "actuator",
            "retracted": 255,
            "stroke": 150,
            "links": ["coupler"],
            "ground_box": [-100, -250, 400, 150],
        },
        ["cylinder", "piston_rod"],
    ),
    "between links": ({"kind": "actuator", "links": ["rocker"], "base_link": "crank"}, ["cylinder", "piston_rod"]),
    "motor": ({"kind": "dyad", "links": ["coupler"]}, ["motor_crank", "rod"]),
    "hinge": ({"kind": "rotary", "links": ["crank"]}, ["drive"]),
}


def moving() -> la.FourBar:
    return la.Linkage.of(CASEMENT.plain, DEGREES, Target(None, None, crank=np.array(ANGLES) * DEGREES))


def drive_of(name: str) -> Any:
    found = la.drives(CASEMENT, [KINDS[name][0]], load={"force": [0, 100]}, crank_angle=[0, ANGLES[-1]])
    return found.drives[0]


@pytest.mark.parametrize("name", some_of([*KINDS], 3))
def test_every_file_holds_the_drive(name: str) -> None:
    linkage, drive, parts = moving(), drive_of(name), KINDS[name][1]
    anyway = {"solids": {"allow_collisions": True}}
    plain = linkage.file("csv").decode().splitlines()[0]
    assert "drive_ground_x" in linkage.file("csv", drive=drive).decode().splitlines()[0] and "drive" not in plain
    for kind in ("svg", "dxf"):
        assert b"DRIVE" in linkage.file(kind, drive=drive).upper()
    listed = [
        row["name"] for row in csv.DictReader(io.StringIO(linkage.file("parts", drive=drive, **anyway).decode()))
    ]
    assert set(parts) <= set(listed)
    if name != "hinge":
        step = linkage.file("step", drive=drive, **anyway).decode()
        layers = ezdxf.read(io.StringIO(linkage.file("plates", drive=drive, **anyway).decode())).layers
        for part in parts:
            assert f"'{part}'" in step and layers.has_entry(part.upper())


@pytest.mark.parametrize("name", ["cylinder", "between links", "motor"])
def test_an_arm_leads_from_the_link_to_the_pin(name: str) -> None:
    """In the drawing a line from a joint of the link to the pin; as a part the link's plate has a hole there."""
    linkage, drive = moving(), drive_of(name)
    assert drive.pin is not None
    pin = complex(*drive.pin)
    drawn = ezdxf.read(io.StringIO(linkage.file("dxf", drive=drive).decode())).modelspace()
    joints = linkage.joints([0.0])
    own = {"coupler": joints.crank_pin, "rocker": joints.pivot_b[None], "crank": joints.pivot_a[None]}[drive.link][0]
    origin, met = complex(*own), False
    for line in drawn.query('LWPOLYLINE[layer=="DRIVE"]'):
        points = [complex(x, y) for x, y, *_ in line.get_points()]
        met |= (
            min(abs(point - pin) for point in points) < 1e-6 and min(abs(point - origin) for point in points) < 1e-6
        )
    assert met, "the pin floats"
    layers = linkage.assembly(drive=drive)
    plate = next(part for part in layers.parts if part.name == drive.link)
    assert any(hole.pin == "Q" for hole in plate.holes)
    ends = {"Q", "G"} if name in ("cylinder", "between links") else {"Q", "K"}
    assert ends <= {pin.name for pin in layers.pins}


@pytest.mark.parametrize("seed", some_of(range(6), 3))
def test_a_free_assembly_with_a_cylinder_does_not_touch(seed: int) -> None:
    """Compare with shapely at many positions."""
    linkage, drive = moving(), drive_of("cylinder" if seed % 2 else "between links")
    machine = linkage.assembly(drive=drive, hole=3 + seed, width=9 + 2 * seed).machine
    search = StackSearch(machine, StackRequest("below"), Work())
    assert disagreements(machine, search)[2] == 0
    found = search.solve()
    assert found.status != "free" or nearest(machine, found) > -1e-9


REQUEST = {
    "position": [[0, 0], [40, 8], [75, 30]],
    "rotation": [0, 15, 40],
    "timing": "free",
    "top": 1,
    "limits": {"family": "any", "link_max": 120},
    "load": {"force": [0, -40]},
    "drives": [{"kind": "actuator"}],
}


def test_a_drive_of_the_request_is_in_its_files(client: TestClient, run: Any, tmp_path: Path) -> None:
    """By /v2/export with and without the solution, on the command line and in Python."""
    without = {name: value for name, value in REQUEST.items() if name not in ("load", "drives")}
    plain = client.post("/v2/export", json={"request": without, "format": "csv"}).text
    driven = client.post("/v2/export", json={"request": REQUEST, "format": "csv"}).text
    assert "drive_ground_x" in driven and "drive_ground_x" not in plain
    assert 'id="DRIVE"' in client.post("/v2/export", json={"request": REQUEST, "format": "svg"}).text
    solution = client.post("/v2/synthesize", json=REQUEST).json()["solutions"][0]
    assert solution["drives"]
    body = {"request": REQUEST, "linkage": solution, "format": "parts", "solids": {"allow_collisions": True}}
    assert "piston_rod" in client.post("/v2/export", json=body).text
    assert "piston_rod" not in client.post("/v2/export", json={**body, "drive": None}).text
    prescribed = tmp_path / "request.json"
    prescribed.write_text(json.dumps(REQUEST))
    for ending in ("csv", "step"):
        code, _, error = run(
            "export",
            prescribed,
            "--out",
            tmp_path / f"it.{ending}",
            "--allow-collisions" if ending == "step" else "--rank=1",
        )
        assert code == 0, error
    assert "drive_pin_x" in (tmp_path / "it.csv").read_text()
    assert re.search("'cylinder'", (tmp_path / "it.step").read_text())
    found = la.synthesize(**REQUEST).best
    assert found.drives
    found.linkage.save(tmp_path / "own.step", drive=found.drives[0], allow_collisions=True)
    assert "'cylinder'" in (tmp_path / "own.step").read_text()


def test_the_end_of_a_drive_on_a_moving_link_moves_in_a_file() -> None:
    """Its end was drawn on the ground."""
    drive = drive_of("between links")
    rows = csv.DictReader(io.StringIO(moving().file("csv", drive=drive).decode()))
    ends = [complex(float(row["drive_ground_x"]), float(row["drive_ground_y"])) for row in rows]
    assert abs(ends[-1] - ends[0]) > 1 and ends[0] == pytest.approx(complex(*drive.ground_point))
