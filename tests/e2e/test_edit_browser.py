"""A linkage edited in the page: joints typed as well as dragged, and refined by the service from just there."""

import re

import pytest
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from tests.e2e.page import GOOD, IDLE


def test_joints_are_typed_and_stay_as_typed(edited) -> None:
    points = {name: (edited.value(f"joint-{name}-x"), edited.value(f"joint-{name}-y")) for name in "abdcp"}
    half_pixel = 0.5 / edited.view()[2]
    for name, (x, y) in points.items():
        assert abs(edited.drawn(name) - complex(float(x), float(y))) < half_pixel
    before = edited.text("joints-note")
    typed = {"joint-c-x": "+1,234e2", "joint-a-y": "-20.50", "joint-p-x": f"{float(points['p'][0]) + 3:.3f}0"}
    for name, entry in typed.items():
        edited.type_into(name, entry + Keys.TAB)
    assert {name: edited.value(name) for name in typed} == typed, "to the letter, though others moved after it"
    assert edited.drawn("c").real == pytest.approx(123.4, abs=half_pixel)
    assert edited.drawn("a").imag == pytest.approx(-20.5, abs=half_pixel)
    assert edited.value("joint-b-x") == points["b"][0], "what was not typed stays where it was"
    assert edited.text("joints-note") != before and "Largest errors" in edited.text("joints-note")
    assert edited.card().startswith("By hand")
    worst = re.search(r"Largest errors: ([\d.]+) mm", edited.text("joints-note"))[1]
    assert f"{worst} mm" in edited.text("numbers"), "the same error as in the numbers"
    assert edited.count("#canvas .worst") >= 1
    assert edited.text("status").startswith(f"Changed by hand: off by {worst} mm"), (
        "no longer the error of the best linkage"
    )
    edited.choose_card(1)
    assert edited.text("status").startswith("Best found")
    edited.renew("casement")
    edited.mode("hand")
    before = edited.drawn("d")
    edited.type_into("joint-d-x", "12 mm" + Keys.TAB)
    assert edited.value("joint-d-x") == "12 mm" and edited.find("joint-d-x").get_attribute("aria-invalid") == "true"
    assert edited.text("joints-error").startswith("D, x: “12 mm” is not a number;")
    assert abs(edited.drawn("d") - before) < 0.2, "nothing has moved"
    edited.type_into("joint-d-x", Keys.BACKSPACE + Keys.ENTER)
    assert "is still in use" in edited.text("joints-error")
    edited.type_into("joint-d-x", f"{before.real + 1:.2f}" + Keys.ENTER)
    assert edited.text("joints-error") == ""
    for name, entry in (("b-x", "150"), ("b-y", "40"), ("a-x", "150"), ("a-y", "40")):
        edited.type_into(f"joint-{name}", entry + Keys.ENTER)
    assert edited.text("joints-error") == "A, y: two joints would coincide there."
    edited.renew("casement")
    edited.mode("hand")
    Select(edited.find("length-unit")).select_by_visible_text("in")
    assert "Places in in where the crank stands" in edited.text("joints-panel")
    edited.mode("move")
    assert not edited.shown("joints-panel")


def test_a_linkage_is_refined_from_there_by_keys_alone(edited) -> None:
    cards = edited.count("#solutions li")
    moved = float(edited.value("joint-c-y")) + 12
    edited.type_into("joint-c-y", f"{moved:.1f}" + Keys.ENTER)
    by_hand = float(re.search(r"Largest errors: ([\d.]+)", edited.text("joints-note"))[1])
    edited.pick("#refine-here").send_keys(Keys.ENTER)
    edited.wait(f"{IDLE} && document.getElementById('status').textContent.startsWith('Refined')")
    said = edited.text("status")
    assert said.endswith("Linkages elsewhere were not searched.")
    assert float(re.search(r"off by ([\d.]+) mm", said)[1]) < by_hand
    assert not edited.card().startswith("By hand") and GOOD.search(edited.card())
    assert edited.count("#solutions li") in (cards, cards + 1)
    edited.unfold("charts")
    assert "may be better" in edited.text("trace-note") and "Descent ended" in edited.text("trace-note")


def test_a_refinement_that_leads_nowhere_says_so_and_keeps_the_linkage(edited) -> None:
    edited.unfold("limits")
    edited.select("prefer", "size")
    edited.type_into("joint-c-y", "200" + Keys.ENTER)
    edited.run(
        "const own = window.fetch; window.fetch = async (path, ...rest) => { const reply = await own(path, ...rest);"
        "if (path !== '/v2/synthesize') return reply; window.fetch = own; window.requests = JSON.parse(rest[0].body);"
        "const body = await reply.json();"
        "return new Response(JSON.stringify({...body, status: 'unknown', solutions: []}), {status: 200}); }"
    )
    edited.press("#refine-here")
    edited.wait(f"{IDLE} && document.getElementById('status').classList.contains('bad')")
    assert "does not prove" in edited.text("status") and edited.card().startswith("By hand")
    body = edited.run("return window.requests")
    assert len(body["start_from"][0]["crank_angle"]) == len(body["position"]) and body["top"] == 1
    assert "prefer" not in body, "nothing is chosen among"


def test_a_linkage_is_entered_by_its_lengths_or_its_joints(shared) -> None:
    """An entered linkage moves, is judged, driven and exported like a linkage from the search."""
    shared.click("entry-open")
    shared.press("#entry-form [type=submit]")
    assert "are needed" in shared.text("entry-error") and shared.faults("#entry") == []
    for name, length in {"crank": "19", "coupler": "72", "rocker": "144"}.items():
        shared.type_into(f"entry-{name}", length)
    shared.type_into("entry-ground", "300" + Keys.TAB)
    assert "cannot be assembled" in shared.text("entry-error")
    shared.type_into("entry-ground", "165" + Keys.TAB)
    shared.type_into("entry-p-y", "60,5")
    shared.press("#entry-form [type=submit]")
    shared.wait(f"{IDLE} && document.getElementById('status').textContent.startsWith('The linkage as entered')")
    assert shared.links() == pytest.approx([19, 72, 144, 165], rel=1e-7)
    assert len(shared.table()) == 24 and shared.value("joint-p-y") == "60.5"
    assert GOOD.search(shared.card()) or "transmission" in shared.card()
    assert b"LWPOLYLINE" in shared.saved("linkage-1.dxf", "[data-format=dxf]")
    shared.select("drive-kind", "rotary")
    shared.click("drive-find")
    shared.wait("document.querySelectorAll('#drive-found button').length")
    shared.click("entry-open")
    joints = {"a": ("0", "0"), "d": ("40", "0"), "c": ("60", "30"), "b": ("70", "0"), "p": ("50", "50")}
    for name, coordinates in joints.items():
        for axis, entry in zip("xy", coordinates):
            shared.type_into(f"entry-{name}-{axis}", entry)
    shared.press("#entry-form [type=submit]")
    shared.wait(f"{IDLE} && document.querySelectorAll('#poses tbody tr').length === 13")
    assert shared.links() == pytest.approx([40, 1300**0.5, 1000**0.5, 70], rel=1e-7)
    points = shared.positions()
    assert min(abs(x + 1j * y - 50 - 50j) for x, y in points) < 20, "the position entered lies within its swing"
    # a linkage given with a pasted request is no property of the motion
    begin = {"links": {"crank": 1, "coupler": 2, "rocker": 2, "ground": 2}, "branch": 1, "start_angle": 0}
    shared.load_request(
        {"position": [[0, 0], [3, 4], [6, 5]], "timing": "free", "start_from": [begin], "refine_only": True}
    )
    assert not shared.request().keys() & {"start_from", "refine_only"}
