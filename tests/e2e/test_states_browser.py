"""Each state of the page at three widths, light and dark: nothing sticks out, axe-core finds no serious fault.

With ``LINKAGE_ATLAS_SCREENSHOTS=1`` the pictures docs/img/<state>-<width>-<theme>.png are replaced.
"""

import itertools

import pytest
from selenium.webdriver.common.keys import Keys

from tests.conftest import some_of
from tests.e2e.page import CARDS, IDLE, keep

SIZES = {360: 740, 1280: 800, 1440: 900}


def start(page) -> None:
    page.pause()
    page.slide(14)


def gallery(page) -> None:
    page.click("open-gallery")


def limits(page) -> None:
    page.unfold("limits")
    page.find("transmission").send_keys("95")
    page.run("document.getElementById('limits').scrollIntoView({block: 'start'})")


def solved(page) -> None:
    page.click("solve")
    page.wait(f"{CARDS} && {IDLE}")
    page.pause()
    page.run("document.getElementById('results').scrollIntoView({block: 'start'})")


def hand(page) -> None:
    page.click("show-menu")
    page.click("ghosts")
    page.click("show-menu")
    page.mode("hand")
    page.canvas()
    page.drag(page.element("#canvas [data-joint=c]"), 10, -8)


def sheet(page) -> None:
    page.run("window.dispatchEvent(new Event('beforeprint'))")
    page.cdp("Emulation.setEmulatedMedia", {"media": "print"})


STATES = {
    "start": (start, "html"),
    "gallery": (gallery, "#gallery"),
    "limits": (limits, "#form"),
    "hand": (hand, ".board, #results, #numbers-card"),
    "solved": (solved, "main"),
    "sheet": (sheet, "html"),
}
"""Function that produces each state, and the selector of the elements that it changes."""


@pytest.mark.parametrize(("width", "theme"), some_of([*itertools.product(SIZES, ("light", "dark"))], 1))
def test_every_state_is_whole_and_accessible(page, width, theme) -> None:
    page.resize(width, SIZES[width])
    page.theme(theme)
    for name, (show, part) in STATES.items():
        page.run("scrollTo(0, 0)")
        show(page)
        assert page.width <= width, name
        keep(page, f"{name}-{width}-{theme}")
        assert page.faults(part) == [], name
        if name == "gallery":
            page.click("gallery-close")
        if name == "limits":
            field = page.find("transmission")
            field.send_keys(Keys.BACKSPACE * 2, Keys.TAB)
            page.run("document.getElementById('limits').open = false")
    page.cdp("Emulation.setEmulatedMedia", {"media": ""})
