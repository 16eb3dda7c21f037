"""The machines' pages in a real browser: each question asked by its form, answered, drawn, run, and restored from a link."""

from __future__ import annotations

import json
import os
import shutil
import time
from pathlib import Path

import pytest

from app.page import scene_details
from app.scenes import SCENES
from tests.e2e.test_page_browser import (  # noqa: F401
    ActionChains,
    By,
    Select,
    faults,
    find,
    pytestmark,
    resize,
    wait,
)

ROOT = Path(__file__).parents[2]
MOST_PIXELS = 3000
FIRST_ANSWER_MS = 500
FRAMES = 30
"""Least frames a second of a drawing that runs."""
TRIALS = 5
ANSWERED = "document.getElementById('status').textContent.startsWith('Answered')"


@pytest.fixture
def at(browser, address):
    """Opens a machine's page; afterwards the console must be free of errors."""

    def go(scene: str, width: int = 1280, fragment: str = ""):
        browser.get("about:blank")
        resize(browser, width)
        browser.get_log("browser")
        browser.get(f"{address}/scenes/{scene}{fragment}")
        wait(browser, "document.body.dataset.ready")
        return browser

    yield go
    wrong = [row for row in browser.get_log("browser") if row["level"] in ("SEVERE", "WARNING")]
    assert not wrong, wrong


def answer(page) -> None:
    page.execute_script("document.getElementById('status').textContent = ''")
    find(page, "run").click()
    wait(page, ANSWERED)


def choose(page, query: int) -> None:
    """Chooses a question and waits for the answer to its first example."""
    if query:
        page.execute_script("document.getElementById('status').textContent = ''")
        Select(find(page, "query")).select_by_index(query)
    wait(page, ANSWERED)


@pytest.mark.parametrize("width", [360, pytest.param(1440, marks=pytest.mark.wide)])
@pytest.mark.parametrize("scene", SCENES)
def test_every_question_is_answered_and_no_part_sticks_out(at, scene, width) -> None:
    page = at(scene, width)
    for k in range(len(scene_details(scene)["queries"])):
        choose(page, k)
        page.execute_script("for (const fold of document.querySelectorAll('details')) fold.open = true")
        wait(page, "document.getElementById('all').childElementCount")
        assert page.execute_script("return document.documentElement.scrollWidth") <= width
        text = page.execute_script("return document.body.innerText")
        assert "[object" not in text and "undefined" not in text and "NaN" not in text
        # rows of a table are alike: axe-core looks at a few of them, and would take seconds for thousands of cells
        page.execute_script(
            "for (const rows of document.querySelectorAll('tbody')) rows.replaceChildren(...[...rows.rows].slice(0, 4))"
        )
        assert faults(page) == []
        find(page, "theme").click()  # the next question in the other colours


@pytest.mark.parametrize("scene", SCENES)
def test_every_example_goes_through_the_form_unchanged(at, scene) -> None:
    """What the form reads back from an example's fields is the example: nothing is lost, nothing is typed as JSON."""
    page = at(scene)
    for query in scene_details(scene)["queries"]:
        for name, example in query["examples"].items():
            page.execute_script("document.body.innerHTML = '<section class=schema id=fields></section>'")
            read = page.execute_async_script(
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
            typed = page.execute_script(
                "return [...document.querySelectorAll('input[type=text], textarea')].map((field) => field.value)"
            )
            assert not any(part in entry for part in '[{"' for entry in typed)


@pytest.mark.timed
@pytest.mark.parametrize("scene", SCENES)
def test_the_first_answer_is_there_at_once(at, scene) -> None:
    took = []
    for _ in range(TRIALS):  # a busy machine has its moments
        took.append(at(scene).execute_script("return performance.getEntriesByName('first answer')[0].duration"))
        if took[-1] < FIRST_ANSWER_MS:
            return
    raise AssertionError(f"first answers after {took} ms")


def test_a_link_restores_question_values_and_place(at) -> None:
    page = at("lift")
    field = page.find_element(By.CSS_SELECTOR, "#fields input")
    field.clear()
    field.send_keys("310")
    answer(page)
    slider = page.find_element(By.CSS_SELECTOR, ".player input")
    page.execute_script("arguments[0].value = 2.5; arguments[0].dispatchEvent(new Event('input'))", slider)
    page.execute_cdp_cmd(
        "Browser.grantPermissions", {"permissions": ["clipboardReadWrite", "clipboardSanitizedWrite"]}
    )
    page.execute_script("navigator.clipboard.writeText = (text) => { window.kept = text; return Promise.resolve(); }")
    find(page, "link").click()
    wait(page, "window.kept")
    fragment = page.execute_script("return new URL(window.kept).hash")
    page = at("lift", fragment=fragment)
    assert page.find_element(By.CSS_SELECTOR, "#fields input").get_attribute("value") == "310"
    assert float(page.find_element(By.CSS_SELECTOR, ".player input").get_attribute("value")) == 2.5
    page = at("lift", fragment="#j=damaged")
    assert page.find_element(By.CSS_SELECTOR, ".stage")


def test_what_is_wrong_is_said_at_its_field(at) -> None:
    page = at("lift")
    fields = page.find_elements(By.CSS_SELECTOR, "#fields input")
    fields[0].clear()
    fields[0].send_keys("abc")
    find(page, "run").click()
    assert fields[0].get_attribute("aria-invalid") == "true"
    assert "a number is wanted" in find(page, "fields").text
    assert page.switch_to.active_element == fields[0]
    fields[0].clear()
    fields[0].send_keys("-3")
    find(page, "run").click()
    assert "> 0 is wanted, found -3" in find(page, "status").text


@pytest.mark.timed
def test_a_drawing_runs_smoothly_and_stops(at) -> None:
    page = at("lift")
    button = page.find_element(By.CSS_SELECTOR, ".player button")
    body = page.find_element(By.CSS_SELECTOR, ".stage .body")
    before = body.get_attribute("d")
    button.click()
    frames = page.execute_async_script(
        """const done = arguments[0], path = document.querySelector(".stage .body");
        let frames = 0;
        const watch = new MutationObserver(() => frames++);
        watch.observe(path, { attributes: true, attributeFilter: ["d"] });
        setTimeout(() => { watch.disconnect(); done(frames); }, 1000)"""
    )
    assert frames >= FRAMES
    assert body.get_attribute("d") != before
    button.click()
    stood = body.get_attribute("d")
    time.sleep(0.2)
    assert body.get_attribute("d") == stood
    assert button.get_attribute("aria-label") == "Play"


PICTURES = {
    "lift_page": ("lift", 1440, "light", 1, 0.4),
    "lift_page_dark": ("lift", 1440, "dark", 0, 0.7),
    "lift_page_phone": ("lift", 360, "light", 0, 0.5),
}
"""Pictures of docs/img: machine, width, colours, question, and how far the drawing has run."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.wide] * (name != "lift_page_phone")) for name in PICTURES]
)
def test_it_looks_like_this(at, tmp_path, name) -> None:
    """The pictures of the documents; made anew with ``LINKAGE_ATLAS_SCREENSHOTS=1``."""
    scene, width, theme, query, share = PICTURES[name]
    page = at(scene, width)
    if page.execute_script("return document.documentElement.dataset.theme") != theme:
        find(page, "theme").click()
    choose(page, query)
    slider = page.find_element(By.CSS_SELECTOR, ".player input")
    page.execute_script(
        "const [s, share] = arguments; s.value = Number(s.min) + share * (s.max - s.min); s.dispatchEvent(new Event('input'))",
        slider,
        share,
    )
    page.execute_script("document.activeElement.blur()")
    height = page.execute_script(
        "return Math.ceil(document.querySelector('.output').getBoundingClientRect().bottom) + 20"
    )
    resize(page, width, min(height, MOST_PIXELS))
    time.sleep(0.5)
    file = tmp_path / f"{name}.png"
    assert page.save_screenshot(str(file)) and file.stat().st_size > 20_000
    if os.environ.get("LINKAGE_ATLAS_SCREENSHOTS"):
        shutil.copy(file, ROOT / "docs/img" / file.name)


MOVING = {"chain": ".stage .link.thin", "knotter": ".stage .rope"}
"""What moves in each drawing."""


@pytest.mark.timed
@pytest.mark.parametrize("scene", MOVING)
def test_chain_and_knotter_run_smoothly_and_stop(at, scene) -> None:
    page = at(scene)
    button, part = (
        page.find_element(By.CSS_SELECTOR, ".player button"),
        page.find_element(By.CSS_SELECTOR, MOVING[scene]),
    )
    button.click()
    frames = page.execute_async_script(
        """const [name, done] = arguments, path = document.querySelector(name);
        let frames = 0;
        const watch = new MutationObserver((rows) => { frames += rows.length ? 1 : 0; });
        watch.observe(path, { attributes: true, attributeFilter: ["d"] });
        setTimeout(() => { watch.disconnect(); done(frames); }, 1000)""",
        MOVING[scene],
    )
    assert frames >= FRAMES
    button.click()
    stood = part.get_attribute("d")
    time.sleep(0.2)
    assert part.get_attribute("d") == stood and button.get_attribute("aria-label") == "Play"


def slide(page, value: float) -> None:
    page.execute_script(
        "const s = document.querySelector('.player input'); s.value = arguments[0]; s.dispatchEvent(new Event('input'))",
        value,
    )


def test_the_chains_pins_wheels_and_slot_are_drawn_and_follow_the_phase(at) -> None:
    page = at("chain")
    stages = page.find_elements(By.CSS_SELECTOR, "#picture .stage")
    assert len(stages) == 2
    assert len(stages[0].find_elements(By.CSS_SELECTOR, "circle.pin")) == 15
    assert len(stages[0].find_elements(By.CSS_SELECTOR, "circle.wheel")) == 2
    labels = [one.text for one in stages[0].find_elements(By.CSS_SELECTOR, ".symbol")]
    assert {"slot", "P1", "P14", "R0", "R1", "R2", "O1", "O2"} <= set(labels)
    lowest = {}
    for theta in (29.6, 74.6):
        slide(page, theta)
        place = stages[1].find_element(By.CSS_SELECTOR, "circle.point")
        lowest[theta] = float(place.get_attribute("cy"))
        link = stages[0].find_element(By.CSS_SELECTOR, ".link.thin").get_attribute("d")
        assert link.count("L") == 15
    assert lowest[74.6] > lowest[29.6] + 20  # the free pin hangs deepest in the middle of the window
    # a roller adds the groove's walls
    Select(find(page, "example")).select_by_value("roller")
    wait(page, "document.querySelectorAll('#picture .wall').length === 4")
    assert "52.09" in find(page, "facts").text
    assert "t^0" in find(page, "tables").text


def test_the_knotter_shows_entries_and_verdicts_and_can_be_turned(at) -> None:
    page = at("knotter")
    verdict = page.find_element(By.CSS_SELECTOR, ".verdicts-list").text
    assert "wraps over S3S4 at 90.1396°" in verdict and "bites the rope over S8S9 at 311.963°" in verdict
    drawing = page.find_element(By.CSS_SELECTOR, "#picture .stage")
    assert len(drawing.find_elements(By.CSS_SELECTOR, "circle.enter:not(.wrong)")) == 2
    # at the wrap's entry the mark lies on the rope: the drawing opens there
    rope = drawing.find_element(By.CSS_SELECTOR, ".rope").get_attribute("d")
    ends = [tuple(map(float, part.split())) for part in rope.lstrip("M").split("L")]
    mark = drawing.find_element(By.CSS_SELECTOR, "circle.enter")
    x, y = (float(mark.get_attribute(name)) for name in ("cx", "cy"))
    (x0, y0), (x1, y1) = ends
    off = abs((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2) ** 0.5
    assert off < 0.5
    before = drawing.find_element(By.CSS_SELECTOR, ".body").get_attribute("d")
    ActionChains(page).move_to_element(drawing).click_and_hold().move_by_offset(90, 20).release().perform()
    turned = drawing.find_element(By.CSS_SELECTOR, ".body").get_attribute("d")
    assert turned != before
    view = Select(page.find_element(By.CSS_SELECTOR, ".view-choice select"))
    assert view.first_selected_option.text == "as turned"
    shapes = set()
    for k in range(4):
        view.select_by_index(k)
        shapes.add(drawing.find_element(By.CSS_SELECTOR, ".body").get_attribute("d"))
    assert len(shapes) == 4 and before in shapes
    Select(find(page, "example")).select_by_value("fails_to_wrap")
    wait(page, "document.querySelector('.verdicts-list li.no')")
    assert "through S5S3" in page.find_element(By.CSS_SELECTOR, ".verdicts-list").text
    assert page.find_elements(By.CSS_SELECTOR, "circle.enter.wrong")
