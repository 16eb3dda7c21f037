"""Every format of a linkage can be had over HTTP and on the command line, with the same content.

These tests would catch a route or an ending that is not connected to its writer, and a file in the wrong unit of angle.
"""

import csv
import io
import math
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pytest

from app.registry import worked_example


@pytest.fixture(scope="module")
def solved(client):
    """Return the worked example and its reply."""
    request = {**worked_example(), "top": 2}
    return request, client.post("/v2/synthesize", json=request).json()


def rows_of(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_format_over_http_from_a_solution(client, solved) -> None:
    request, reply = solved
    best = reply["solutions"][0]

    def export(**more):
        return client.post("/v2/export", json={"request": request, "linkage": best, **more})

    dxf = export(format="dxf")
    assert dxf.status_code == 200 and dxf.headers["content-type"] == "image/vnd.dxf"
    assert dxf.headers["content-disposition"] == 'attachment; filename="linkage.dxf"'
    assert not ezdxf.read(io.StringIO(dxf.text)).audit().errors
    assert ElementTree.fromstring(export(format="svg").text).tag == "{http://www.w3.org/2000/svg}svg"
    assert ElementTree.fromstring(export(format="mjcf").text).tag == "mujoco"
    rows = rows_of(export(format="csv").text)
    assert [float(row["x_wanted"]) for row in rows] == [x for x, _ in request["position"]]
    complete = export().json()
    assert complete["linkage"]["links"] == best["links"] and complete["request"] == request
    second = client.post("/v2/export", json={"request": request, "rank": 2}).json()["linkage"]
    assert second["links"] == reply["solutions"][1]["links"]
    thin = {"crank": 1e-99, "coupler": 1e99, "rocker": 1e99, "ground": 1}
    odd = {"links": thin, "branch": 1, "start_angle": 0}
    assert all(export(linkage=odd, format=kind).status_code == 200 for kind in ("csv", "svg"))


@pytest.mark.parametrize(
    ("linkage", "span"),
    [
        ({"joints": {"A": [0, 0], "D": [60, 0], "C": [80, 46], "B": [90, 0], "P": [70, 60]}}, None),
        ({"links": {"crank": 19, "coupler": 72, "rocker": 144, "ground": 165}, "branch": 1, "start_angle": 0}, 360.0),
    ],
)
def test_a_linkage_is_exported_over_its_own_range_when_the_timing_is_free(client, linkage, span) -> None:
    """A linkage whose crank cannot turn fully is shown between its dead positions, about the given position."""
    request = {"rotation": [0, 10, 30], "position": [[70, 60], [60, 65], [40, 70]], "timing": "free"}
    body = {"request": request, "linkage": linkage}
    rows = rows_of(client.post("/v2/export", json={**body, "format": "csv"}).text)
    angles = np.array([float(row["crank_angle"]) for row in rows])
    assert np.ptp(angles) == span if span else 60 < np.ptp(angles) < 359
    assert all(np.isfinite(float(row["transmission_angle"])) for row in rows)
    assert client.post("/v2/export", json={**body, "format": "dxf"}).status_code == 200


def test_rotations_alone_and_radians(client, solved) -> None:
    request, _ = solved

    def exported(body: dict[str, Any], kind: str = "csv") -> str:
        return client.post("/v2/export", json={"request": body, "format": kind}).text

    rotation = {"rotation": request["rotation"], "crank_span": 70, "top": 1}
    rows = rows_of(exported(rotation))
    assert rows[0]["x"] == "" and abs(float(rows[3]["rotation_error"])) < 1e-6
    for kind in ("svg", "mjcf"):
        ElementTree.fromstring(exported(rotation, kind))
    radians = {"rotation": np.deg2rad(request["rotation"]).tolist(), "crank_span": math.radians(70)}
    bodies = request, request | radians | {"angle_unit": "rad"}
    for degrees, turned in zip(*(rows_of(exported(body)) for body in bodies)):
        expected = math.degrees(float(turned["coupler_direction"]))
        assert float(degrees["coupler_direction"]) == pytest.approx(expected, abs=1e-6)
