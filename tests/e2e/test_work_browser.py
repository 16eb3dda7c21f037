"""The user's work is kept as a draft, undone step by step and opened from a link; results belong to their request."""

import json

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

from tests.conftest import some_of
from tests.e2e.page import CARDS, IDLE, READY, VERDICTS, path_request

OVAL = [(round(150 * np.cos(t)), round(-80 * np.sin(t))) for t in np.linspace(0, 2 * np.pi, 30)]


# -- the draft ---------------------------------------------------------------------------------------------------------


def test_what_is_drawn_or_pasted_survives_reload_back_and_other_pages(page) -> None:
    page.draw(OVAL)
    oval = page.positions()
    assert page.text("draft-text").startswith("Draft, stored in this browser")
    page.reload()
    assert page.positions() == pytest.approx(oval) and page.ticked("closed")
    assert page.text("draft-text").startswith("Draft") and not page.shown("draft-open")
    page.paste("x in, y in\n0, 0\n1, 2\n3, 2.5")
    for restore in (page.back, page.go):
        page.go("/scenes/lift")
        restore()
        assert page.positions().tolist() == [[0, 0], [1, 2], [3, 2.5]]
    assert page.value("length-unit") == "in"
    page.click("draft-discard")
    assert page.shown("welcome") and not page.shown("last-project")
    page.reload()
    assert page.shown("welcome") and not page.shown("last-project")


def test_an_example_and_a_link_leave_the_draft(page) -> None:
    page.choose("wiper")
    assert not page.shown("draft")
    assert page.run("return localStorage.getItem('linkage-atlas-motion')") is None
    page.click("any-order")
    assert page.shown("draft")
    page.choose("leg")
    assert "stored in this browser" in page.text("draft-text"), "another example leaves the draft"
    page.click("draft-open")
    assert page.ticked("any-order") and len(page.table()) == 9
    page.load()
    page.paste("0, 0\n10, 20\n30, 25")
    link = page.run_async(
        "const [body, done] = arguments; import('/static/link.js').then(async (l) => done(await l.toFragment(body)))",
        {"position": [[1, 2], [3, 4], [5, 9]], "crank_span": 50},
    )
    page.leave()
    page.browser.get(f"{page.address}/#{link}")
    page.wait(f"{READY} && {IDLE}")
    assert page.positions()[0].tolist() == [1, 2] and "change replaces it" in page.text("draft-text")
    page.click("draft-open")
    assert page.positions()[1].tolist() == [10, 20]
    page.undo()
    assert page.positions()[0].tolist() == [1, 2]
    page.reload()
    stored = page.run("return localStorage.getItem('linkage-atlas-motion')")
    assert json.loads(stored)["content"]["request"]["position"][1] == [10, 20]
    page.click("add-row")
    assert page.run("return location.hash") == "", "the address no longer says what is there"
    page.reload()
    assert len(page.table()) == 4 and page.text("draft-text").startswith("Draft, stored")


def test_each_tab_keeps_its_own_draft(page) -> None:
    """A new tab offers the last draft, and its changes leave the draft of the other tab as it was."""
    page.paste("0, 0\n10, 20\n30, 25")
    first = page.browser.current_window_handle
    page.browser.switch_to.new_window("tab")
    try:
        page.go()
        assert page.text("last-project").startswith("Continue the last project: 3 points, ")
        page.click("last-project")
        assert page.positions()[1].tolist() == [10, 20]
        page.paste("0, 0\n7, 8\n30, 25")
        page.browser.switch_to.window(first)
        page.reload()
        assert page.positions()[1].tolist() == [10, 20], "the other tab's draft came in its place"
        page.click("draft-discard")
        page.reload()
        assert page.shown("welcome")
        page.browser.switch_to.window(next(handle for handle in page.browser.window_handles if handle != first))
        page.reload()
        assert page.positions()[1].tolist() == [7, 8]
        page.browser.close()
    finally:
        page.browser.switch_to.window(first)


def test_a_named_project_is_saved_opened_with_its_linkage_and_deleted(page) -> None:
    page.press("#project-form [type=submit]")
    assert page.text("status") == "A project needs a name."
    page.choose_card(1)
    links = page.links()
    page.type_into("project-name", "Sash" + Keys.ENTER)
    assert page.text("status") == "The project Sash is saved in this browser."
    page.go()
    page.press("#project-list .link")
    page.wait(f"{CARDS} && {IDLE}")
    assert len(page.table()) == 8 and page.links() == pytest.approx(links, rel=1e-3)
    page.go()
    page.press("#project-list .quiet")
    assert page.shown("welcome") and not page.shown("projects")


MOTION = '{"at": 1, "content": {"request": {"position": [[0, 0], %s], "timing": "free"%s}}}'
BROKEN = ["{", "null", "7", '"text"', '{"at": "x", "content": {}}', '{"at": 1, "content": null}']
BROKEN += ['{"at": 1, "content": {"request": null}}', MOTION % ('["a", 1]', "")]
BROKEN += [MOTION % ("[1, 1]", f', "limits": {limits}') for limits in ("null", '{"pivot_box": "abcd"}')]
BROKEN += [MOTION % ("[1e300, 1]", ', "top": {}'), '{"at": 1e300, "content": {"law": {"drawn": 5}}}']
BROKEN.insert(-1, '{"at": 1, "content": {"law": {"name": 5, "table": null, "drawn": [[1, 2], "x"]}, "limits": 7}}')


@pytest.mark.parametrize("wide", some_of([False, True], 1))
def test_a_store_with_something_else_in_it_breaks_no_page(page, wide) -> None:
    for content in BROKEN if wide else BROKEN[::6]:
        page.run("sessionStorage.clear(); localStorage.setItem('linkage-atlas-motion', arguments[0])", content)
        page.go()
        assert page.shown("welcome"), content
        if page.shown("last-project"):
            page.click("last-project")
        assert not page.shown("draft") or "law" in content


def test_without_a_store_the_page_works(page) -> None:
    source = (
        "Object.defineProperty(window, 'localStorage', {get() { throw new DOMException('no', 'SecurityError') }})"
    )
    script = page.cdp("Page.addScriptToEvaluateOnNewDocument", {"source": source})
    page.go()
    page.cdp("Page.removeScriptToEvaluateOnNewDocument", script)
    page.press("[data-begin=paste]")
    page.paste("0, 0\n10, 20\n30, 25")
    assert len(page.table()) == 3 and not page.shown("draft")


# -- undo ----------------------------------------------------------------------------------------------------------------


def test_undo_takes_back_motion_and_joints_in_the_order_in_which_they_were_changed(page) -> None:
    page.pause()
    page.unfold("limits")
    family, before = page.value("family"), page.drawn("c")
    page.click("any-order")
    page.mode("hand")
    page.drag(page.pick("#canvas [data-joint=c]"), 14, -9)
    first = page.drawn("c")
    page.drag(page.pick("#canvas [data-joint=a]"), 5, 6)
    second = page.drawn("a")
    page.select("family", "crank_rocker")
    page.undo()
    assert page.value("family") == family and abs(page.drawn("a") - second) < 0.5
    page.undo()
    assert abs(page.drawn("a") - second) > 1 and abs(page.drawn("c") - first) < 0.5
    assert page.card().startswith("By hand") and page.ticked("any-order")
    page.undo()
    assert abs(page.drawn("c") - before) < 0.5 and not page.card().startswith("By hand")
    assert not any("By hand" in one.text for one in page.cards())
    assert page.ticked("any-order"), "the motion is as it was"
    page.undo()
    assert not page.ticked("any-order") and not page.find("undo").is_enabled()
    for _ in range(4):
        page.undo(redo=True)
    assert abs(page.drawn("a") - second) < 0.5 and page.card().startswith("By hand")
    assert page.value("family") == "crank_rocker" and not page.find("redo").is_enabled()


def test_undo_brings_back_joints_and_the_answer_of_another_motion(edited) -> None:
    before = edited.drawn("c")
    edited.pick("#canvas [data-joint=c]").send_keys(Keys.ARROW_RIGHT * 3)
    moved = edited.drawn("c")
    edited.type_into("joint-c-y", f"{moved.imag + 12:.1f}" + Keys.ENTER)
    assert abs(edited.drawn("c").imag - moved.imag - 12) < 1
    edited.undo()
    assert abs(edited.drawn("c") - moved) < 0.5
    edited.undo()
    assert abs(edited.drawn("c") - before) < 0.5
    edited.renew("casement")
    edited.mode("hand")
    before = edited.drawn("c")
    edited.drag(edited.pick("#canvas [data-joint=c]"), 14, -9)
    moved = edited.drawn("c")
    edited.click("new-path")
    assert edited.count("#solutions li") == 0 and edited.text("example-note") == ""
    edited.undo()
    assert "Casement" in edited.text("example-note") and edited.card().startswith("By hand")
    assert abs(edited.drawn("c") - moved) < 0.5
    assert not edited.run("return document.querySelector('#results [data-earlier]').checkVisibility()")
    edited.undo()
    assert abs(edited.drawn("c") - before) < 0.5


# -- cards belong to their request ------------------------------------------------------------------------------------------


def test_cards_and_notes_belong_to_their_request(opened) -> None:
    assert opened.outdated() is False
    opened.click("any-order")
    assert opened.outdated() is True, "the motion is another one"
    assert opened.faults() == []
    opened.undo()
    assert opened.outdated() is False
    opened.run("window.real = window.fetch; window.fetch = () => Promise.reject(new TypeError('gone'))")
    opened.click("solve")
    opened.wait("document.getElementById('status').classList.contains('bad')")
    assert opened.outdated() is True and "cannot be reached" in opened.text("status")
    opened.run("window.fetch = window.real")
    request = path_request([0, 60, 120], limits={"link_min": 99})
    opened.load_request(request)
    assert opened.count("#solutions li") == 0 and opened.outdated() is None
    opened.stub(request, [0, 60, 120])
    opened.solve()
    assert opened.outdated() is False and opened.count("#solutions li") == 4
    opened.stub(request, [0, 60, 120], [])
    opened.run(
        "window.stub.status = 'infeasible';"
        "window.stub.report.notes = ['No linkage was found with links of at least 99; with links of at least 42.5"
        " there is one (`limits.link_min`).']"
    )
    opened.click("solve")
    opened.wait(IDLE)
    assert opened.count("#solutions li") == 0 and not opened.shown("results")
    assert opened.shown("suggestions")
    opened.click("any-order")
    assert not opened.shown("suggestions"), "they are of the motion before"
    opened.click("new-motion")
    assert opened.text("status") == "" and opened.count("#solutions li") == 0
    opened.renew("casement")
    opened.paste("0,0,0\n10,4,350\n10,4,350\n20,5,10")
    assert "Poses 2 and 3 are the same" in opened.text("example-note") and opened.shown("unwrap")
    opened.undo()
    assert "Casement" in opened.text("example-note") and not opened.shown("unwrap")
    opened.renew("casement")
    opened.click("any-order")
    assert not opened.text("example-note") and "Inputs changed" in opened.text("status")
    opened.undo()
    assert "Casement" in opened.text("example-note") and "off by" in opened.text("status")


def test_back_and_forward_and_late_answers_belong_to_their_motions(page) -> None:
    for angles in ([0, 60, 120], [0, 50, 140, 200]):
        page.load_request(path_request(angles))
        page.stub(path_request(angles), angles)
        page.solve()
    page.run("window.requests = []; window.stub = null")
    for step, count in ((page.browser.back, 3), (page.browser.forward, 4), (page.browser.back, 3)):
        step()
        page.wait(f"document.querySelectorAll('#poses tbody tr').length === {count} && {CARDS} === 4")
        assert page.outdated() is False and "off by" in page.text("status")
    assert page.run("return window.requests") == [], "answers of this page are shown as they were"
    page.load()
    request = path_request([0, 60, 120])
    page.load_request(request)
    page.stub(request, [0, 60, 120])
    page.run(
        "const own = window.fetch;"
        "window.fetch = async (...a) => { if (a[0] === '/v2/synthesize') await new Promise((go) => { window.go = go; });"
        " return own(...a) }"
    )
    page.click("solve")
    page.wait("window.go")
    page.click("any-order")
    page.run("window.go()")
    page.wait(f"{CARDS} === 4 && {IDLE}")
    assert page.outdated() is True and "Inputs changed" in page.text("status")
    page.undo()
    assert page.outdated() is False and "off by" in page.text("status")
    page.load()
    request = path_request([0, 60, 120])
    own = page.run_async(
        "const [body, done] = arguments; import('/static/link.js').then(async (l) => done(await l.toFragment(body)))",
        request,
    )
    page.stub(request, [0, 60, 120])
    page.run("location.hash = arguments[0]", own)
    page.wait(f"{CARDS} === 4 && {IDLE}")
    assert page.last_request()["position"] == request["position"] and len(page.table()) == 3
    page.back()
    page.wait("document.getElementById('example-note').textContent.includes('Casement')")
    page.paste("0, 0\n10, 20\n30, 25")
    page.run("window.requests = []; location.hash = arguments[0]", own)
    page.wait(f"{CARDS} === 4 && {IDLE} && window.requests.length")
    page.undo()
    assert page.positions().tolist() == [[0, 0], [10, 20], [30, 25]]


def test_the_view_fits_a_new_answer(shared) -> None:
    shared, request = shared, path_request([0, 120, 240])
    shared.load_request(request)
    shared.stub(request, [0, 120, 240], VERDICTS[:2])
    shared.run(
        "const one = window.stub.solutions[1]; for (const n in one.links) one.links[n] *= 2;"
        "one.mount.coupler_point_polar.radius *= 2"
    )
    shared.solve()
    dots = "const at = (one) => { const f = one.getBoundingClientRect(); return [f.x, f.y] };"
    dots += "return [...document.querySelectorAll('#canvas .dot')].map(at)"
    size = shared.run("const c = document.getElementById('canvas'); return [c.clientWidth, c.clientHeight]")
    assert shared.in_view() and max(np.ptp(shared.run(dots), axis=0) / size) > 0.33
    shared.renew()
    request = path_request([0, 60, 120])
    shared.load_request(request)
    shared.stub(request, [0, 60, 120], VERDICTS[:1])
    for _ in range(3):
        shared.click("zoom-in")
    replies(shared, 1, 3)
    shared.solve()
    assert shared.drawn("a").real > 400, "the answer of the second stage"
    assert shared.in_view()
    shared.click("zoom-in")
    before = shared.view()
    shared.solve()
    assert shared.view() == before, "zoomed on purpose since the last answer to this motion"
    shared.click("closed")
    shared.solve()
    assert shared.view() != before and shared.in_view(), "another motion"


def replies(page, *sizes: float) -> None:
    """Let the service answer stage by stage, each time with `FREE` scaled by a size."""
    page.run(
        "const [sizes] = arguments, reply = window.stub, stages = sizes.map((size, k) => { const one = structuredClone(reply);"
        "one.report.stopped_by = k < sizes.length - 1 ? 'budget' : 'converged';"
        "for (const s of one.solutions) { for (const n in s.links) s.links[n] *= size;"
        "s.mount.coupler_point_polar.radius *= size;"
        "for (const p of ['pivot_a', 'pivot_b']) s.mount[p] = s.mount[p].map((v) => v * size + 400 * (size - 1));"
        "s.errors.objective /= size; }"
        "return one; });"
        "Object.defineProperty(window, 'stub', {configurable: true, get: () => stages.length > 1 ? stages.shift() : stages[0]})",
        sizes,
    )
