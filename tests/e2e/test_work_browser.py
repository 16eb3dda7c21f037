"""Work of one's own in the page: kept as a draft, undone step by step, opened from a link; answers to what was asked."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest

from tests.e2e.test_page_browser import (  # noqa: F401
    FREE,
    IDLE,
    ActionChains,
    By,
    Keys,
    Select,
    asked,
    assert_no_errors,
    choose,
    click_canvas,
    drag,
    drawn,
    faults,
    find,
    load,
    mode,
    opened,
    path_request,
    pick,
    placed,
    pytestmark,
    rest,
    solve,
    solve_soon,
    stub,
    table,
    take,
    trace,
    view,
    wait,
)
from tests.e2e.test_tasks_browser import text_of

READY = "document.body.dataset.ready"
CARDS = "document.querySelectorAll('#solutions li').length"


def paste(page, rows: str) -> None:
    find(page, "paste").click()
    page.execute_script("document.getElementById('paste-text').value = arguments[0]", rows)
    find(page, "paste-use").click()


def undo(page, again: bool = False) -> None:
    keys = ActionChains(page).key_down(Keys.CONTROL)
    keys = keys.key_down(Keys.SHIFT).send_keys("z").key_up(Keys.SHIFT) if again else keys.send_keys("z")
    keys.key_up(Keys.CONTROL).perform()


def reload(page) -> None:
    page.refresh()
    wait(page, READY)


def draw(page, places) -> None:
    mode(page, "path")
    trace(page, find(page, "canvas"), places)


OVAL = [(round(150 * np.cos(t)), round(-80 * np.sin(t))) for t in np.linspace(0, 2 * np.pi, 30)]


# -- the draft ---------------------------------------------------------------------------------------------------------


def test_what_is_drawn_or_pasted_survives_reload_back_and_other_pages(opened, address) -> None:  # noqa: F811
    draw(opened, OVAL)
    oval = placed(opened)
    assert text_of(opened, "draft-text").startswith("Draft, kept in this browser")
    reload(opened)
    assert placed(opened) == pytest.approx(oval) and find(opened, "closed").is_selected()
    assert text_of(opened, "draft-text").startswith("Draft") and not find(opened, "draft-open").is_displayed()
    paste(opened, "x in, y in\n0, 0\n1, 2\n3, 2.5")
    for away in ("/function", "/scenes/lift"):
        opened.get(f"{address}{away}")
        wait(opened, READY, 60)
        opened.back()
        wait(opened, READY)
        assert placed(opened).tolist() == [[0, 0], [1, 2], [3, 2.5]]
        opened.get(address)
        wait(opened, READY)
        assert placed(opened).tolist() == [[0, 0], [1, 2], [3, 2.5]]
    assert find(opened, "length-unit").get_attribute("value") == "in"
    find(opened, "draft-discard").click()
    assert "Casement" in text_of(opened, "example-note") and not find(opened, "draft").is_displayed()
    reload(opened)
    assert "Casement" in text_of(opened, "example-note") and not find(opened, "draft").is_displayed()


def test_an_example_is_a_draft_only_once_it_is_changed(opened) -> None:  # noqa: F811
    choose(opened, "wiper")
    assert not find(opened, "draft").is_displayed()
    assert opened.execute_script("return localStorage.getItem('linkage-atlas-motion')") is None
    find(opened, "any-order").click()
    assert find(opened, "draft").is_displayed()
    choose(opened, "leg")
    assert "kept in this browser" in text_of(opened, "draft-text"), "another example leaves the draft"
    find(opened, "draft-open").click()
    assert find(opened, "any-order").is_selected() and len(table(opened)) == 9


def test_a_link_wins_over_the_draft_and_leaves_it(opened, address) -> None:  # noqa: F811
    paste(opened, "0, 0\n10, 20\n30, 25")
    link = opened.execute_async_script(
        "const [body, done] = arguments; import('/static/link.js').then(async (l) => done(await l.toFragment(body)))",
        {"position": [[1, 2], [3, 4], [5, 9]], "crank_span": 50},
    )
    opened.get("about:blank")
    opened.get(f"{address}/#{link}")
    wait(opened, f"{READY} && {IDLE}")
    assert placed(opened)[0].tolist() == [1, 2] and "is replaced once" in text_of(opened, "draft-text")
    find(opened, "draft-open").click()
    assert placed(opened)[1].tolist() == [10, 20]
    undo(opened)
    assert placed(opened)[0].tolist() == [1, 2]
    reload(opened)
    kept = opened.execute_script("return localStorage.getItem('linkage-atlas-motion')")
    assert json.loads(kept)["content"]["request"]["position"][1] == [10, 20]
    find(opened, "add-row").click()
    assert opened.execute_script("return location.hash") == "", "the address no longer says what is there"
    reload(opened)
    assert len(table(opened)) == 4 and text_of(opened, "draft-text").startswith("Draft, kept")


BROKEN = (
    "{",
    "null",
    "7",
    '"text"',
    '{"at": "x", "content": {}}',
    '{"at": 1, "content": null}',
    '{"at": 1, "content": {"request": null}}',
    '{"at": 1, "content": {"request": {"position": [[0, 0], ["a", 1]], "timing": "free"}}}',
    '{"at": 1, "content": {"request": {"position": [[0, 0], [1, 1]], "timing": "free", "limits": null}}}',
    '{"at": 1, "content": {"request": {"position": [[0, 0], [1, 1]], "timing": "free", "limits": {"pivot_box": "abcd"}}}}',
    '{"at": 1, "content": {"request": {"position": [[0, 0], [1e300, 1]], "timing": "free", "top": {}}}}',
    '{"at": 1, "content": {"fields": {"name": 5, "table": null}, "drawn": [[1, 2], "x"]}}',
    '{"at": 1e300, "content": {"fields": null, "drawn": 5}}',
)


@pytest.mark.parametrize("page", ["motion", "function"])
def test_a_store_with_something_else_in_it_breaks_no_page(opened, address, page) -> None:  # noqa: F811
    for content in BROKEN:
        opened.execute_script("localStorage.setItem(arguments[0], arguments[1])", f"linkage-atlas-{page}", content)
        opened.get(address if page == "motion" else f"{address}/function")
        wait(opened, READY)
        if page == "motion":
            assert "Casement" in text_of(opened, "example-note"), content
        else:
            assert find(opened, "name").get_attribute("value") == "log10", content
        assert not find(opened, "draft").is_displayed() or "fields" in content


def test_without_a_store_the_page_works(opened, address) -> None:  # noqa: F811
    source = (
        "Object.defineProperty(window, 'localStorage', {get() { throw new DOMException('no', 'SecurityError') }})"
    )
    script = opened.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": source})
    opened.get(address)
    wait(opened, READY)
    opened.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", script)
    paste(opened, "0, 0\n10, 20\n30, 25")
    assert len(table(opened)) == 3 and not find(opened, "draft").is_displayed()


# -- one undo ------------------------------------------------------------------------------------------------------------


def card(page) -> str:
    return pick(page, "#solutions [aria-pressed=true]").text


def test_undo_takes_back_motion_and_joints_in_the_order_in_which_they_were_changed(opened) -> None:  # noqa: F811
    rest(opened)
    opened.execute_script("document.getElementById('limits').open = true")
    family, before = find(opened, "family").get_attribute("value"), drawn(opened, "c")
    find(opened, "any-order").click()
    mode(opened, "hand")
    drag(opened, pick(opened, "#canvas [data-joint=c]"), 14, -9)
    first = drawn(opened, "c")
    drag(opened, pick(opened, "#canvas [data-joint=a]"), 5, 6)
    second = drawn(opened, "a")
    Select(find(opened, "family")).select_by_value("crank_rocker")
    undo(opened)
    assert find(opened, "family").get_attribute("value") == family and abs(drawn(opened, "a") - second) < 0.5
    undo(opened)
    assert abs(drawn(opened, "a") - second) > 1 and abs(drawn(opened, "c") - first) < 0.5
    assert card(opened).startswith("By hand") and find(opened, "any-order").is_selected()
    undo(opened)
    assert abs(drawn(opened, "c") - before) < 0.5 and not card(opened).startswith("By hand")
    assert not any("By hand" in one.text for one in opened.find_elements(By.CSS_SELECTOR, "#solutions button"))
    assert find(opened, "any-order").is_selected(), "the motion is as it was"
    undo(opened)
    assert not find(opened, "any-order").is_selected() and not find(opened, "undo").is_enabled()
    for _ in range(4):
        undo(opened, again=True)
    assert abs(drawn(opened, "a") - second) < 0.5 and card(opened).startswith("By hand")
    assert find(opened, "family").get_attribute("value") == "crank_rocker" and not find(opened, "redo").is_enabled()


def test_undo_takes_back_a_joint_that_was_typed_or_moved_by_keys(opened) -> None:  # noqa: F811
    rest(opened)
    mode(opened, "hand")
    before = drawn(opened, "c")
    joint = pick(opened, "#canvas [data-joint=c]")
    for _ in range(3):
        joint.send_keys(Keys.ARROW_RIGHT)
    moved = drawn(opened, "c")
    find(opened, "joint-c-y").send_keys(Keys.CONTROL, "a")
    find(opened, "joint-c-y").send_keys(f"{moved.imag + 12:.1f}", Keys.ENTER)
    assert abs(drawn(opened, "c").imag - moved.imag - 12) < 1
    undo(opened)
    assert abs(drawn(opened, "c") - moved) < 0.5
    undo(opened)
    assert abs(drawn(opened, "c") - before) < 0.5


def test_undo_of_another_motion_brings_its_answer_and_linkage_back(opened) -> None:  # noqa: F811
    rest(opened)
    mode(opened, "hand")
    before = drawn(opened, "c")
    drag(opened, pick(opened, "#canvas [data-joint=c]"), 14, -9)
    moved = drawn(opened, "c")
    find(opened, "new-path").click()
    assert opened.execute_script(f"return {CARDS}") == 0 and text_of(opened, "example-note") == ""
    undo(opened)
    assert "Casement" in text_of(opened, "example-note") and card(opened).startswith("By hand")
    assert abs(drawn(opened, "c") - moved) < 0.5
    assert not opened.execute_script("return document.querySelector('#results [data-earlier]').checkVisibility()")
    undo(opened)
    assert abs(drawn(opened, "c") - before) < 0.5


# -- links in a tab that is open ----------------------------------------------------------------------------------------


def test_a_link_pasted_into_an_open_tab_is_solved(opened) -> None:  # noqa: F811
    request = path_request([0, 60, 120])
    own = opened.execute_async_script(
        "const [body, done] = arguments; import('/static/link.js').then(async (l) => done(await l.toFragment(body)))",
        request,
    )
    stub(opened, request, [0, 60, 120])
    opened.execute_script("location.hash = arguments[0]", own)
    wait(opened, f"{CARDS} === 4 && {IDLE}")
    assert asked(opened)["position"] == request["position"] and len(table(opened)) == 3
    opened.back()
    wait(opened, "document.getElementById('example-note').textContent.includes('Casement')")
    paste(opened, "0, 0\n10, 20\n30, 25")
    opened.execute_script("window.asked = []; location.hash = arguments[0]", own)
    wait(opened, f"{CARDS} === 4 && {IDLE} && window.asked.length")
    undo(opened)
    assert placed(opened).tolist() == [[0, 0], [10, 20], [30, 25]]


# -- cards belong to what was asked --------------------------------------------------------------------------------------


def earlier(page) -> bool:
    """Whether each card that is shown says that it is of an earlier request; they all do, or none."""
    script = (
        "return [...document.querySelectorAll('[data-earlier]')].filter((one) => one.closest('.card').checkVisibility())"
        ".map((one) => one.checkVisibility())"
    )
    (all_of_them,) = set(page.execute_script(script)) or {None}
    return all_of_them


def test_cards_of_an_earlier_request_say_so_or_are_gone(opened) -> None:  # noqa: F811
    assert earlier(opened) is False
    find(opened, "any-order").click()
    assert earlier(opened) is True, "the motion is another one"
    assert faults(opened) == []
    undo(opened)
    assert earlier(opened) is False
    opened.execute_script("window.real = window.fetch; window.fetch = () => Promise.reject(new TypeError('gone'))")
    find(opened, "solve").click()
    wait(opened, "document.getElementById('status').classList.contains('bad')")
    assert earlier(opened) is True and "cannot be reached" in text_of(opened, "status")
    opened.execute_script("window.fetch = window.real")
    request = path_request([0, 60, 120], limits={"link_min": 99})
    take(opened, request)
    assert opened.execute_script(f"return {CARDS}") == 0 and earlier(opened) is None
    stub(opened, request, [0, 60, 120])
    solve(opened)
    assert earlier(opened) is False and opened.execute_script(f"return {CARDS}") == 4
    stub(opened, request, [0, 60, 120], [])
    opened.execute_script(
        "window.stub.status = 'infeasible';"
        "window.stub.report.notes = ['link_min excludes every linkage that was looked for; at 42.5 there is one']"
    )
    find(opened, "solve").click()
    wait(opened, IDLE)
    assert opened.execute_script(f"return {CARDS}") == 0 and not find(opened, "results").is_displayed()
    assert find(opened, "suggestions").is_displayed()
    find(opened, "any-order").click()
    assert not find(opened, "suggestions").is_displayed(), "they are of the motion before"
    find(opened, "new-motion").click()
    assert text_of(opened, "status") == "" and opened.execute_script(f"return {CARDS}") == 0


def test_an_answer_to_a_motion_that_was_changed_meanwhile_says_so(opened) -> None:  # noqa: F811
    request = path_request([0, 60, 120])
    take(opened, request)
    stub(opened, request, [0, 60, 120])
    opened.execute_script(
        "const own = window.fetch;"
        "window.fetch = async (...a) => { await new Promise((go) => { window.go = go; }); return own(...a) }"
    )
    find(opened, "solve").click()
    wait(opened, "window.go")
    find(opened, "any-order").click()
    opened.execute_script("window.go()")
    wait(opened, f"{CARDS} === 4 && {IDLE}")
    assert earlier(opened) is True and "has changed since" in text_of(opened, "status")
    undo(opened)
    assert earlier(opened) is False and "off by" in text_of(opened, "status")


def test_a_note_goes_with_its_motion(opened) -> None:  # noqa: F811
    paste(opened, "0,0,0\n10,4,350\n10,4,350\n20,5,10")
    assert "Poses 2 and 3 are the same" in text_of(opened, "example-note") and find(opened, "unwrap").is_displayed()
    undo(opened)
    assert "Casement" in text_of(opened, "example-note") and not find(opened, "unwrap").is_displayed()


def replies(page, *sizes: float) -> None:
    """Let the service answer stage by stage, each time with `FREE` so many times as large."""
    page.execute_script(
        "const [sizes] = arguments, reply = window.stub, stages = sizes.map((size, k) => { const one = structuredClone(reply);"
        "one.report.stopped_by = k < sizes.length - 1 ? 'budget' : 'converged';"
        "for (const s of one.solutions) { for (const n in s.links) s.links[n] *= size; s.mount.coupler_point.radius *= size;"
        "for (const p of ['pivot_a', 'pivot_b']) s.mount[p] = s.mount[p].map((v) => v * size + 400 * (size - 1));"
        "s.errors.objective /= size; }"
        "return one; });"
        "Object.defineProperty(window, 'stub', {configurable: true, get: () => stages.length > 1 ? stages.shift() : stages[0]})",
        sizes,
    )


def in_view(page) -> bool:
    return page.execute_script(
        "const f = document.getElementById('canvas').getBoundingClientRect();"
        "return [...document.querySelectorAll('#canvas [data-joint], #canvas .dot')].map((one) => one.getBoundingClientRect())"
        ".every((one) => one.left > f.left && one.right < f.right && one.top > f.top && one.bottom < f.bottom)"
    )


def test_the_view_fits_a_new_answer_unless_the_user_has_moved_it(opened) -> None:  # noqa: F811
    request = path_request([0, 60, 120])
    take(opened, request)
    stub(
        opened,
        request,
        [0, 60, 120],
        [{"order": True, "branch": True, "circuit": True, "buildable": True, "reasons": []}],
    )
    for _ in range(3):
        find(opened, "zoom-in").click()
    replies(opened, 1, 3)
    solve(opened)
    assert drawn(opened, "a").real > 400, "the answer of the second stage"
    assert in_view(opened)
    find(opened, "zoom-in").click()
    before = view(opened)
    solve(opened)
    assert view(opened) == before, "zoomed on purpose since the last answer to this motion"
    find(opened, "any-order").click()
    solve(opened)
    assert view(opened) != before and in_view(opened), "another motion"


# -- paths drawn by mouse ------------------------------------------------------------------------------------------------


def along(*corners) -> list[tuple[int, int]]:
    """Places in even steps from corner to corner."""
    points = np.array(corners, float)
    ways = [np.linspace(a, b, 8, endpoint=False) for a, b in itertools.pairwise(points)]
    return [tuple(map(round, place)) for place in np.vstack([*ways, points[-1:]]).tolist()]


TURN = np.linspace(0, 2 * np.pi, 36)
SHAPES = {
    "oval": OVAL,
    "D": [
        *along((-80, 90), (-80, -90)),
        *((round(-80 + 150 * np.sin(t)), round(-90 * np.cos(t))) for t in TURN[1:18]),
    ],
    "rectangle": along((-120, 70), (-120, -70), (120, -70), (120, 70), (-120, 70)),
    "eight": [(round(150 * np.sin(t)), round(-80 * np.sin(2 * t))) for t in TURN],
    "line": along((-150, 40), (150, -40)),
    "wave": [(round(-180 + 360 * k / 40), round(-60 * np.sin(2 * np.pi * k / 40))) for k in range(41)],
}


@pytest.mark.parametrize(
    "shape", ["oval", *(pytest.param(name, marks=pytest.mark.wide) for name in SHAPES if name != "oval")]
)
def test_a_shape_drawn_by_mouse_is_solved(browser, served, shape) -> None:
    """By the service as it is run, within the memory of a request."""
    load(browser, served)
    draw(browser, SHAPES[shape])
    assert len(table(browser)) == 24
    find(browser, "solve").click()
    wait(browser, f"{IDLE} && document.getElementById('status').textContent", 90)
    assert "off by" in text_of(browser, "status"), text_of(browser, "status")
    assert browser.execute_script(f"return {CARDS}") >= 1 and earlier(browser) is False
    assert in_view(browser)
    assert_no_errors(browser)
