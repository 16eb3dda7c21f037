"""Pictures of the machines' pages in a browser: ``python -m docs.screens [machine ...]`` writes docs/img/<machine>_page*.png.

It needs Chromium and its driver, as the tests of the page do, and no atlas: light and dark at 1280 pixels, a phone at 390.
"""

from __future__ import annotations

import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import uvicorn
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

from app.main import create_app
from tests.e2e.conftest import CHROMIUM, DRIVER, OPTIONS

IMAGES = Path(__file__).parent / "img"
SHOTS = {"page": (1280, "light"), "page_dark": (1280, "dark"), "page_phone": (390, "light")}
"""Width in pixels and theme of each picture."""
PLACES = {"lift": 0.5, "chain": 0.5, "knotter": 0.252}
"""Position of the slider of each machine, as a fraction of the range."""
QUESTIONS = {("lift", "page"): 1}
"""Query of a picture, if it is not the first."""


@contextmanager
def service() -> Iterator[str]:
    """The service on a free port."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        server = uvicorn.Server(uvicorn.Config(create_app(), log_level="error"))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]}, daemon=True)
        thread.start()
        while not server.started:
            time.sleep(0.05)
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
        server.should_exit = True
        thread.join(10)


def wait(browser: Any, condition: str) -> None:
    """Until a JavaScript expression is true, at most a minute."""
    end = time.monotonic() + 60
    while not browser.execute_script(f"return Boolean({condition})"):
        if time.monotonic() > end:
            raise TimeoutError(condition)
        time.sleep(0.05)


def shoot(browser: Any, address: str, machine: str) -> None:
    """Take the three pictures of a machine's page, from its head to the end of its curves."""
    for name, (width, theme) in SHOTS.items():
        if not (picture := IMAGES / f"{machine}_{name}.png").exists():  # no document shows it
            continue
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
        browser.get(f"{address}/scenes/{machine}")
        wait(browser, "document.body.dataset.ready")
        if browser.execute_script("return document.documentElement.dataset.theme") != theme:
            browser.find_element("id", "theme").click()
        if question := QUESTIONS.get((machine, name)):
            browser.execute_script(
                """const query = document.getElementById('query');
                document.getElementById('status').textContent = '';
                query.selectedIndex = arguments[0]; query.dispatchEvent(new Event('change'));
                document.getElementById('run').click();""",
                question,
            )
            wait(browser, "document.getElementById('status').textContent.startsWith('Calculated')")
        browser.execute_script(
            """const slider = document.querySelector('.player input');
            slider.value = Number(slider.min) + arguments[0] * (slider.max - slider.min);
            slider.dispatchEvent(new Event('input'));
            document.getElementById('status').textContent = '';""",
            PLACES[machine],
        )
        height = browser.execute_script(
            "return Math.ceil(document.querySelector('main').getBoundingClientRect().bottom)"
        )
        browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", {**size, "height": min(height + 20, 5000)})
        time.sleep(0.5)
        browser.save_screenshot(str(picture))


def main(machines: list[str]) -> None:
    """Pictures of some machines, or of all."""
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    with TemporaryDirectory() as profile, service() as address:
        for option in (*OPTIONS, f"--user-data-dir={profile}", "--window-size=1280,900"):
            options.add_argument(option)
        browser = webdriver.Chrome(options=options, service=Service(DRIVER))
        try:
            for machine in machines or list(PLACES):
                shoot(browser, address, machine)
        finally:
            browser.quit()


if __name__ == "__main__":
    main(sys.argv[1:])
