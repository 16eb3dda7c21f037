"""The machines' pages in a real browser: each query is filled in, calculated, drawn, run and restored from a link."""

import base64
import json
import time
from collections.abc import Callable

import pytest
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from app.page import scene_details
from app.scenes import SCENES, queries_of
from tests.conftest import some_of
from tests.e2e.page import Page

FIRST_ANSWER_MS = 500
FRAMES = 30
"""Least frames a second of a drawing that runs."""
TRIALS = 5
ANSWERED = "document.getElementById('status').textContent.startsWith('Calculated')"


CUT = """
    return [...document.querySelectorAll('.stage .symbol')].filter((one) => {
      const name = one.getBoundingClientRect(), frame = one.ownerSVGElement.getBoundingClientRect();
      return one.checkVisibility({visibilityProperty: true}) && (name.left < frame.left || name.right > frame.right);
    }).map((one) => one.textContent)"""
"""Names that stick out of a drawing to the left or right."""


@pytest.fixture
def at(pages):
    """Opens a machine's page; afterwards the console must be free of errors."""

    def go(scene: str, width: int = 1280, fragment: str = "") -> Page:
        pages.load(f"/scenes/{scene}{fragment}", width)
        return pages

    yield go
    pages.assert_no_errors()


def answered(page: Page, act: Callable[[], None]) -> None:
    """Act and wait for the result."""
    page.run("document.getElementById('status').textContent = ''")
    act()
    page.wait(ANSWERED)


@pytest.mark.parametrize("width", [360, pytest.param(1440, marks=pytest.mark.wide)])
@pytest.mark.parametrize("scene", some_of(sorted(SCENES), 1))
def test_every_question_is_answered_and_no_part_sticks_out(at, scene, width) -> None:
    page = at(scene, width)
    page.wait(ANSWERED)
    for k in range(len(queries_of(scene))):
        if k:
            Select(page.find("query")).select_by_index(k)
            answered(page, lambda: page.click("run"))
        page.run("for (const fold of document.querySelectorAll('details')) fold.open = true")
        assert page.width <= width and page.run(CUT) == []
        text = page.run("return document.body.innerText")
        assert "[object" not in text and "undefined" not in text and "NaN" not in text
        # rows of a table are alike: axe-core looks at a few of them, and would take seconds for thousands of cells
        few = "rows.replaceChildren(...[...rows.rows].slice(0, 4))"
        page.run(f"for (const rows of document.querySelectorAll('tbody')) {few}")
        assert page.faults() == []
        page.click("theme")  # the next question in the other colours


def test_every_example_goes_through_the_form_unchanged(at) -> None:
    """The form reads back the example from its fields: no field is lost, and no field is typed as JSON."""
    page = at("lift")
    for query in (query for scene in SCENES for query in scene_details(scene)["queries"]):
        for name, example in query["examples"].items():
            page.run("document.body.innerHTML = '<section class=schema id=fields></section>'")
            read = page.run_async(
                """const [schema, example, done] = arguments;
                import("/static/form.js").then(({ buildForm }) =>
                  done(buildForm(document.getElementById("fields"), schema, example).read()))""",
                query["schema"],
                example,
            )
            full = query["schema"]["properties"]
            extra = {key: value for key, value in read.items() if key not in example}
            assert {key: read[key] for key in example} == json.loads(json.dumps(example)), name
            assert all(full[key].get("default") == value for key, value in extra.items()), extra
            entries = "[...document.querySelectorAll('input[type=text], textarea')]"
            typed = page.run(f"return {entries}.map((field) => field.value)")
            assert not any(part in entry for part in '[{"' for entry in typed)


@pytest.mark.timed
@pytest.mark.parametrize("scene", SCENES)
def test_the_first_answer_is_there_at_once(at, scene) -> None:
    took = []
    for _ in range(TRIALS):  # a busy machine has its moments
        took.append(at(scene).run("return performance.getEntriesByName('first answer')[0].duration"))
        if took[-1] < FIRST_ANSWER_MS:
            return
    raise AssertionError(f"first answers after {took} ms")


def test_a_link_restores_question_values_and_place(at) -> None:
    page = at("lift")
    field = page.element("#fields input")
    field.clear()
    field.send_keys("310")
    answered(page, lambda: page.click("run"))
    slide(page, 2.5)
    page.cdp("Browser.grantPermissions", {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]})
    page.run("navigator.clipboard.writeText = (text) => { window.kept = text; return Promise.resolve(); }")
    page.click("link")
    page.wait("window.kept")
    fragment = page.run("return new URL(window.kept).hash")
    page.run("navigator.clipboard.writeText = () => Promise.reject(new Error('denied'))")
    page.click("link")
    page.wait("document.getElementById('status').textContent === window.kept")
    page = at("lift", fragment=fragment)
    assert page.element("#fields input").get_attribute("value") == "310"
    assert float(page.element(".player input").get_attribute("value")) == 2.5
    page = at("lift", fragment="#j=damaged")
    assert page.element(".stage")
    page = at("chain", fragment=fragment)
    assert page.element(".stage") and page.text("status") == "The link belongs to another machine or version."


def test_choosing_only_shows_and_clicks_and_steps_back_ask_once(at) -> None:
    """Once a choice ran its question, a second click stopped it, and Back left the page."""
    page = at("knotter")
    page.wait(ANSWERED)
    first = page.run("return [document.getElementById('query').value, location.hash]")
    page.run(
        "window.requests = 0; const own = fetch; window.fetch = (...a) => { window.requests++; return own(...a); }"
    )
    page.select("query", "/v2/knotter/needle")
    assert page.run("return window.requests") == 0 and page.text("status") == "Press Calculate to see the result."
    assert "of an earlier request" in page.text("facts-title") and not page.shown("stop")
    page.run(
        "const own = fetch; window.fetch = (...a) => new Promise((go, stop) => { window.go = () => go(own(...a));"
        " a[1].signal.addEventListener('abort', () => stop(new DOMException('', 'AbortError'))); })"
    )
    button = page.find("run")
    page.actions(0).double_click(page.centre(button)).perform()
    page.wait("window.go")
    assert button.text == "Calculate" and page.shown("stop") and page.text("status") == "Calculating…"
    page.run("window.go()")
    page.wait(ANSWERED)
    assert page.run("return window.requests") == 1 and not page.shown("stop")
    page.click("run")
    page.wait("!document.getElementById('stop').hidden")
    page.click("stop")
    assert page.text("status") == "Stopped." and page.focus == "run"
    page.browser.back()
    page.wait(f"location.hash === {json.dumps(first[1])} && document.querySelector('.stage')")
    assert page.run("return document.getElementById('query').value") == first[0] and page.text("status").startswith(
        "Calculated"
    )
    assert "of an earlier request" not in page.text("facts-title")
    page.browser.forward()
    page.wait("document.getElementById('query').value === '/v2/knotter/needle' && !document.querySelector('.stage')")
    assert page.run("return window.requests") == 1, "answers of this page are shown as they were"


def test_what_is_wrong_is_said_at_its_field_and_earlier_answers_are_marked(at) -> None:
    page = at("lift")
    page.wait(ANSWERED)
    mark, length = "of an earlier request", page.element("#fields input")
    assert mark not in page.text("facts-title")
    length.send_keys(Keys.HOME, "x")
    assert mark in page.text("picture-title") and mark in page.text("facts-title")
    page.click("run")  # refused
    page.wait("document.getElementById('status').classList.contains('bad')")
    assert mark in page.text("facts-title")
    length.send_keys(Keys.HOME, Keys.DELETE)
    answered(page, lambda: page.click("run"))
    assert mark not in page.text("facts-title")
    fields, before = page.elements("#fields input"), length.get_attribute("value")
    fields[0].clear()
    fields[0].send_keys("abc")
    page.click("run")
    assert fields[0].get_attribute("aria-invalid") == "true"
    assert "is not a number" in page.text("fields")
    assert page.active == fields[0]
    fields[0].clear()
    fields[0].send_keys("-3")
    page.click("run")
    assert "must be > 0; it is -3" in page.text("status")
    fields[0].clear()
    fields[0].send_keys("1e20")
    page.click("run")
    assert "must be ≤ 1000000000000; it is 1e20" in page.text("status")
    fields[0].clear()
    fields[0].send_keys(before)
    refusal = {"errors": [{"pointer": "#/design/l3", "detail": "Field required"}]}
    refused = json.dumps(json.dumps(refusal))
    page.run(f"window.own = fetch; window.fetch = async () => new Response({refused}, {{status: 422}})")
    page.click("run")
    page.wait("document.getElementById('status').textContent === 'Design l3: Field required.'")
    assert page.active == page.elements("#fields input")[1] and page.count("#fields .invalid") == 1
    page.run("window.fetch = window.own")
    page.select("query", "/v2/lift/optimize")
    answered(page, lambda: page.click("run"))
    page.element("#fields input").send_keys("0")
    assert mark in page.text("tables-title")


MOVING = {"lift": ".stage .body", "chain": ".stage .link.thin", "knotter": ".stage .rope"}
"""Selector of a moving element in each drawing."""


@pytest.mark.timed
@pytest.mark.parametrize("scene", MOVING)
def test_a_drawing_runs_smoothly_and_stops(at, scene) -> None:
    page = at(scene)
    button, part = page.element(".player button"), page.element(MOVING[scene])
    before = part.get_attribute("d")
    page.press(button)
    frames = page.run_async(
        """const [name, done] = arguments, path = document.querySelector(name);
        let frames = 0;
        const watch = new MutationObserver((rows) => { frames += rows.length ? 1 : 0; });
        watch.observe(path, { attributes: true, attributeFilter: ["d"] });
        setTimeout(() => { watch.disconnect(); done(frames); }, 1000)""",
        MOVING[scene],
    )
    assert frames >= FRAMES and part.get_attribute("d") != before
    page.press(button)
    path_at_rest = part.get_attribute("d")
    time.sleep(0.2)
    assert part.get_attribute("d") == path_at_rest and button.get_attribute("aria-label") == "Play"


def field_of(page, label: str) -> str:
    """The id of the field with a label: its first word, or the whole."""
    script = (
        "return [...document.querySelectorAll('#fields label')].map((one) => [one.innerText.trim(), one.htmlFor])"
    )
    return next(field for text, field in page.run(script) if label in (text, text.split(" ")[0]))


def slide(page, value: float) -> None:
    page.run(
        "const s = document.querySelector('.player input'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))",
        value,
    )


def test_the_chain_is_drawn_for_any_number_of_links_and_samples(at) -> None:
    page = at("chain")
    chain, window = (f"#picture .stage:nth-of-type({k})" for k in (1, 2))
    assert page.count("#picture .stage") == 2
    assert page.count(f"{chain} circle.pin") == 15 and page.count(f"{chain} circle.wheel") == 2
    labels = [label.text for label in page.elements(f"{chain} .symbol")]
    assert {"slot", "P1", "P14", "R0", "R1", "R2", "O1", "O2"} <= set(labels)
    lowest = {}
    for theta in (29.6, 74.6):
        slide(page, theta)
        lowest[theta] = float(page.element(f"{window} circle.point").get_attribute("cy"))
        assert page.element(f"{chain} .link.thin").get_attribute("d").count("L") == 15
    assert lowest[74.6] > lowest[29.6] + 20  # the free pin hangs deepest in the middle of the window
    assert "All lengths are in the unit of the pitch." in page.text("caption")
    page.run("document.querySelector('#fields > details').open = true")
    field = page.find(field_of(page, "samples"))
    field.clear()
    field.send_keys("4000")
    answered(page, lambda: page.click("run"))
    assert page.count("#picture .stage") == 2 and page.count("#curves .chart") == 1
    # a roller adds the groove's walls
    page.select("example", "roller")
    page.click("run")
    page.wait("document.querySelectorAll('#picture .wall').length === 4")
    assert "52.09" in page.text("facts")
    asking = {"query": "/v2/chain/slot", "request": CHAIN | {"samples": 4000, "include": ["outline"]}}
    page = at("chain", fragment="#j=" + base64.urlsafe_b64encode(json.dumps(asking).encode()).decode().rstrip("="))
    page.wait(ANSWERED)
    assert page.count("#picture .stage") == 2 and page.count("#curves .chart") == 1


CHAIN = {"pitch": 131, "links": 16, "upper_radius": 181.78, "phase_start": 50}


SLIDER_STEPS = """
    const slider = document.querySelector('.player input'), met = new Set(), shown = [];
    for (let k = 0; k <= 40; k++) {
      slider.value = Number(slider.min) + (slider.max - slider.min) * k / 40;
      slider.dispatchEvent(new Event('input'));
      const names = [...document.querySelectorAll('#picture .symbol:not([visibility=hidden])')];
      const boxes = names.map((one) => one.getBoundingClientRect());
      boxes.forEach((a, i) => boxes.slice(0, i).forEach((b, j) => {
        const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
        const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
        if (wide > 4 && high > 4) met.add(names[j].textContent + names[i].textContent);
      }));
      shown.push(names.length);
    }
    return [shown[0], [...met]]"""
"""Script that returns the number of names at the start and the names that overlap during the motion."""


def test_names_do_not_lie_on_one_another(at) -> None:
    for scene, width in zip(SCENES, (1440, 360, 360)):
        shown, overlapping = at(scene, width).run(SLIDER_STEPS)
        assert overlapping == [] and (scene != "lift" or shown == 12), "all find room"


def test_the_lift_is_saved_and_drawn_at_the_requested_times(at) -> None:
    page = at("lift")
    saved = json.loads(page.saved("lift-motion.json", "#exports [data-format=json]"))
    assert len(saved["reply"]["time"]) == saved["request"]["samples"] == 51
    assert len(page.saved("lift-motion.csv", "#exports [data-format=csv]").splitlines()) == 52
    slide(page, 99)
    assert page.read(".player output").endswith("height 510 mm, 0 mm/s")
    curve = page.element("#picture .curve.turn").get_attribute("d")
    samples = next(field for field in page.elements("#fields input") if field.get_attribute("value") == "51")
    samples.clear()
    page.run("document.querySelector('#fields > details').open = true")
    times = page.element("#fields > details input")
    for entry in ("2", "3 1 2"):
        times.clear()
        times.send_keys(entry)
        answered(page, lambda: page.click("run"))
        assert page.element("#picture .curve.turn").get_attribute("d") == curve
        assert "cylinder length\n" + ("682.2" if entry == "2" else "782.2, 582.2, 682.2") in page.text("facts")
    Select(page.find("query")).select_by_index(1)
    answered(page, lambda: page.click("run"))
    assert "dead point at least, jerk at most" in page.text("facts")
    page = at("chain")
    page.run("document.querySelector('#fields > details').open = true")
    page.select(field_of(page, "angle unit"), '"rad"')
    answered(page, lambda: page.click("run"))
    assert page.read(".player output") == "θ1 0.5158rad"


def test_the_knotter_shows_entries_verdicts_and_ranges(at) -> None:
    page = at("knotter")
    verdict = page.read(".verdicts-list")
    assert "wraps at 90.14° through S3S4" in verdict and "bites the rope at 311.96° through S8S9" in verdict
    drawing = page.element("#picture .stage")
    assert len(drawing.find_elements("css selector", "circle.enter:not(.wrong)")) == 2

    def drawn(part: str) -> str:
        return page.element(f"#picture .stage {part}").get_attribute("d")

    # at the wrap's entry the mark lies on the rope: the drawing opens there
    rope = drawn(".rope")
    ends = [tuple(map(float, part.split())) for part in rope.lstrip("M").split("L")]
    mark = page.element("#picture .stage circle.enter")
    x, y = (float(mark.get_attribute(name)) for name in ("cx", "cy"))
    (x0, y0), (x1, y1) = ends
    off = abs((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5
    assert off < 0.5
    before = drawn(".body")
    page.drag(drawing, 90, 20)
    assert drawn(".body") != before
    view = Select(page.element(".view-choice select"))
    assert view.first_selected_option.text == "as turned"
    shapes = set()
    for k in range(4):
        view.select_by_index(k)
        shapes.add(drawn(".body"))
    assert len(shapes) == 4 and before in shapes
    page.select("example", "fails_to_wrap")
    page.click("run")
    page.wait("document.querySelector('.verdicts-list li.no')")
    assert "through S5S3" in page.read(".verdicts-list")
    assert page.elements("circle.enter.wrong")
    page.select("query", "/v2/knotter/scan")
    answered(page, lambda: page.click("run"))
    page.run("for (const fold of document.querySelectorAll('#fields details')) fold.open = true")
    for field, values in zip(page.elements("#fields .wide input"), (range(30), range(20, 61))):
        field.send_keys(", ".join(map(str, values)))
    answered(page, lambda: page.click("run"))
    assert "\n0 20 no -" in page.text("tables").replace("\t", " ")
    assert "The first 1000 of 1230 rows" in page.text("tables")


ENTRIES = [
    ("1,5 2 -3,25", [1.5, 2, -3.25]),
    ("1,5; 2; −3,25", [1.5, 2, -3.25]),
    ("1, 2.5, 3", [1, 2.5, 3]),
    ("1\t2.5\t3", [1, 2.5, 3]),
    ("1,2,3,", [1, 2, 3]),
    ("1,5; 2.5", "Some numbers have a decimal comma and others a decimal point"),
    ("1, two", "“two” is not a number"),
    ("1e308", "it is 1e308"),
]


def test_lists_and_tables_are_read_as_rows_are_elsewhere(at) -> None:
    """A comma marks decimals where blanks or semicolons separate."""
    page = at("lift")
    bounded = {"type": "number", "minimum": -1e9, "maximum": 1e9}
    for entry, expected in ENTRIES:
        for items in (bounded, {"type": "array", "items": bounded}):
            found = page.run_async(
                """const [items, entry, done] = arguments;
                import("/static/form.js").then(({ buildForm }) => {
                  const host = document.getElementById("fields");
                  const form = buildForm(host, { properties: { a: { type: "array", items } }, required: ["a"] }, {});
                  host.querySelector("input, textarea").value = entry;
                  try { done(form.read().a.flat()); } catch (error) { done(error.message); }
                })""",
                items,
                entry,
            )
            assert found == expected or (isinstance(expected, str) and expected in found), (entry, found)
