"""Each state of the page at three widths, light and dark: nothing sticks out, axe-core finds no serious fault.

With ``LINKAGE_ATLAS_SCREENSHOTS=1`` the pictures docs/img/<state>-<width>-<theme>.png are made anew.
"""

from __future__ import annotations

import io
import os

import pytest

from tests.e2e.test_page_browser import (  # noqa: F401
    IDLE,
    ROOT,
    By,
    Keys,
    choose,
    drag,
    faults,
    find,
    mode,
    opened,
    pick,
    pytestmark,
    resize,
    rest,
    slide,
    wait,
)

SIZES = {360: 740, 1280: 800, 1440: 900}


def start(page) -> None:
    rest(page)
    slide(page, 14)


def gallery(page) -> None:
    find(page, "open-gallery").click()


def limits(page) -> None:
    page.execute_script("document.getElementById('limits').open = true")
    find(page, "transmission").send_keys("95")
    page.execute_script("document.getElementById('limits').scrollIntoView({block: 'start'})")


def solved(page) -> None:
    find(page, "solve").click()
    wait(page, f"document.querySelectorAll('#solutions li').length && {IDLE}")
    rest(page)
    page.execute_script("document.getElementById('results').scrollIntoView({block: 'start'})")


def hand(page) -> None:
    find(page, "show-menu").click()
    find(page, "ghosts").click()
    find(page, "show-menu").click()
    mode(page, "hand")
    page.execute_script("document.getElementById('canvas').scrollIntoView({block: 'center'})")
    drag(page, page.find_element(By.CSS_SELECTOR, "#canvas [data-joint=c]"), 10, -8)


def sheet(page) -> None:
    page.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})


STATES = {"start": start, "gallery": gallery, "limits": limits, "hand": hand, "solved": solved, "sheet": sheet}


def keep(page, name: str) -> None:
    """A picture of the state in docs/img, in few colours, if it is asked for."""
    if not os.environ.get("LINKAGE_ATLAS_SCREENSHOTS"):
        return
    from PIL import Image

    picture = Image.open(io.BytesIO(page.get_screenshot_as_png())).convert("RGB")
    picture.quantize(128, dither=Image.Dither.NONE).save(ROOT / f"docs/img/{name}.png", optimize=True)


@pytest.mark.parametrize(
    ("width", "theme"),
    [
        (360, "light"),
        *(
            pytest.param(width, theme, marks=pytest.mark.wide)
            for width, theme in [(360, "dark"), (1280, "light"), (1280, "dark"), (1440, "light"), (1440, "dark")]
        ),
    ],
)
def test_every_state_is_whole_and_accessible(opened, width, theme) -> None:  # noqa: F811
    resize(opened, width, SIZES[width])
    if opened.execute_script("return document.documentElement.dataset.theme") != theme:
        find(opened, "theme").click()
    for name, show in STATES.items():
        opened.execute_script("scrollTo(0, 0)")
        show(opened)
        assert opened.execute_script("return document.documentElement.scrollWidth") <= width, name
        keep(opened, f"{name}-{width}-{theme}")
        assert faults(opened) == [], name
        if name == "gallery":
            find(opened, "gallery-close").click()
        if name == "limits":
            field = find(opened, "transmission")
            field.send_keys(Keys.BACKSPACE * 2, Keys.TAB)
            opened.execute_script("document.getElementById('limits').open = false")
    opened.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
