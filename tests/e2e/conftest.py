"""Start the service and the browser once for all browser tests: starting them takes longer than most tests."""

import shutil
from pathlib import Path
from typing import Any

import pytest

from app.main import create_app
from app.settings import Settings
from tests.conftest import listening
from tests.e2e.page import PATIENCE, MotionPage

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
WITHOUT = ("gpu", "dev-shm-usage", "background-networking", "component-update", "sync")
OPTIONS = ("--headless=new", "--no-sandbox", "--no-first-run", "--hide-scrollbars")
# the first keeps every page that was left; the others read the text of each page
OPTIONS += ("--disable-features=BackForwardCache,Translate,OptimizationHints,PageContentAnnotations",)
OPTIONS += ("--force-prefers-reduced-motion",)  # a linkage that runs takes a processor of its own
OPTIONS += tuple(f"--disable-{name}" for name in WITHOUT)
NO_FORM_FILLING = {
    "autofill": {"profile_enabled": False, "credit_card_enabled": False},
    "credentials_enable_service": False,
    "profile": {"password_manager_enabled": False},
}
"""Preferences without which the browser examines all fields of a page for addresses and passwords."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run browser tests first, and in each file the tests that share a page before the tests that load a page.

    Tests of the documents follow, which are long too, so that no process ends with a long file while the others are idle.
    """
    here = Path(__file__).parent

    def order(item: pytest.Item) -> tuple[Any, ...]:
        if item.path.parent == here:
            return (0, item.path, "shared" not in item.fixturenames)
        return (1 if item.path.parent == here.parent else 2,)

    items.sort(key=order)


def with_cache(app: Any) -> Any:
    """Wrap the service so that the browser caches its modules, and repeated requests get the stored reply.

    Each page that opens requests the layers of its machine again. Requests with ``start_from`` are always computed.
    test_page.py checks the real cache headers.
    """
    replies: dict[Any, list[Any]] = {}

    async def answer(scope: Any, receive: Any, send: Any) -> None:
        body, sent = [], []
        if posted := scope["type"] == "http" and scope["method"] == "POST":
            while not body or body[-1].get("more_body"):
                body.append(await receive())
        content = b"".join(message.get("body", b"") for message in body)
        key = scope.get("path"), scope.get("query_string"), tuple(scope.get("headers", ())), content
        for message in replies.get(key, ()):
            await send(message)
        if key in replies:
            return

        async def received() -> Any:
            return body.pop(0) if body else await receive()

        async def answered(message: Any) -> None:
            if message["type"] == "http.response.start" and scope["path"].startswith("/static/"):
                headers = [pair for pair in message["headers"] if pair[0] != b"cache-control"]
                message = message | {"headers": [*headers, (b"cache-control", b"max-age=3600")]}
            await send(message)
            sent.append(message)

        await app(scope, received, answered)
        is_complete = sent and sent[0]["status"] == 200 and not sent[-1].get("more_body")
        if posted and is_complete and b'"start_from"' not in content:
            replies[key] = sent

    return answer


@pytest.fixture(scope="session")
def address():
    """Address of a service without an atlas on a free port."""
    with listening(with_cache(create_app(Settings(with_atlas=False)))) as (port, _):
        yield f"http://127.0.0.1:{port}"


@pytest.fixture(scope="session")
def downloads(tmp_path_factory):
    return tmp_path_factory.mktemp("downloads")


@pytest.fixture(scope="session")
def browser(tmp_path_factory, downloads):
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    if not (CHROMIUM and DRIVER):
        pytest.skip("there is no chromium with chromedriver (Debian: chromium, chromium-driver)")
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    options.page_load_strategy = "eager"  # tests wait for the elements that they use
    for option in (*OPTIONS, f"--user-data-dir={tmp_path_factory.mktemp('profile')}", "--window-size=1280,900"):
        options.add_argument(option)
    options.add_experimental_option("prefs", NO_FORM_FILLING)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(PATIENCE)
    where = {"behavior": "allow", "downloadPath": str(downloads), "eventsEnabled": True}
    driver.execute_cdp_cmd("Browser.setDownloadBehavior", where)
    yield driver
    driver.quit()


@pytest.fixture
def moving(browser):
    """Let pages start their animation, as without the preference for reduced motion."""
    motion = {"name": "prefers-reduced-motion", "value": "no-preference"}
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [motion]})
    yield
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


@pytest.fixture(scope="session")
def pages(browser, address, downloads) -> MotionPage:
    """The browser before any page is opened."""
    return MotionPage(browser, address, downloads)


@pytest.fixture
def page(pages):
    """The page of motions, freshly loaded at 1280 pixels; afterwards its console must be free of errors."""
    pages.load()
    yield pages
    pages.assert_no_errors()


@pytest.fixture
def shared(pages, request):
    """The page as the previous test of the same file left it, because loading a page takes longer than most tests."""
    if pages.run("return window.shared") == request.module.__name__:
        pages.renew()
    else:
        pages.load()
        pages.run("window.shared = arguments[0]", request.module.__name__)
    yield pages
    pages.assert_no_errors()


@pytest.fixture
def opened(shared):
    """The shared page with the first machine of the gallery opened and paused."""
    shared.choose("casement")
    return shared


@pytest.fixture
def edited(opened):
    """The shared page with its first machine paused, in the mode that edits the linkage."""
    opened.mode("hand")
    return opened
