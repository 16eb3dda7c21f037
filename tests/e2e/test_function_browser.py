"""The page of function generation in a real browser: a function chosen, typed and drawn, its linkage and its error."""

from __future__ import annotations

import json
import time

import numpy as np
import pytest

from tests.e2e.test_page_browser import (  # noqa: F401
    ActionChains,
    By,
    Keys,
    Select,
    find,
    forget,
    pick,
    pytestmark,
    resize,
    saved,
    wait,
)


@pytest.fixture
def opened(browser, address):
    """The page, freshly loaded; afterwards its console must be free of errors."""
    forget(browser, address)
    resize(browser, 1280)
    browser.get_log("browser")
    browser.get(f"{address}/function")
    wait(browser, "document.body.dataset.ready")
    yield browser
    wrong = [row for row in browser.get_log("browser") if row["level"] in ("SEVERE", "WARNING")]
    assert not wrong, wrong


def solve(page) -> None:
    find(page, "solve").click()
    wait(page, "!document.getElementById('status').textContent.startsWith('Searching')", 60)


def test_a_chosen_function_shows_linkage_and_error_and_is_saved(opened, downloads) -> None:
    solve(opened)
    assert "come closest" in find(opened, "status").text
    assert len(opened.find_elements(By.CSS_SELECTOR, "#solutions button")) >= 1
    titles = [one.text for one in opened.find_elements(By.CSS_SELECTOR, "#curves h3")]
    assert titles[:2] == ["Error in degrees of the rocker", "Error in units of y"]
    assert "Extremes as large, alternating" in find(opened, "numbers").text
    before = opened.find_element(By.CSS_SELECTOR, "#canvas .crank").get_attribute("d")
    opened.execute_script(
        "const s = document.getElementById('slider'); s.value = 1; s.dispatchEvent(new Event('input'));"
    )
    assert find(opened, "where").text.startswith("60°")
    # at the last x the rocker has turned by the whole dial, but for the error
    assert abs(float(find(opened, "where").text.split("rocker ")[1].rstrip("°")) - 90) < 0.5
    assert opened.find_element(By.CSS_SELECTOR, "#canvas .crank").get_attribute("d") != before
    opened.find_element(By.CSS_SELECTOR, "#exports [data-format=csv]").click()
    for _ in range(100):
        if (downloads / "function-1.csv").exists():
            break
        time.sleep(0.1)
    assert (downloads / "function-1.csv").read_text().startswith("input,output_wanted")


def test_a_drawn_function_and_what_is_missing(opened) -> None:
    Select(find(opened, "name")).select_by_value("drawn")
    solve(opened)
    assert find(opened, "status").text == "Draw the function from left to right first."
    pad = find(opened, "pad")
    steps = ActionChains(opened, duration=5).move_to_element_with_offset(pad, -120, 70).click_and_hold()
    for k in range(1, 25):
        steps = steps.move_to_element_with_offset(pad, -120 + 10 * k, 70 - round(140 * (k / 24) ** 2))
    steps.release().perform()
    solve(opened)
    assert opened.find_elements(By.CSS_SELECTOR, "#solutions button")


def test_a_wrong_table_is_named(opened) -> None:
    Select(find(opened, "name")).select_by_value("table")
    find(opened, "table").clear()
    find(opened, "table").send_keys("0, 0\n1, a")
    solve(opened)
    assert "Line 2" in find(opened, "status").text


PAIRS = "input;output\n0;0\n20;11,5\n45;33\n80;61\n110;84\n"
ASKED = (
    "window.asked=[];const own=window.fetch;window.fetch=async(...a)=>"
    "{if(a[0].startsWith('/v1/'))window.asked.push(JSON.parse(a[1].body));return own(...a)}"
)


def ask_table(page, rows: str, kind: str = "table") -> None:
    """Rows put into the field as a paste does."""
    Select(find(page, "name")).select_by_value(kind)
    field = find(page, "table")
    page.execute_script(
        "arguments[0].value = arguments[1]; arguments[0].dispatchEvent(new Event('input', {bubbles: true}))",
        field,
        rows,
    )


def asked(page) -> dict:
    return page.execute_script("return window.asked.at(-1)")


def test_angle_pairs_are_asked_for_as_they_are(opened, downloads) -> None:
    """Not stretched to the spans that the fields for numbers hold."""
    opened.execute_script(ASKED)
    ask_table(opened, PAIRS)
    assert find(opened, "name").get_attribute("value") == "pairs", "the columns' names say so"
    assert not find(opened, "crank-span").is_displayed() and not find(opened, "output-span").is_displayed()
    solve(opened)
    request = asked(opened)
    assert request["input"] == [0, 20, 45, 80, 110] and request["output"] == [0, 11.5, 33, 61, 84]
    assert not {"function", "crank_span", "angle_unit"} & request.keys()
    opened.execute_script(
        "const s = document.getElementById('slider'); s.value = 1; s.dispatchEvent(new Event('input'));"
    )
    crank, rocker = find(opened, "where").text.split(", rocker ")
    error = float(find(opened, "solutions").text.split()[1].rstrip("°"))
    assert crank == "110°" and abs(float(rocker.rstrip("°")) - 84) <= error + 1e-3
    behaviour = {"behavior": "allow", "downloadPath": str(downloads), "eventsEnabled": True}
    opened.execute_cdp_cmd("Browser.setDownloadBehavior", behaviour)
    for name in ("function-1.json", "function-1.csv"):
        (downloads / name).unlink(missing_ok=True)
        pick(opened, f"#exports [data-format={name.rpartition('.')[2]}]").click()
        content = saved(downloads, name).decode()
        if name.endswith("json"):
            assert json.loads(content)["request"]["output"] == [0, 11.5, 33, 61, 84]
        else:
            rows = np.array([row.split(",")[:2] for row in content.splitlines()[1:]], float)
            assert np.allclose(rows, np.array([request["input"], request["output"]]).T)


def test_angle_pairs_keep_their_unit_and_their_zeros(opened) -> None:
    opened.execute_script(ASKED)
    radians = [[0.5, 1.0], [0.8, 1.1], [1.2, 1.35], [1.7, 1.8], [2.0, 2.1]]
    rows = "\n".join(f"{x} {y}" for x, y in radians)
    ask_table(opened, f"crank (rad) output (rad)\n{rows}")
    find(opened, "transmission").send_keys("40")
    solve(opened)
    request = asked(opened)
    assert (
        request["angle_unit"] == "rad" and [list(row) for row in zip(request["input"], request["output"])] == radians
    )
    assert request["limits"]["transmission_angle_min"] == pytest.approx(np.radians(40))
    assert find(opened, "where").text.startswith(f"{np.degrees(0.5):.4g}°, rocker {np.degrees(1.0):.2g}")
    assert float(find(opened, "solutions").text.split()[1].rstrip("°")) < 20
    rows = dict(
        row.split(" ", 1) for row in find(opened, "numbers").text.splitlines() if row.startswith("Transmission ")
    )
    assert float(rows["Transmission"].rstrip("°")) >= 39.9
    pick(opened, "#exports [data-format=svg]").click()
    wait(opened, "document.getElementById('export-note').textContent.startsWith('Saved')")
    assert asked(opened)["solution"]["transmission_angle_min"] < 2, "as it came, in radians"
    ask_table(opened, "output\n0\n10\n30\n40")
    find(opened, "crank-span").send_keys(Keys.CONTROL, "a")
    find(opened, "crank-span").send_keys("70")
    solve(opened)
    assert asked(opened)["output"] == [0, 10, 30, 40] and asked(opened)["crank_span"] == 70


@pytest.mark.parametrize("rows", ["t,output\n0,0\n1,10\n2,30", "Time [s];x;y\n0;0;0\n1;10;1"])
def test_a_column_of_times_is_no_crank_angle(opened, rows) -> None:
    ask_table(opened, rows)
    solve(opened)
    name = rows.replace(" ", ",").split(",")[0]
    said = (
        f"The column '{name}' is a time, and no crank angle: name it 'crank' if it holds crank angles in degrees, or"
    )
    assert find(opened, "status").text.startswith(said)


def test_a_question_of_ones_own_is_kept_and_a_link_is_answered(opened, address) -> None:
    opened.execute_script(ASKED)
    ask_table(opened, PAIRS)
    find(opened, "one-way").click()
    assert find(opened, "draft-text").text.startswith("Draft, kept in this browser")
    opened.get(address)
    wait(opened, "document.body.dataset.ready")
    opened.back()
    wait(opened, "document.body.dataset.ready")
    opened.refresh()
    wait(opened, "document.body.dataset.ready")
    assert find(opened, "table").get_attribute("value") == PAIRS and find(opened, "one-way").is_selected()
    solve(opened)
    find(opened, "link").click()
    wait(opened, "location.hash.length > 10")
    link = opened.current_url
    forget(opened, address)
    opened.get(link)
    wait(opened, "document.querySelectorAll('#solutions li').length", 60)
    assert find(opened, "table").get_attribute("value") == PAIRS and not find(opened, "draft").is_displayed()
    opened.get(f"{address}/function")
    wait(opened, "document.body.dataset.ready && !document.querySelectorAll('#solutions li').length")
    assert find(opened, "name").get_attribute("value") == "log10"
    find(opened, "x1").send_keys(Keys.END, "0")
    opened.execute_script("location.hash = arguments[0]", link.partition("#")[2])
    wait(opened, "document.querySelectorAll('#solutions li').length", 60)
    assert (
        find(opened, "table").get_attribute("value") == PAIRS and "replaced once" in find(opened, "draft-text").text
    )
    opened.back()
    wait(opened, "document.getElementById('name').value === 'log10'")
    assert find(opened, "x1").get_attribute("value") == "20", "the draft is there again"
    find(opened, "draft-discard").click()
    assert find(opened, "x1").get_attribute("value") == "2" and not find(opened, "draft").is_displayed()


def test_cards_of_an_earlier_question_say_so(opened) -> None:
    solve(opened)
    marks = "return [...document.querySelectorAll('[data-earlier]')].map((one) => one.checkVisibility())"
    assert set(opened.execute_script(marks)) == {False}
    find(opened, "one-way").click()
    assert set(opened.execute_script(marks)) == {True} and "has changed" in find(opened, "status").text
    find(opened, "one-way").click()
    assert set(opened.execute_script(marks)) == {False} and "come closest" in find(opened, "status").text
    opened.execute_script("window.fetch = () => Promise.reject(new TypeError('gone'))")
    solve(opened)
    assert set(opened.execute_script(marks)) == {True} and "cannot be reached" in find(opened, "status").text
