"""The panel "Drive" in the browser: a cylinder that is found, moves, is dragged and exported; reasons; other kinds."""

import re

import pytest
from selenium.webdriver.common.keys import Keys

from tests.conftest import some_of
from tests.e2e.page import keep


def fill(page, **fields) -> None:
    for name, value in fields.items():
        page.run(f"document.getElementById('drive-{name}').value = '{value}'")
    page.run("document.getElementById('drive-kind').dispatchEvent(new Event('change'))")


def found(page) -> None:
    page.click("drive-find")
    page.wait("!document.getElementById('drive-note').textContent.startsWith('Looking')")


def number(page, name: str) -> float:
    rows = page.text("drive-numbers")
    return float(re.search(rf"{name}\s+(-?[\d.]+)", rows)[1])


def test_both_ends_of_a_cylinder_are_in_the_view(opened) -> None:
    """At once where the user has not moved the view, else by Fit."""
    opened.choose("bucket")
    opened.select("drive-kind", "actuator")
    inside = (
        "const f = document.getElementById('canvas').getBoundingClientRect();"
        "return [...document.querySelectorAll('[data-layer=drive] .drive-end')].map((one) => one.getBoundingClientRect())"
        ".map((r) => r.left > f.left && r.right < f.right && r.top > f.top && r.bottom < f.bottom)"
    )
    found(opened)
    assert opened.count("#drive-found button")
    for k in range(opened.count("#drive-found button")):
        opened.run("document.querySelectorAll('#drive-found button')[arguments[0]].click()", k)
        assert opened.run(inside) == [True, True]
    for _ in range(4):
        opened.click("zoom-in")
    view = opened.view()
    found(opened)
    assert opened.view() == view and opened.run(inside) != [True, True]
    opened.click("fit")
    assert opened.run(inside) == [True, True]


def test_loads_have_units_and_results_for_other_loads_are_marked(opened) -> None:
    found(opened)
    assert opened.text("drive-note").startswith("No load was given: ") and "unit" not in opened.text("drive-numbers")
    opened.select("drive-kind", "rotary")
    opened.type_into("drive-mass", "2500")
    found(opened)
    assert re.search(r"peak torque \d[\d\u202f]*\u202f\d{3} N·mm", opened.text("drive-numbers"))
    assert opened.texts("#drive-curves h3") == ["Torque, N·mm"]
    opened.type_into("drive-mass", Keys.BACKSPACE)
    opened.type_into("drive-force-y", "-0.00123")
    found(opened)
    rows = opened.text("drive-numbers")
    assert re.search(r"peak torque 0\.\d+ N·mm", rows) and not re.search(r"\.\d+\u202f", rows)
    opened.type_into("drive-force-y", Keys.BACKSPACE)
    opened.select("drive-kind", "actuator")
    opened.renew("casement")
    opened.select("drive-kind", "rotary")
    opened.type_into("drive-force-y", "-100")
    found(opened)
    before = opened.text("drive-numbers")
    assert "peak torque" in before and not opened.text("drive-note")
    opened.wait("document.querySelectorAll('#stack rect').length > 4")
    opened.type_into("drive-force-y", "-200")
    opened.wait(
        "document.getElementById('drive-note').textContent.startsWith('These results belong to earlier entries')"
    )
    assert opened.run("return getComputedStyle(document.querySelector('.drive-result')).opacity") == "0.5"
    found(opened)
    opened.wait("document.getElementById('drive-note').textContent === ''")
    assert number(opened, "peak torque") > 0 and opened.text("drive-numbers") != before
    assert opened.run("return getComputedStyle(document.querySelector('.drive-result')).opacity") == "1"
    opened.type_into("drive-force-y", Keys.BACKSPACE)
    opened.select("drive-kind", "actuator")


def test_a_cylinder_is_found_moves_and_its_pins_are_dragged(opened) -> None:
    fill(opened, kind="actuator", retracted=255, stroke=150, reach=250, **{"force-y": 100})
    found(opened)
    assert "“pin within” is 250" in opened.content("drive-refused"), "as its field is called"
    assert "255 + 150 mm" in opened.text("drive-numbers")
    opened.run("document.getElementById('drive-found').scrollIntoView()")
    keep(opened, "drive_panel")
    best = number(opened, "peak force")
    assert opened.run("return document.querySelectorAll('#drive-curves .chart').length") == 2
    lengths = []
    for end in ("min", "max"):
        opened.slide(float(opened.find("slider").get_attribute(end)))
        lengths.append(float(opened.run("return document.querySelector('[data-layer=drive]').dataset.length")))
    assert sorted(lengths) == pytest.approx([255, 405], abs=0.01)
    opened.run("dispatchEvent(new Event('beforeprint'))")
    opened.wait("document.getElementById('sheet').textContent.includes('255 + 150 mm')")
    assert opened.run("return document.querySelectorAll('#sheet .drive-rod, #sheet .drive-arm').length") == 2
    # an arrow key on the ground point: the force is recomputed and is no longer the optimum
    opened.run(
        "const dot = document.querySelector('[data-end=ground]'); dot.focus();"
        "dot.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', shiftKey: true, bubbles: true}))"
    )
    opened.wait("document.getElementById('drive-numbers').textContent.includes('by hand')")
    assert number(opened, "peak force") != pytest.approx(best, rel=1e-6)
    assert opened.run("return document.activeElement.dataset.end") == "ground"


def test_a_drive_and_its_question_stay_with_the_linkage_that_is_held(opened) -> None:
    """A drag and a later stage of a search keep both."""
    fill(opened, kind="actuator", retracted=255, stroke=150, reach=250, **{"force-y": 100})
    found(opened)
    before = number(opened, "peak force")
    opened.wait("document.querySelectorAll('#stack rect').length > 4")
    opened.drag(opened.pick("[data-pose='4'] .hit"), 5, 5)
    opened.wait("document.getElementById('status').textContent.startsWith('Moved')")
    assert opened.count("[data-layer=drive] *") and opened.text("drive-numbers"), "never empty"
    assert opened.count("#stack rect")
    opened.wait("document.getElementById('drive-note').textContent === ''")
    assert number(opened, "peak force") != before
    opened.budgets(300, 2000)
    opened.run("document.getElementById('solutions').replaceChildren()")
    opened.click("solve")
    opened.wait("document.querySelectorAll('#solutions li').length && !document.getElementById('results').hidden")
    opened.click("drive-find")
    opened.wait("document.getElementById('progress').hidden")
    opened.wait("document.getElementById('drive-note').textContent === ''")
    assert number(opened, "peak force") > 0


@pytest.mark.parametrize("kinds", some_of([["dyad", "tension"], ["rotary", "gas", "ideal"]], 1))
def test_other_kinds_are_found_and_drawn(opened, kinds) -> None:
    for kind in kinds:
        fill(opened, kind=kind, **{"force-y": 100})
        found(opened)
        assert opened.count("#drive-numbers tr") >= 3 and opened.count("#drive-curves .chart") >= 1
        assert not re.search(r"e-\d", opened.text("drive-numbers")), "rounding errors are shown as zero"
        assert opened.count("[data-layer=drive] *") >= 1, kind
        parts = "[...document.querySelectorAll('#parts [data-part]')].map((part) => part.dataset.part)"
        opened.wait(f"{parts}.includes('coupler') && {parts}.includes('rod') === {str(kind == 'dyad').lower()}")


def test_a_catalogue_offers_its_rows_and_the_drawing_has_the_drive(opened) -> None:
    opened.run("document.getElementById('drive-catalogue').value = 'iso_6432'")
    fill(opened, kind="actuator", **{"force-y": 5})
    found(opened)
    opened.wait("document.querySelectorAll('#drive-found button').length > 1")
    assert "ISO 6432" in opened.text("drive-found")
    second = opened.run("return document.querySelectorAll('#drive-found button')[1].textContent")
    opened.run("document.querySelectorAll('#drive-found button')[1].click()")
    assert second.split(" on the ")[0] in opened.text("drive-numbers")
    assert b"DRIVE" in opened.saved("linkage-1.dxf", "#exports [data-format=dxf]", "mouse")


def test_the_best_three_are_compared_within_a_box_for_the_mount(opened) -> None:
    """Drives are ordered with the motor at A first, springs by increasing remaining torque."""
    box = {"box-0": -100, "box-1": -600, "box-2": 600, "box-3": 300}
    fill(
        opened,
        kind="any",
        catalogue="",
        mass=5,
        **box,
        **dict.fromkeys(("force-y", "retracted", "stroke", "reach", "ratio"), ""),
    )
    found(opened)
    names = opened.texts("#drive-found strong")
    assert [name.split(" ")[0] for name in names] == ["drive", "cylinder", "motor"]
    assert names[0].startswith("drive in a hinge on the ")
    assert all("where" in card and " mm" in card for card in opened.texts("#drive-found button"))
    fill(opened, **{"box-3": ""})
    opened.click("drive-find")
    opened.wait("document.getElementById('drive-note').className.includes('bad')")
    assert opened.text("drive-note").endswith("Give all four sides of the box, or none of them.")
    fill(opened, kind="springs", **dict.fromkeys(box, ""))
    found(opened)
    left = [float(re.search(r"torque left\s+([\d.]+)", card)[1]) for card in opened.texts("#drive-found button")]
    assert 1 < len(left) <= 3 and left == sorted(left)
    opened.run("document.querySelectorAll('#drive-found button')[1].click()")
    assert opened.count("#drive-found [aria-pressed=true]") == 1 and opened.faults("#drive-card") == []
    fill(opened, kind="actuator", mass="")


def test_bad_numbers_and_refusals_are_answered_in_words(opened) -> None:
    fill(opened, kind="dyad", ratio=9)
    opened.click("drive-find")
    opened.wait("document.getElementById('drive-note').className.includes('bad')")
    assert re.fullmatch(r"Time ratio of a motor: .*\b5\b.*", opened.text("drive-note")), "by the name of its field"
    refused = [
        {"kind": "tension", "link": "two springs", "name": None, "reason": "no spring of 12 fits"},
        {"kind": "rotary", "link": "crank", "name": None, "reason": "it does not turn"},
    ]
    opened.run(
        "const own = (window.real = window.fetch), reply = JSON.stringify(arguments[0]);"
        "window.fetch = (...a) => (a[0] === '/v2/drives' ? Promise.resolve(new Response(reply)) : own(...a))",
        {"drives": [], "springs": [], "notes": [], "refused": refused},
    )
    fill(opened, kind="rotary", ratio="")
    found(opened)
    assert opened.texts("#drive-refused li") == [
        "tension spring, two springs: no spring of 12 fits.",
        "drive in a hinge on the crank: it does not turn.",
    ]
    opened.run("window.fetch = window.real")


def test_a_cylinder_between_given_ends_is_evaluated(opened) -> None:
    fill(opened, kind="actuator", **{"force-y": -100, "retracted": "", "stroke": "", "count": 2})
    found(opened)
    rows = opened.text("drive-numbers")
    ground, pin = (
        re.search(rf"{name}\s+(-?[\d.]+), (-?[\d.]+)", rows).groups() for name in ("ground point", r"pin at \w+ 1")
    )
    link, force = re.search(r"on the (\w+), 2 side by side", rows)[1], number(opened, "peak force")
    opened.unfold("drive-ends")
    opened.select("drive-link", link)
    opened.select("drive-catalogue", "")
    fill(opened, **{"ground-x": ground[0], "ground-y": ground[1], "pin-x": pin[0], "pin-y": pin[1]})
    found(opened)
    assert number(opened, "peak force") == pytest.approx(force, rel=1e-2)
    fill(opened, **{"pin-y": ""})
    opened.click("drive-find")
    opened.wait("document.getElementById('drive-note').className.includes('bad')")
    assert opened.text("drive-note").startswith("Ends: give x and y")
    fill(opened, **dict.fromkeys(("ground-x", "ground-y", "pin-x", "pin-y", "count"), ""))


def test_a_torsion_spring_holds_a_body_shut(opened) -> None:
    fill(opened, kind="torsion", **{"force-y": "", "hold-force": 0.01})
    opened.run("document.getElementById('drive-holds-closed').checked = true")
    found(opened)
    assert re.search(r"torsion spring N mm|its twist", opened.text("drive-numbers"))
    assert "first position: is pressed onto its stop" in opened.text("drive-numbers")
    opened.run("document.getElementById('drive-holds-closed').checked = false")
    fill(opened, **{"hold-force": "", "wanted": "0 2 x"})
    opened.click("drive-find")
    assert (
        opened.text("drive-note") == "Its values, first to last: at least 2 numbers are needed, separated by spaces."
    )
    fill(opened, wanted="0; 2,5; 3")
    opened.record_requests()
    found(opened)
    assert opened.last_request()["springs"][0]["target"] == {"torque": [0, 2.5, 3]}
    fill(opened, wanted="", kind="actuator", **{"pin-box": "0 -50 90 50"})
    found(opened)
    assert opened.last_request()["drives"][0]["pin_box"] == [0, -50, 90, 50]
    fill(opened, **{"pin-box": ""})


def test_a_drive_that_slides_is_told_in_lengths(page) -> None:
    poses = {"rotation": [0, 30, 60, 90], "position": [[0, 0], [120, 40], [200, 120], [220, 220]], "timing": "free"}
    page.load_request({**poses, "mechanisms": ["rail_slot"], "driver": "cylinder"})
    page.solve_soon()
    assert "cylinder" in page.text("numbers") and not re.search(r"e-1\d", page.text("numbers"))
    fill(page, kind="actuator", **{"force-y": -200})
    found(page)
    assert "mm a mm of travel" in page.text("drive-numbers") and "radian" not in page.text("drive-card")
    assert "Moment arm, mm a mm of travel" in page.texts("#drive-curves h3")
