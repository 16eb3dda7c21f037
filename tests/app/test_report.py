"""A report has the numbers of the reply in one page, and drives have their curves as files.

A report with another solution's numbers, or one that needs further files or a network, would show here.
"""

from __future__ import annotations

import csv
import io
import json
import re
from xml.etree import ElementTree

import pytest

from app.terminal import Exit

DRIVEN = {
    "rotation": [0, 12, 27, 45],
    "position": [[0, 0], [20, 5], [40, 20], [50, 40]],
    "top": 2,
    "load": {"force": [0, -100]},
    "drives": [
        {"kind": "rotary"},
        {"kind": "actuator", "links": ["rocker", "coupler"], "retracted": 200, "stroke": 20},
    ],
    "springs": [{"kind": "tension"}],
}
SLIDER = {"position": DRIVEN["position"], "rotation": DRIVEN["rotation"], "mechanisms": ["slider_crank"], "top": 1}
ROTATION = {"rotation": [0, 12, 27, 45], "crank_span": 60, "top": 1}


@pytest.mark.parametrize("request_body, rank", [(DRIVEN, 1), (DRIVEN, 2), (SLIDER, 1), (ROTATION, 1)])
def test_a_report_shows_the_solution_and_needs_nothing_else(request_body, rank, run, tmp_path) -> None:
    file = tmp_path / "window.html"
    stdin = json.dumps(request_body)
    assert run("report", "--rank", rank, "--length-unit", "mm", "--out", file, stdin=stdin)[0] == Exit.OK
    solution = json.loads(run("synthesize", "--json", stdin=stdin)[1])["solutions"][rank - 1]
    page = file.read_text()
    radii = [guide["radius"] for guide in solution["guides"] or () if guide["guide"] == "circle"]
    for length in solution["links"].values() if solution["links"] else radii:
        assert f"{length:.6g}" in page
    assert f"{solution['transmission_angle_min']:.4g}" in page
    assert ("Drives" in page) == bool(solution.get("drives"))
    for spring in solution.get("springs") or ():
        for link, point in zip(spring["between"], spring["points"]):
            assert f"end on the {link} ({point[0]:.6g}, {point[1]:.6g})" in page
    assert not re.search(r'(?:src|href)="(?!data:)|url\(|<script', page)


def test_a_report_of_a_rank_that_is_missing_is_not_written(run, tmp_path) -> None:
    stdin = json.dumps(
        ROTATION | {"budget_ms": 500, "limits": {"link_ratio_max": 1.001, "transmission_angle_min_turn": 80}}
    )
    code, _, err = run("report", "--out", tmp_path / "a.html", stdin=stdin)
    assert code != Exit.OK and "no solution of rank 1" in err and not [*tmp_path.iterdir()]


def test_a_report_is_a_page_of_html_only(run, tmp_path) -> None:
    code, _, err = run("report", "--example", "casement", "--out", tmp_path / "a.pdf")
    assert code == Exit.USAGE and "must end in .html" in err and not [*tmp_path.iterdir()]


def test_the_curves_of_drives_are_written(run, tmp_path, client) -> None:
    table, picture = tmp_path / "curves.csv", tmp_path / "curves.svg"
    code, out, _ = run(
        "drive", "--example", "bonnet_with_a_gas_spring", "--json", "--export", table, "--export", picture
    )
    assert code == Exit.OK
    reply = json.loads(out)
    curves = [item["curve"] for item in (*reply["drives"], *reply["springs"])]
    rows = [*csv.DictReader(io.StringIO(table.read_text()))]
    for number, curve in enumerate(curves, 1):
        own = [row for row in rows if row["number"] == str(number)]
        for name in ("crank_angle", "force", "torque"):
            assert [float(row[name]) if row[name] else None for row in own] == pytest.approx(
                curve.get(name) or [None] * len(own)
            )
    root = ElementTree.parse(picture).getroot()
    assert len([path for path in root if path.get("stroke")]) >= len(curves)
    body = {"rocker": {"pivot": [0, 0], "rotation": [0, 45]}}
    assert client.post("/v2/drives.svg", json=body).status_code in (200, 422)
