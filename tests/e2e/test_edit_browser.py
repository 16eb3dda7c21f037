"""A linkage edited in the page: joints typed as well as dragged, and refined by the service from just there."""

from __future__ import annotations

import re

import pytest

from tests.e2e.test_page_browser import (  # noqa: F401
    IDLE,
    ActionChains,
    Keys,
    Select,
    drawn,
    find,
    mode,
    opened,
    pick,
    pytestmark,
    rest,
    take,
    wait,
)
from tests.e2e.test_tasks_browser import text_of


@pytest.fixture
def edited(opened):  # noqa: F811
    """The page with its first machine at rest, in the mode that edits the linkage."""
    rest(opened)
    mode(opened, "hand")
    return opened


def type_joint(page, name: str, entry: str, key: str = Keys.TAB) -> None:
    find(page, name).click()
    ActionChains(page).key_down(Keys.CONTROL).send_keys("a").key_up(Keys.CONTROL).send_keys(entry + key).perform()


def value(page, name: str) -> str:
    return find(page, name).get_attribute("value")


def card(page) -> str:
    return pick(page, "#solutions [aria-pressed=true]").text


def test_joints_are_typed_and_stay_as_typed(edited) -> None:
    page = edited
    places = {name: (value(page, f"joint-{name}-x"), value(page, f"joint-{name}-y")) for name in "abdcp"}
    half_pixel = 0.5 / float(find(page, "canvas").get_attribute("data-view").split()[2])
    for name, (x, y) in places.items():
        assert abs(drawn(page, name) - complex(float(x), float(y))) < half_pixel
    before = text_of(page, "joints-note")
    typed = {"joint-c-x": "+1,234e2", "joint-a-y": "-20.50", "joint-p-x": f"{float(places['p'][0]) + 3:.3f}0"}
    for name, entry in typed.items():
        type_joint(page, name, entry)
    assert {name: value(page, name) for name in typed} == typed, "to the letter, though others moved after it"
    assert drawn(page, "c").real == pytest.approx(123.4, abs=half_pixel)
    assert drawn(page, "a").imag == pytest.approx(-20.5, abs=half_pixel)
    assert value(page, "joint-b-x") == places["b"][0], "what was not typed stays where it was"
    assert text_of(page, "joints-note") != before and "Off by at most" in text_of(page, "joints-note")
    assert card(page).startswith("By hand")
    worst = re.search(r"Off by at most ([\d.]+) mm", text_of(page, "joints-note"))[1]
    assert f"{worst} mm" in text_of(page, "numbers"), "the same error as in the numbers"
    assert page.execute_script("return document.querySelectorAll('#canvas .worst').length") >= 1


def test_what_cannot_be_used_stays_and_is_named(edited) -> None:
    page = edited
    before = drawn(page, "d")
    type_joint(page, "joint-d-x", "12 mm")
    assert value(page, "joint-d-x") == "12 mm" and find(page, "joint-d-x").get_attribute("aria-invalid") == "true"
    assert text_of(page, "joints-error").startswith("D, x: “12 mm” is not a number;")
    assert abs(drawn(page, "d") - before) < 0.2, "nothing has moved"
    type_joint(page, "joint-d-x", "", Keys.ENTER)
    assert "is still in use" in text_of(page, "joints-error")
    type_joint(page, "joint-d-x", f"{before.real + 1:.2f}", Keys.ENTER)
    assert text_of(page, "joints-error") == ""
    for name, entry in (("b-x", "150"), ("b-y", "40"), ("a-x", "150"), ("a-y", "40")):
        type_joint(page, f"joint-{name}", entry, Keys.ENTER)
    assert text_of(page, "joints-error") == "A, y: two joints would coincide there."


def test_the_unit_is_the_chosen_one_and_other_modes_hide_the_fields(edited) -> None:
    page = edited
    Select(find(page, "length-unit")).select_by_visible_text("in")
    assert "Places in in where the crank stands" in text_of(page, "joints-panel")
    mode(page, "move")
    assert not find(page, "joints-panel").is_displayed()


def test_a_linkage_is_refined_from_there_by_keys_alone(edited) -> None:
    page = edited
    cards = page.execute_script("return document.querySelectorAll('#solutions li').length")
    find(page, "joint-c-y").send_keys(Keys.CONTROL, "a")
    moved = float(value(page, "joint-c-y")) + 12
    find(page, "joint-c-y").send_keys(f"{moved:.1f}", Keys.ENTER)
    by_hand = float(re.search(r"Off by at most ([\d.]+)", text_of(page, "joints-note"))[1])
    pick(page, "#refine-here").send_keys(Keys.ENTER)
    wait(page, f"{IDLE} && document.getElementById('status').textContent.startsWith('Refined')")
    said = text_of(page, "status")
    assert said.endswith("Linkages elsewhere were not looked at.")
    assert float(re.search(r"off by ([\d.]+) mm", said)[1]) < by_hand
    assert not card(page).startswith("By hand") and "within practical limits" in card(page)
    assert page.execute_script("return document.querySelectorAll('#solutions li').length") in (cards, cards + 1)
    assert "may be better" in text_of(page, "trace-note") and "Descent ended" in text_of(page, "trace-note")


def test_a_refinement_that_leads_nowhere_says_so_and_keeps_the_linkage(edited) -> None:
    page = edited
    page.execute_script("document.getElementById('limits').open = true")
    Select(find(page, "prefer")).select_by_value("size")
    find(page, "joint-c-y").send_keys(Keys.CONTROL, "a")
    find(page, "joint-c-y").send_keys("200", Keys.ENTER)
    page.execute_script(
        "const own = window.fetch; window.fetch = async (path, ...rest) => { const reply = await own(path, ...rest);"
        "if (path !== '/v1/synthesize') return reply; window.asked = JSON.parse(rest[0].body); const body = await reply.json();"
        "return new Response(JSON.stringify({...body, status: 'unknown', solutions: []}), {status: 200}); }"
    )
    pick(page, "#refine-here").click()
    wait(page, f"{IDLE} && document.getElementById('status').classList.contains('bad')")
    assert "proves nothing" in text_of(page, "status") and card(page).startswith("By hand")
    asked = page.execute_script("return window.asked")
    assert len(asked["refine_from"]["crank_angle"]) == len(asked["position"]) and asked["top"] == 1
    assert "prefer" not in asked, "nothing is chosen among"


def test_a_linkage_given_with_a_request_is_no_part_of_the_motion(opened) -> None:  # noqa: F811
    begin = {"links": {"crank": 1, "coupler": 2, "rocker": 2, "ground": 2}, "branch": 1, "start_angle": 0}
    take(opened, {"position": [[0, 0], [3, 4], [6, 5]], "timing": "free", "refine_from": begin})
    opened.execute_script("document.getElementById('request').open = true")
    wait(opened, "document.getElementById('request-text').textContent")
    assert "refine_from" not in text_of(opened, "request-text")
