"""A linkage edited in the page: joints typed as well as dragged, and refined by the service from just there."""

import re

import pytest
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from tests.e2e.page import GOOD, IDLE


def test_joints_are_typed_and_stay_as_typed(edited) -> None:
    page = edited
    places = {name: (page.value(f"joint-{name}-x"), page.value(f"joint-{name}-y")) for name in "abdcp"}
    half_pixel = 0.5 / page.view()[2]
    for name, (x, y) in places.items():
        assert abs(page.drawn(name) - complex(float(x), float(y))) < half_pixel
    before = page.text("joints-note")
    typed = {"joint-c-x": "+1,234e2", "joint-a-y": "-20.50", "joint-p-x": f"{float(places['p'][0]) + 3:.3f}0"}
    for name, entry in typed.items():
        page.type_into(name, entry + Keys.TAB)
    assert {name: page.value(name) for name in typed} == typed, "to the letter, though others moved after it"
    assert page.drawn("c").real == pytest.approx(123.4, abs=half_pixel)
    assert page.drawn("a").imag == pytest.approx(-20.5, abs=half_pixel)
    assert page.value("joint-b-x") == places["b"][0], "what was not typed stays where it was"
    assert page.text("joints-note") != before and "Off by at most" in page.text("joints-note")
    assert page.card().startswith("By hand")
    worst = re.search(r"Off by at most ([\d.]+) mm", page.text("joints-note"))[1]
    assert f"{worst} mm" in page.text("numbers"), "the same error as in the numbers"
    assert page.count("#canvas .worst") >= 1
    assert page.text("status").startswith(f"Changed by hand: off by {worst} mm"), (
        "no longer the error of the best linkage"
    )
    page.choose_card(1)
    assert page.text("status").startswith("Best found")
    edited.renew("casement")
    edited.mode("hand")
    page = edited
    before = page.drawn("d")
    page.type_into("joint-d-x", "12 mm" + Keys.TAB)
    assert page.value("joint-d-x") == "12 mm" and page.find("joint-d-x").get_attribute("aria-invalid") == "true"
    assert page.text("joints-error").startswith("D, x: “12 mm” is not a number;")
    assert abs(page.drawn("d") - before) < 0.2, "nothing has moved"
    page.type_into("joint-d-x", Keys.BACKSPACE + Keys.ENTER)
    assert "is still in use" in page.text("joints-error")
    page.type_into("joint-d-x", f"{before.real + 1:.2f}" + Keys.ENTER)
    assert page.text("joints-error") == ""
    for name, entry in (("b-x", "150"), ("b-y", "40"), ("a-x", "150"), ("a-y", "40")):
        page.type_into(f"joint-{name}", entry + Keys.ENTER)
    assert page.text("joints-error") == "A, y: two joints would coincide there."
    edited.renew("casement")
    edited.mode("hand")
    page = edited
    Select(page.find("length-unit")).select_by_visible_text("in")
    assert "Places in in where the crank stands" in page.text("joints-panel")
    page.mode("move")
    assert not page.shown("joints-panel")


def test_a_linkage_is_refined_from_there_by_keys_alone(edited) -> None:
    page = edited
    cards = page.count("#solutions li")
    moved = float(page.value("joint-c-y")) + 12
    page.type_into("joint-c-y", f"{moved:.1f}" + Keys.ENTER)
    by_hand = float(re.search(r"Off by at most ([\d.]+)", page.text("joints-note"))[1])
    page.pick("#refine-here").send_keys(Keys.ENTER)
    page.wait(f"{IDLE} && document.getElementById('status').textContent.startsWith('Refined')")
    said = page.text("status")
    assert said.endswith("Linkages elsewhere were not looked at.")
    assert float(re.search(r"off by ([\d.]+) mm", said)[1]) < by_hand
    assert not page.card().startswith("By hand") and GOOD.search(page.card())
    assert page.count("#solutions li") in (cards, cards + 1)
    page.unfold("charts")
    assert "may be better" in page.text("trace-note") and "Descent ended" in page.text("trace-note")


def test_a_refinement_that_leads_nowhere_says_so_and_keeps_the_linkage(edited) -> None:
    page = edited
    page.unfold("limits")
    page.select("prefer", "size")
    page.type_into("joint-c-y", "200" + Keys.ENTER)
    page.run(
        "const own = window.fetch; window.fetch = async (path, ...rest) => { const reply = await own(path, ...rest);"
        "if (path !== '/v2/synthesize') return reply; window.fetch = own; window.asked = JSON.parse(rest[0].body);"
        "const body = await reply.json();"
        "return new Response(JSON.stringify({...body, status: 'unknown', solutions: []}), {status: 200}); }"
    )
    page.pick("#refine-here").click()
    page.wait(f"{IDLE} && document.getElementById('status').classList.contains('bad')")
    assert "proves nothing" in page.text("status") and page.card().startswith("By hand")
    asked = page.run("return window.asked")
    assert len(asked["start_from"][0]["crank_angle"]) == len(asked["position"]) and asked["top"] == 1
    assert "prefer" not in asked, "nothing is chosen among"


def test_a_linkage_given_with_a_request_is_no_part_of_the_motion(standing) -> None:
    page = standing
    begin = {"links": {"crank": 1, "coupler": 2, "rocker": 2, "ground": 2}, "branch": 1, "start_angle": 0}
    page.take({"position": [[0, 0], [3, 4], [6, 5]], "timing": "free", "start_from": [begin], "local": True})
    assert not page.request().keys() & {"start_from", "local"}


def test_a_linkage_is_entered_by_its_lengths_or_its_joints(standing) -> None:
    """It moves, is judged, driven and exported like one that was found."""
    page = standing
    page.click("entry-open")
    page.press("#entry-form [type=submit]")
    assert "are needed" in page.text("entry-error") and page.faults("#entry") == []
    for name, length in {"crank": "19", "coupler": "72", "rocker": "144"}.items():
        page.type_into(f"entry-{name}", length)
    page.type_into("entry-ground", "300" + Keys.TAB)
    assert "cannot be assembled" in page.text("entry-error")
    page.type_into("entry-ground", "165" + Keys.TAB)
    page.type_into("entry-p-y", "60,5")
    page.press("#entry-form [type=submit]")
    page.wait(f"{IDLE} && document.getElementById('status').textContent.startsWith('The linkage as entered')")
    assert page.links() == pytest.approx([19, 72, 144, 165], rel=1e-7)
    assert len(page.table()) == 24 and page.value("joint-p-y") == "60.5"
    assert GOOD.search(page.card()) or "transmission" in page.card()
    assert b"LWPOLYLINE" in page.saved("linkage-1.dxf", "[data-format=dxf]")
    page.select("drive-kind", "rotary")
    page.click("drive-find")
    page.wait("document.querySelectorAll('#drive-found button').length")
    page.click("entry-open")
    joints = {"a": ("0", "0"), "d": ("40", "0"), "c": ("60", "30"), "b": ("70", "0"), "p": ("50", "50")}
    for name, place in joints.items():
        for axis, entry in zip("xy", place):
            page.type_into(f"entry-{name}-{axis}", entry)
    page.press("#entry-form [type=submit]")
    page.wait(f"{IDLE} && document.querySelectorAll('#poses tbody tr').length === 13")
    assert page.links() == pytest.approx([40, 1300**0.5, 1000**0.5, 70], rel=1e-7)
    places = page.placed()
    assert min(abs(x + 1j * y - 50 - 50j) for x, y in places) < 20, "the position entered lies within its swing"
