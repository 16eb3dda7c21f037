"""The page of function generation in a real browser: a function chosen, typed and drawn, its linkage and its error."""

from __future__ import annotations

import time

import pytest

from tests.e2e.test_page_browser import (  # noqa: F401
    ActionChains,
    By,
    Select,
    find,
    pytestmark,
    resize,
    wait,
)


@pytest.fixture
def opened(browser, address):
    """The page, freshly loaded; afterwards its console must be free of errors."""
    browser.get("about:blank")
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
