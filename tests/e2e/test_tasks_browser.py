"""The page as a new user meets it: each task from empty page to DXF, the tutorial, and the faults that were seen once."""

import base64
import io
import json
import re

import ezdxf
import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

import linkage_atlas as la
from linkage_atlas.result_notes import ILL_POSED
from synthesis.excursions import excursion_faults
from tests.e2e.page import CARDS, EXAMPLES, GOOD, IDLE, ROOT, VERDICTS, path_request


def good_dxf(content: bytes) -> set[str]:
    """The layers of a drawing without errors."""
    drawing = ezdxf.read(io.StringIO(content.decode()))
    assert not drawing.audit().errors
    return {layer.dxf.name for layer in drawing.layers}


# -- the first ten seconds ---------------------------------------------------------------------------------------------


def test_the_first_screen_has_four_entries_and_a_machine_moves(moving, page) -> None:
    page.go()
    assert page.text("lead") == "Draw the motion you need. Get linkages that make it."
    assert len(page.elements(".entries > *")) == 4 and not page.shown("last-project")
    assert page.faults() == []
    page.press("[data-begin=open-gallery]")
    page.press("[data-example=casement]")
    assert not page.shown("welcome")
    assert page.find("play").get_attribute("aria-label") == "Pause"
    before = page.run("return document.querySelector('#canvas .crank').getAttribute('d')")
    page.wait(f"document.querySelector('#canvas .crank').getAttribute('d') !== {json.dumps(before)}")
    assert GOOD.fullmatch(page.read("#solutions .verdict"))
    assert re.search(r"off by 0\.\d+ mm \(pose \d\) and 0\.\d+° \(pose \d\)", page.text("status"))
    assert page.shown("new-path")


def test_nothing_is_cut_off_at_any_size(opened) -> None:
    cut = (
        "const frame = document.getElementById('canvas').getBoundingClientRect();"
        "return [...document.querySelectorAll('#canvas .dot')].map((one) => one.getBoundingClientRect()).filter((one) =>"
        "one.top < frame.top || one.bottom > frame.bottom || one.left < frame.left || one.right > frame.right).length"
    )
    for size in ((1440, 900), (1280, 800), (360, 740), (1280, 800), (900, 700)):
        opened.resize(*size)
        assert opened.count("#canvas .dot") == 8 and opened.run(cut) == 0, size
    opened.resize(360, 740)
    opened.run("for (const one of document.querySelectorAll('#solutions dd')) one.textContent = '0.0001234 mm (12)'")
    assert opened.width <= 360, "long numbers stay within a phone"
    opened.resize(390, 844)
    opened.choose("casement")
    longest = "return Math.max(...[...document.querySelectorAll('#canvas .miss')].map((one) => one.getTotalLength()))"
    assert 10 < opened.run(longest) < 35, "errors are seen, and hide neither poses nor linkage"


def test_the_gallery_and_explained_terms(shared) -> None:
    shared.click("open-gallery")
    machines = shared.elements("#machines button")
    assert len(machines) == 8 and all("off by at most" in one.text for one in machines)
    assert shared.faults("#gallery") == []
    shared.press(machines[4])
    assert "Film advance" in shared.text("example-note") and not shared.shown("gallery")
    assert "off by" in shared.text("status") and "Searched beforehand" in shared.text("status")
    shared.renew()
    shared.unfold("limits")
    for button in shared.elements("#limits .explain"):
        shared.press(button)
        assert button.get_attribute("aria-expanded") == "true"
    assert all(element.is_displayed() for element in shared.elements("#limits .explanation"))
    assert shared.faults("#limits") == []


# -- tasks, from the empty page to DXF -----------------------------------------------------------------------------------


def ask_motion(page, device: str) -> None:
    page.press("#new-motion", device)
    page.wait("!document.querySelectorAll('#poses tbody tr').length")
    points = (-140, 40), (-20, -30), (110, -10)
    if device == "mouse":
        page.click_canvas(*points)
        page.mode("move")
        page.drag(page.pick("[data-pose='2'] circle.turner"), -20, -30)
    elif device == "phone":
        x, y = page.middle_of(page.find("canvas"))
        for dx, dy in points:
            page.touch([(x + dx, y + dy)])
    else:
        page.press("#add-row", device)
        page.pick("[data-pose='0']").send_keys(Keys.ENTER)
        keys = Keys.SHIFT + Keys.ARROW_RIGHT + Keys.ARROW_UP + Keys.NULL + "[[["
        page.active.send_keys(keys)
        page.active.send_keys(Keys.ENTER)
    assert len(page.table()) == 3


def ask_path(page, device: str) -> None:
    page.press("#new-path", device)
    if device == "keyboard":
        page.press("#add-row", device)
        page.pick("[data-pose='0']").send_keys(Keys.ENTER)
        for keys in (Keys.ARROW_RIGHT, Keys.ARROW_UP, Keys.ARROW_LEFT + Keys.ARROW_UP):
            page.active.send_keys(Keys.SHIFT + keys + Keys.NULL)
            page.active.send_keys(Keys.ENTER)
        assert len(page.table()) == 5
        return
    x, y = page.middle_of(page.find("canvas"))
    turn = np.linspace(0, 2 * np.pi, 24)
    ring = [(x + 90 * np.cos(t), y + 50 * np.sin(t)) for t in turn]
    if device == "phone":
        page.touch(ring)
    else:
        for k, (u, v) in enumerate((*ring, ring[-1])):
            kind = "mousePressed" if k == 0 else "mouseMoved" if k < len(ring) else "mouseReleased"
            button = {"button": "left", "buttons": int(k < len(ring)), "clickCount": 1}
            page.cdp("Input.dispatchMouseEvent", {"type": kind, "x": u, "y": v, **button})
    assert len(page.table()) == 24 and page.ticked("closed")


def ask_function(page, device: str) -> None:
    page.press("#new-function", device)


ASK = {"motion": ask_motion, "path": ask_path, "function": ask_function}
DEVICES = ("mouse", "keyboard", "phone")


def tasks_and_devices() -> list:
    """Return each task with each device; the default run has each task once and each device once."""
    return [
        pytest.param(task, device, marks=[pytest.mark.wide] * (k != index))
        for k, task in enumerate(("motion", "function", "path"))
        for index, device in enumerate(DEVICES)
    ]


@pytest.mark.parametrize(("task", "device"), tasks_and_devices())
def test_each_task_from_the_empty_page_to_dxf(page, task, device) -> None:
    """By mouse, keyboard and touch; on a phone the linkage is in view after Solve."""
    page.resize(*((360, 740) if device == "phone" else (1280, 800)))
    ASK[task](page, device)
    page.press("#solve", device)
    page.wait_for_results()
    if device == "phone":
        edges = "const f = document.getElementById('canvas').getBoundingClientRect(); return [f.top, f.bottom]"
        top, bottom = page.run(edges)
        assert -50 < top < 400 and bottom < 740, "the linkage is in view after Solve"
        assert page.width <= 360
    assert good_dxf(page.saved("linkage-1.dxf", "#exports [data-format=dxf]", device)) >= {"GROUND", "LINKS", "BODY"}


def test_the_tutorial(opened) -> None:
    """The clicks of docs/start/page_in_five_minutes.md, with the rows that it shows."""
    tutorial = (ROOT / "docs/start/page_in_five_minutes.md").read_text()
    rows = re.search(r"((?:    [^\n]+\n){9})", tutorial).group(1)
    opened.paste("\n".join(row.strip() for row in rows.splitlines()))
    assert len(opened.table()) == 8 and opened.value("timing") == "free"
    assert opened.value("box-0") == "", "the limits of the machine shown before do not hold"
    opened.unfold("limits")
    opened.unhurried()
    entries = {"link-min": "60", "link-max": "500", "box-0": "-100", "box-1": "-250", "box-2": "400", "box-3": "150"}
    for name, entry in entries.items():
        opened.type_into(name, entry)
    opened.record_requests()
    opened.click("solve")
    opened.wait(f"{CARDS} && {IDLE}")
    limits = {"preset": "practical", "pivot_box": [-100, -250, 400, 150], "link_min": 60, "link_max": 500}
    assert opened.last_request()["limits"] == limits
    assert GOOD.fullmatch(opened.read("#solutions .verdict"))
    assert good_dxf(opened.saved("linkage-1.dxf", "#exports [data-format=dxf]")) >= {"GROUND", "LINKS", "BODY"}
    sheet = opened.cdp("Page.printToPDF", {"preferCSSPageSize": True})["data"]
    assert re.findall(rb"/Count (\d+)", base64.b64decode(sheet)) == [b"1"]
    printed = opened.content("sheet")
    assert "worst place" in printed and "pivot box-100, -250, 400, 150" in printed


# -- typed entries -------------------------------------------------------------------------------------------------------


def test_nothing_that_is_typed_is_changed_silently(opened) -> None:
    opened.type_into("transmission", "95" + Keys.TAB)
    assert opened.value("transmission") == "95"
    assert opened.text("transmission-error").endswith(": 95 is not from 0 to 89.9.")
    opened.click("solve")
    assert "95 is not from 0" in opened.text("status"), "Solve says so and does not search"
    opened.type_into("transmission", "40" + Keys.TAB)
    assert opened.text("transmission-error") == ""
    opened.select("timing", "even")
    opened.type_into("span", "0" + Keys.TAB)
    assert opened.value("span") == "0" and "still in use" in opened.text("span-error")
    opened.cell("Pose 3, x", "abc", Keys.TAB)
    assert opened.pick("#poses [aria-label='Pose 3, x']").get_attribute("value") == "abc"
    assert "“abc” is not a number" in opened.text("table-error")
    opened.click("solve")
    assert opened.focus == "pose-2-x"
    for entry, said in (
        ("1.234,5", "“1.234,5” is not a number"),
        ("1,000", "“1,000” may be 1000 or 1.000"),
        ("1e60", "1e+60 is more than 1e+50"),
    ):
        opened.cell("Pose 3, x", entry, Keys.TAB)
        assert opened.text("table-error") == f"Pose 3, x: {said}; 287 is still in use."
    opened.cell("Pose 3, x", "−5,5", Keys.TAB)
    assert opened.request()["position"][2][0] == -5.5
    opened.cell("Pose 3, x", "1e49", Keys.TAB)
    assert opened.text("table-error") == "", "it is drawn far outside"
    opened.cell("Pose 3, x", "1,5", Keys.TAB)
    assert opened.request()["position"][2][0] == 1.5 and opened.text("table-error") == ""
    opened.type_into("stock", "100, 150,5; 200" + Keys.TAB)
    assert opened.value("stock") == "100 150.5 200"
    opened.type_into("stock", "20,30,40" + Keys.TAB)
    assert opened.value("stock") == "20 30 40", "as in other lists commas alone separate"


def test_limits_are_checked_as_typed_and_follow_the_timing(shared) -> None:
    shared.load_request({**path_request([0, 60, 120]), "limits": {"link_min": 9, "link_max": 5}})
    shared.record_requests()
    shared.click("solve")
    assert shared.text("status") == "Links at least, 9, may not be more than links at most, 5."
    assert shared.focus == "link-min" and shared.run("return window.requests.length") == 0
    shared.renew()
    shared.click("new-motion")
    shared.type_into("box-1", f"5{Keys.TAB}")
    shared.click("box-clear")
    assert shared.text("box-error") == "" and shared.value("box-1") == "", "half a pivot box can be removed"
    for k, entry in enumerate(["-10", "-20,5", "30", "40"]):
        shared.type_into(f"box-{k}", entry + Keys.TAB)
        assert shared.value(f"box-{k}") == entry
        assert (shared.text("box-error") == "") is (k == 3)
    assert shared.request()["limits"]["pivot_box"] == [-10, -20.5, 30, 40]
    shared.renew()
    shared.click("new-motion")
    shared.unfold("limits")
    assert shared.ticked("practical") and "off" not in shared.text("timing-note")
    shared.select("timing", "even")
    assert not shared.ticked("practical") and shared.limits() == {}
    assert "The practical limits are off" in shared.text("timing-note")
    shared.click("practical")
    assert shared.limits() == {"preset": "practical"} and "off" not in shared.text("timing-note")
    shared.select("timing", "free")
    shared.click("keep-use")
    shared.select("timing", "even")
    assert shared.ticked("keep-turn"), "what was chosen stays"
    shared.renew()
    shared.click("new-motion")
    shared.unfold("limits")
    assert shared.limits() == {"preset": "practical"}
    shared.click("keep-turn")
    assert shared.limits() == {"preset": "practical", "transmission_angle_min_turn": 0}
    shared.click("keep-reach")
    assert shared.limits() == {"preset": "none", "transmission_angle_min": 35, "link_ratio_max": 10}
    shared.select("timing", "even")
    assert shared.limits() == {"transmission_angle_min": 35, "link_ratio_max": 10}
    shared.select("timing", "free")
    shared.load_request({"position": [[0, 0], [3, 4]], "timing": "free", "limits": shared.limits()})
    assert not shared.ticked("keep-turn") and shared.ticked("keep-ratio")
    shared.click("practical")
    assert shared.limits() == {"preset": "practical", "transmission_angle_min": 35, "link_ratio_max": 10}


def test_keep_out_boxes_and_a_ground_line_are_typed_drawn_and_observed(opened) -> None:
    opened.unhurried()
    opened.type_into("keep-out", "200 50 380")
    assert "line 1 needs four numbers" in opened.text("keep-out-error")
    opened.type_into("keep-out", "200 50 380 140,5; -100, 0; 0" + Keys.BACKSPACE * 12 + Keys.TAB)
    opened.type_into("envelope-1", "-310" + Keys.TAB)
    limits = opened.limits()
    assert limits["keep_out"] == [[200, 50, 380, 140.5]]
    assert limits["envelope"][1] == -310 and limits["envelope"][3] == 1e9
    assert opened.count("#canvas .keep-out") == 1 and opened.count("#canvas .envelope") == 1
    opened.solve()
    assert opened.count("#solutions li") and min(place.imag for place in opened.all_drawn().values()) > -311
    opened.type_into("envelope-1", Keys.BACKSPACE + Keys.TAB)
    opened.type_into("keep-out", Keys.BACKSPACE + Keys.TAB)
    assert not opened.limits().keys() & {"keep_out", "envelope"}


def test_the_preferred_linkage_is_requested_kept_and_first(opened) -> None:
    opened.unfold("limits")

    def prefers() -> tuple[str, str | None]:
        return opened.value("prefer"), opened.request().get("prefer")

    assert prefers() == ("balanced", None)
    opened.type_into("tolerance-position", "2" + Keys.TAB)
    assert prefers() == ("balanced", None), "the service's own default"
    for name in ("error", "transmission", "crank_span", "size", "crank_span"):
        opened.select("prefer", name)
        assert prefers() == (name, name)
    opened.reload()
    opened.unfold("limits")
    assert prefers() == ("crank_span", "crank_span"), "kept in the draft"
    opened.select("timing", "even")
    assert prefers() == ("size", None), "all linkages turn alike far"
    assert not opened.pick("#prefer [value=crank_span]").is_enabled()
    opened.select("timing", "free")
    opened.select("prefer", "size")
    opened.select("wanted", "position")
    assert prefers() == ("size", "size")
    opened.select("timing", "even")
    opened.select("wanted", "rotation")
    assert prefers() == ("error", None) and not opened.pick("#prefer [value=size]").is_enabled()
    opened.renew("casement")
    # As the service ranks them, through both of its answers; the least error is a card further down or gone.
    stored = next(example["reply"]["solutions"][0] for example in EXAMPLES if example["name"] == "casement")
    opened.pause()
    opened.type_into("tolerance-position", "2" + Keys.TAB)
    opened.type_into("tolerance-rotation", "1" + Keys.TAB)
    opened.unfold("limits")
    opened.select("prefer", "size")
    opened.record_requests()
    opened.budgets(200, 30_000)
    opened.click("solve")
    opened.wait(f"window.requests.length && {IDLE}")
    assert opened.last_request()["prefer"] == "size" and opened.last_request()["tolerances"] == {
        "rotation": 1,
        "position": 2,
    }
    assert len(opened.run("return window.requests")) == 2, "one for a first answer, one for the final one"
    sizes = opened.run(
        "return [...document.querySelectorAll('#solutions dt')].filter((one) => one.textContent === 'size')"
        ".map((one) => Number.parseFloat(one.nextSibling.textContent))"
    )
    assert len(sizes) > 1 and min(sizes) == sizes[0] < 0.8 * stored["size"]
    assert opened.text("status").startswith("Within the allowed errors at every pose, the smallest found: off by")


# -- faults that were seen -----------------------------------------------------------------------------------------------


def test_stages_keep_the_order_of_the_service(shared) -> None:
    # only linkages better than all found later stay, not earlier versions of the same linkages
    shown = shared.run_async(
        "const [done] = arguments; Promise.all([import('/static/service.js'), import('/static/fit.js')]).then(async ([s, f]) => {"
        "const one = (size, objective) => ({links: {crank: 1, coupler: size, rocker: 3, ground: 3}, branch: 1, mount: null,"
        "verdict: {order: true, branch: true, circuit: true, within_tolerance: null}, errors: {objective}});"
        "const first = [one(2, 0.05), one(4, 0.2), one(5, 0.5)], own = window.fetch, seen = [];"
        "for (const [request, ...stages] of [[{}, first, []], [{}, first, [one(4, 0.1), one(6, 0.4)]],"
        "[{prefer: 'size'}, first, [one(6, 0.4), one(4, 0.1)]], [{}, [], [], first]]) {"
        "window.fetch = async () => new Response(JSON.stringify({status: 'closest', solutions: stages.shift(),"
        "report: {stopped_by: 'budget', elapsed_ms: {total: 9}}}));"
        "await s.solve(request, (reply) => seen.push(reply.solutions.map(x => x.links.coupler)), null, f.alike); }"
        "window.fetch = own; done(seen); })"
    )
    assert shown[:2] == [[2, 4, 5], [2, 4, 5]], "a further one without any"
    assert shown[2:4] == [[2, 4, 5], [2, 4, 6]], "a better one of before stays, in its place"
    assert shown[4:6] == [[2, 4, 5], [6, 4]], "what else is preferred is the service's to say"
    assert shown[6:] == [[], [], [2, 4, 5]], "where there is none, a last one is given more time"
    shown = shared.run(
        "return import('/static/service.js').then((s) => {"
        "const one = (size, objective, practical = true) => ({links: {coupler: size}, errors: {objective},"
        "verdict: {order: true, branch: true, circuit: true, practical}});"
        "const reply = [one(1, 0.024), one(2, 0.025), one(3, 0.022, false)];"
        "const same = (a, b) => a.links.coupler === b.links.coupler, free = {timing: 'free', prefer: 'error'};"
        "const join = (earlier, solutions) => s.together(free, earlier, {solutions}, 9, same).map(x => x.links.coupler);"
        "const before = [one(4, 0.0245), one(5, 0.013, false), one(6, 0.5)], far = [one(8, 0.001, false)];"
        "return [join([], reply), join(before, reply), join([one(7, 0.5)], far)]; })"
    )
    assert shown == [[1, 2, 3], [5, 1, 4, 2, 3, 6], [8, 7]]
    shown = shared.run(
        "return import('/static/service.js').then((s) => {"
        "const one = (size, objective, rounded) => ({links: {crank: size}, errors: {objective}, verdict: {},"
        "rounded: {errors: rounded === undefined ? null : {objective: rounded}}});"
        "const before = [one(1, 0.03), one(2, 0.04, 0.055)], reply = [one(3, 0.05, 0.05), one(4, 0.035, 0.06)];"
        "const join = (more) => s.together(more, before, {solutions: reply}, 9, () => false).map(x => x.links.crank);"
        "return [join({round_to: 5}), join({lengths_from: [20, 30]}), join({})]; })"
    )
    assert shown == [[3, 2, 4, 1], [3, 2, 4, 1], [1, 2, 3, 4]]


def test_solve_is_near_and_the_status_in_view(page) -> None:
    page.pause()
    page.run("document.activeElement.blur(); scrollTo(0, 0)")
    page.run("window.passed = []; addEventListener('focusin', ({target}) => passed.push(target.id))")
    page.actions().send_keys(Keys.TAB * 49).perform()
    assert "solve" in page.run("return passed")
    page.solve_soon()
    page.press("#solve", "keyboard")
    page.wait_for_results()
    assert page.focus == "solve"
    page.renew("casement")
    page.resize(1280, 800)
    page.run("document.getElementById('limits').open = true; scrollTo(0, 0)")
    box = page.run("const f=document.getElementById('status').getBoundingClientRect();return [f.top, f.bottom]")
    assert 0 < box[0] < box[1] <= 800
    for response, message in (
        ("reject(new TypeError('gone'))", "cannot be reached"),
        ("""resolve(new Response('{"detail": "the service is ending"}', {status: 503}))""", "The service is ending."),
    ):
        page.run(f"window.fetch = () => Promise.{response}")
        page.click("solve")
        page.wait(f"document.querySelector('#status.bad')?.textContent.includes({json.dumps(message)}) && {IDLE}")
    box = page.find("status").rect
    assert page.run("return scrollY") + 800 >= box["y"] + box["height"]


def test_verdicts_and_texts_use_the_words_of_the_page(shared) -> None:
    note = shared.run_async(
        "const [note, done] = arguments; import('/static/verdict.js').then(v => done(v.plainNote(note)))",
        ILL_POSED.format("2 %", "motion"),
    )
    assert note == "The problem is ill-posed: lengths that differ by 2 % make this motion about equally well."
    (reason,) = excursion_faults(2.94)
    said = shared.run_async(
        "const [reasons, done] = arguments; import('/static/verdict.js').then(v => done("
        "[v.mark({order: true, branch: true, circuit: true, practical: false, reasons}, 'pose').text,"
        "...v.reasons({reasons}, 'pose')]))",
        [reason],
    )
    posed = reason.replace("samples", "poses")
    assert said == ["long detour between two poses (2.94 times their distance)", f"{posed[0].upper()}{posed[1:]}."]
    assert "determination" not in shared.run("return document.body.innerText")
    marked = shared.run_async(
        "import('/static/verdict.js').then(v => arguments[0]([1, 2].map((count) => v.mark({order: true, branch: true,"
        "circuit: true, practical: true, within_tolerance: null, assembly: {count}}).text)))"
    )
    assert marked == ["buildable in 1 layer", "buildable in 2 layers"]
    shared.renew()
    request = path_request([0, 60, 120])
    shared.solve_with_reply(request, [0, 60, 120])
    cards = shared.cards()  # of a stub, whose layers never come
    assert "broken" in cards[2].get_attribute("class") and "transmission angle 21.9° over" in cards[2].text, (
        "after usable ones"
    )
    assert "broken" not in cards[0].get_attribute("class")
    assert "Position error, largest" in shared.text("numbers") and "mm at point" in shared.text("numbers")
    assert shared.count("#canvas .worst") == 1
    shared.renew()
    shared.solve_with_reply(path_request([0, 60, 120]), [0, 55, 120])
    said = [*map(shared.text, ("status", "results-note", "numbers")), shared.content("canvas")]
    assert all("point" in message and "pose" not in message for message in said), said
    shared.paste("x,y\n0,0\n10,4\n10,4\n20,5")
    assert "Points 2 and 3 are the same" in shared.text("example-note")
    shared.cell("Pose 2, x", "ten", Keys.TAB)
    assert shared.text("table-error").startswith("Point 2, x: “ten”")
    shared.renew()
    shared.solve_with_reply(path_request([0, 60, 120], tolerances={"position": 0.1}), [0, 60, 120], VERDICTS[2:3])
    assert shared.text("status").endswith("The errors exceed the tolerances at some points.")
    shared.renew()
    # The landing gear asks for 30 degrees of transmission, less than the practical limit, and gets them: stored and searched.
    shared.choose("gear")
    assert shared.value("transmission") == "30"
    for _ in range(2):
        marks = shared.texts("#solutions .verdict")
        assert GOOD.fullmatch(marks[0]) and not any("used interval" in mark for mark in marks)
        shared.solve()
    assert "30°" in shared.read("#solutions li")
    shared.renew()
    values = {"rotation": [0, -123.456, 360.25], "position": [[-1234.56, 1234.56], [-12345.6, 0.12345], [1e6, 2]]}
    shared.load_request({**values, "crank_angle": [0, 33.3333, 66.6667]})
    clipped = shared.run(
        "const cells = [...document.querySelectorAll('#poses input')];"
        "return cells.filter(e => e.scrollWidth > e.clientWidth).map(e => e.value)"
    )
    assert clipped == []


EXCLUDED = [
    "No linkage was found with links of at least 99; with links of at least 42.5 there is one (`limits.link_min`)."
]
ENDS = [("unknown", [], "this does not prove that there is none"), ("infeasible", EXCLUDED, "ran to its end")]


def test_no_linkage_is_said_without_a_claim_that_was_not_proved(shared) -> None:
    for status, notes, said in ENDS:
        request = {**path_request([0, 60, 120]), "limits": {"link_min": 99}}
        shared.load_request(request)
        shared.stub(request, [0, 60, 120], [])
        shared.run("window.stub.status = arguments[0]; window.stub.report.notes = arguments[1]", status, notes)
        shared.click("solve")
        shared.wait(IDLE)
        assert said in shared.text("status")
        if notes:
            assert shared.text("status").endswith("; with links of at least 42.5 there is one.")
            button = shared.pick("#suggestions button")
            assert button.text == "Set the smallest link length to 42.5"
            shared.press(button)
            shared.wait(IDLE)
            assert shared.last_request()["limits"]["link_min"] == 42.5


def test_a_linkage_is_changed_by_hand(opened) -> None:
    """The page and the library compute the same errors of the edited linkage."""
    opened.pause()
    opened.unhurried()
    opened.mode("hand")
    before = opened.drawn("c")
    opened.drag(opened.pick("#canvas [data-joint=c]"), 14, -9)
    scale = opened.view()[2]
    assert abs(opened.drawn("c") - (before + complex(14, 9) / scale)) < 3 / scale
    assert opened.card().startswith("By hand") and "not checked" in opened.card()
    opened.run("window.copied = ''; navigator.clipboard.writeText = async (t) => { window.copied = t; }")
    opened.click("copy")
    opened.wait("window.copied")
    rows = dict(row.split("\t", 1) for row in opened.run("return window.copied").split("\n"))
    number = {name: [float(v) for v in re.findall(r"-?[\d.]+(?:e-?\d+)?", value)] for name, value in rows.items()}
    lengths = (number[name][0] for name in ("Crank", "Coupler", "Rocker", "Ground"))
    names = "Start angle", "Ground angle", "Body offset"
    mount = {name.lower().replace(" ", "_"): number[name][0] for name in names}
    mount |= {"pivot_a": number["Pivot A"][:2], "coupler_point_polar": number["Coupler point"]}
    linkage = la.FourBar(*lengths, branch=1 if rows["Branch"] == "+1" else -1, **mount)
    wanted = np.array(EXAMPLES[0]["request"]["position"])
    made = linkage.joints(number["Crank angles"]).body_point
    off = np.hypot(*(made - wanted).T).max()
    assert f"{off:.3g}" == f"{number['Position error, largest'][0]:.3g}", "to all digits shown"


def test_a_link_brings_the_chosen_card_back_and_a_path_has_no_direction(page) -> None:
    page.choose("worked")
    Select(page.find("length-unit")).select_by_visible_text("cm")
    page.solve()
    page.choose_card(1)
    longest = page.read("#numbers tr")
    page.follow_link()
    page.wait(f"{CARDS} && {IDLE}")
    assert page.read("#numbers tr") == longest and longest.endswith("cm")
    page.load_request(path_request(np.linspace(0, 120, 8)))
    page.solve_soon()
    assert not page.run("return document.querySelector('#canvas .carried').getAttribute('d')")
    page.choose("bucket")
    assert page.run("return document.querySelector('#canvas .carried').getAttribute('d')")


def test_cards_are_compared_and_a_drag_adds_no_pose(opened) -> None:
    pins = "#solutions li:nth-child({}) [type=checkbox]"
    opened.press(pins.format(1))
    assert opened.text("compare") == "Choose a second linkage to compare."
    opened.press(pins.format(2))
    opened.press(pins.format(3))
    assert opened.count("#solutions :checked") == 2, "the first gives device"
    rows = opened.run("return [...document.querySelectorAll('#compare tr')].map((row) => row.cells.length)")
    assert len(rows) > 15 and set(rows) == {3}
    assert opened.count("[data-layer=overlay] .small") == 2 and opened.faults("#choose") == []
    crank = "return document.querySelector('#solutions li:nth-child(2) .crank').getAttribute('d')"
    before = opened.run(crank)
    opened.slide(50)
    assert opened.run(crank) != before
    opened.press(pins.format(2))
    opened.press(pins.format(3))
    assert not opened.shown("compare")
    opened.renew("casement")
    scale = opened.view()
    for k in range(len(opened.cards())):
        opened.choose_card(k)
        assert opened.view() == scale
    opened.select("sort", "transmission")
    texts = opened.texts("#solutions button")
    angles = [float(re.search(r"transmission\s+([\d.]+)°", one).group(1)) for one in texts]
    assert angles == sorted(angles, reverse=True)
    opened.click("overlay")
    assert opened.count("[data-layer=overlay] .small") == 2
    opened.renew("casement")
    opened.mode("add")
    before = opened.table()
    opened.drag(opened.pick("[data-pose='3'] .hit"), 30, 20)
    after = opened.table()
    assert len(after) == len(before) and after[3] != before[3]
    middle = opened.view()
    opened.drag(opened.find("canvas"), 40, 0, (300, 160))
    assert len(opened.table()) == len(before) and opened.view() != middle, "a drag beside the poses moves the view"
    opened.click_canvas((300, 180))
    assert len(opened.table()) == len(before) + 1


CODES = "0 SECTION 2 ENTITIES 0 LWPOLYLINE 70 1 90 4 10 0 20 0 10 40 20 0 42 1 10 40 20 20 10 0 20 20 0 ENDSEC 0 EOF"
DXF = CODES.replace(" ", "\n")
"""A plate of 40 by 20 with a round end."""
SVG = '<svg xmlns="http://www.w3.org/2000/svg"><script>window.bad = 1</script><rect width="50" height="20"/></svg>'


def test_a_body_has_an_outline_and_a_picture_lies_behind_it(page, tmp_path) -> None:
    for name, content, wide in (("a.dxf", DXF, 50), ("b.svg", SVG, 50)):
        file = tmp_path / name
        file.write_text(content)
        page.click("show-menu")
        page.find("outline-file").send_keys(str(file))
        page.wait("document.querySelectorAll('[data-layer=ghosts] path').length === 8")
        at_rest = page.run("return document.querySelector('[data-layer=ghosts] path').getBBox().width")
        assert at_rest / page.view()[2] == pytest.approx(wide, rel=0.02)
        assert page.run("return window.bad") is None
        assert page.count("[data-layer=body] path") == 1
        page.load()
    page.click("show-menu")
    page.find("picture-file").send_keys(str(ROOT / "docs/img/page.png"))
    page.wait("!document.getElementById('backdrop').hidden")
    seen = page.run(
        "const c = document.getElementById('backdrop'), x = c.width / 2, y = c.height / 2;"
        "return c.getContext('2d').getImageData(x, y, 1, 1).data[3]"
    )
    assert seen == 255
    page.load()
    page.wait("document.querySelectorAll('#stack rect').length > 4")
    assert not page.run("return document.querySelector('#stack .body')")
    file = tmp_path / "sash.svg"
    shape = '<polygon points="-40,-30 40,-30 40,30 -40,30"/>'
    file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg">{shape}</svg>')
    page.find("outline-file").send_keys(str(file))
    page.wait("document.querySelector('#stack rect.body')")


# -- layers ------------------------------------------------------------------------------------------------------------


def test_layers_come_by_themselves_and_collisions_are_shown_where_they_are(page) -> None:
    """Check the stack and the plates of the first machine, and the position of a collision of wide plates."""
    page.wait("document.querySelectorAll('#stack rect').length > 4")
    assert page.text("layers-note").startswith("Nothing collides in 3 layers")
    assert "crank in layer" in page.find("stack").get_attribute("aria-label")
    marks = "[...document.querySelectorAll('#solutions .verdict')]"
    page.wait(f"{marks}.every((one) => one.innerText.includes('buildable'))")
    page.click("layer-plates")
    drawn = "[...document.querySelectorAll('[data-layer=plates] [data-plate]')]"
    plates = page.run(f"return {drawn}.map((one) => one.dataset.plate)")
    # from the lowest layer up
    stack = [word.split(" ")[0] for word in page.find("stack").get_attribute("aria-label").split(": ")[1].split(", ")]
    assert [name for name in plates if "_" not in name] == stack[::-1]
    page.run("document.getElementById('layer-width').value = 400")
    page.run("document.getElementById('layer-width').dispatchEvent(new Event('change'))")
    said = "Cannot be built: parts collide in every order"
    page.wait(f"document.getElementById('layers-note').textContent.startsWith('{said}')")
    assert "layers:" in page.read("#solutions .verdict")
    links = "[...document.querySelectorAll('#layers-reasons button')]"
    page.run(f"{links}.find((link) => link.innerText.includes('collide')).click()")
    page.wait("document.querySelector('[data-layer=plates] .hit')")
