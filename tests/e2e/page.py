"""A page in the browser: find elements by id, read their text, and act as a user does."""

from __future__ import annotations

import io
import json
import os
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
from selenium.common.exceptions import JavascriptException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys

import linkage_atlas as la

ROOT = Path(__file__).parents[2]
EXAMPLES = json.loads((ROOT / "app/static/examples.json").read_text())
READY = "document.body?.dataset.ready"  # a page that has just come may have no body yet
PATIENCE = 60.0
"""Seconds until a condition of the page or a download is considered lost; searches take a few seconds."""
TRIES = 50
"""Number of times that a press is tried, a few hundredths of a second each."""
IDLE = "document.getElementById('progress').hidden"
CARDS = "document.querySelectorAll('#solutions li').length"
WATCH = (
    "const done = arguments[0], end = performance.now() + 1000;"
    "(function look() { let met; try { met = Boolean(CONDITION) } catch (error) { return done(String(error)) }"
    "if (met || performance.now() > end) done(met); else setTimeout(look, 20) })()"
)
"""Script that polls a condition within the page for a second; a call of the browser per poll would take longer."""
OPEN = (
    "const [at] = arguments, e = at.matches ? at : document.querySelector(at), step = e?.closest('.step');"
    "if (step?.hidden || (step && document.body.matches('.folded'))) document.getElementById(`tab-${step.id}`).click();"
)
"""Script that finds an element by a selector, and opens the step of the panel that contains it."""
IN_SIGHT = OPEN + (
    "const b = document.querySelector('.scene .solve');"
    "if (e && b && !b.contains(e) && e.getBoundingClientRect().bottom > b.getBoundingClientRect().top)"
    "e.scrollIntoView({block: 'center'}); return e"
)
"""Script that returns an element in the open step, scrolled out from under the bar with Solve on other pages."""
SPOT = OPEN + (
    "if (!e?.getClientRects().length) return null;"
    "const spot = () => { const f = e.getClientRects()[0]; return [f.x + f.width / 2, f.y + f.height / 2]; };"
    "const hit = () => e.contains(document.elementFromPoint(...spot()));"
    "if (!hit()) e.scrollIntoView({block: 'center'});"
    "if (!hit()) return null;"
    "window.pressed = 0; e.addEventListener('click', () => { window.pressed = 1; }, {once: true, capture: true});"
    "return spot().map(Math.round)"
)
"""Script that notes the next click of an element, and returns the point where a pointer meets it if there is one."""
STILL = (
    "const [e, done] = arguments; let before = null; e.scrollIntoView({block: 'center'});"
    "(function look() { const { x, y, width, height } = e.getBoundingClientRect(), now = `${[x, y, width, height]}`;"
    "if (now === before) done(); else { before = now; requestAnimationFrame(look); } })()"
)
"""Script that scrolls an element to the middle and waits until it lies at the same place in two frames."""
REPLACE = (
    OPEN
    + "e.closest('details')?.setAttribute('open', ''); e.scrollIntoView({block: 'center'}); e.focus(); e.select()"
)
"""Script that focuses a field in the open step and selects its text."""
CHOOSE = OPEN + (
    "const option = [...e.options].find((one) => one.value === arguments[1]);"
    "if (!option || option.disabled || e.disabled || !e.checkVisibility()) return false;"
    "e.focus(); if (!option.selected) { e.value = arguments[1];"
    "for (const name of ['input', 'change']) e.dispatchEvent(new Event(name, {bubbles: true})); } return true"
)
"""Script that chooses an option by its value, as a user could, and returns true if it is offered."""
SERIOUS = (
    "const rules = Object.fromEntries(axe._audit.rules.filter((one) => ['minor', 'moderate'].includes(one.impact))"
    ".map((one) => [one.id, {enabled: false}]));"
    "axe.run(arguments[0], {resultTypes: ['violations'], rules}).then(arguments[1])"
)
"""Script that runs the axe-core rules of serious and critical impact."""
RECORD = (
    "window.requests=[];const own=window.fetch;window.fetch=async(...a)=>{"
    "if(a[0]==='/v2/assembly'||a[0]==='/v2/export')return window.stub?new Promise(()=>{}):own(...a);"
    "if(!String(a[0]).startsWith('/v2/')||a[0]==='/v2/motion')return own(...a);"
    "window.requests.push(JSON.parse(a[1].body));const s=a[0]==='/v2/synthesize'&&window.stub;"
    "return s?new Response(JSON.stringify(s),{headers:{'content-type':'application/json'}}):own(...a)}"
)
"""Script that records request bodies and answers with `window.stub` if it is set.

Requests for layers and files are not recorded, and stay unanswered while a stub is set.
"""
MOUNT = {"pivot_a": (10, 5), "ground_angle": 8, "coupler_point_polar": (40, 35), "body_offset": 12}
FREE = la.FourBar(20, 60, 55, 58, start_angle=30, **MOUNT)
"""A crank-rocker whose motions the tests request."""
GOOD = re.compile(r"✓ (within practical limits|buildable in \d layers)")
"""Verdict on a card of a linkage within practical limits, before and after its layers are known."""
WORKS = {
    "order": True,
    "branch": True,
    "circuit": True,
    "within_tolerance": None,
    "practical_without_collisions": True,
    "reasons": [],
}
SHUT = ["transmission angle 21.9 degrees over the used interval, below 35", "b"]
LATE = ["sample 3 is off by 2.4 times the tolerance, the largest ratio of all samples"]
FAULTY = dict.fromkeys(("order", "branch", "practical_without_collisions"), False)
FAULTY["reasons"] = ["samples 2 and 3 lie on different branches"]
VERDICTS = [WORKS, WORKS | {"practical_without_collisions": False, "reasons": SHUT}]
VERDICTS += [WORKS | {"within_tolerance": False, "reasons": LATE}, WORKS | FAULTY]


def keep(page: Page, name: str) -> None:
    """Replace a picture of docs/img if it exists and ``LINKAGE_ATLAS_SCREENSHOTS=1`` is set."""
    if (ROOT / f"docs/img/{name}.png").exists() and os.environ.get("LINKAGE_ATLAS_SCREENSHOTS"):
        from PIL import Image

        picture = Image.open(io.BytesIO(page.browser.get_screenshot_as_png())).convert("RGB")
        picture.quantize(128, dither=Image.Dither.NONE).save(ROOT / f"docs/img/{name}.png", optimize=True)


def path_request(angles: Any, **more: Any) -> dict[str, Any]:
    return {"position": np.round(FREE.joints(angles).body_point, 6).tolist(), "timing": "free", **more}


class Page:
    """Any page of the service."""

    def __init__(self, browser: Any, address: str, downloads: Path) -> None:
        self.browser, self.address, self.downloads = browser, address, downloads

    # -- scripts and parts --------------------------------------------------------------------------------------------

    def run(self, script: str, *arguments: Any) -> Any:
        return self.browser.execute_script(script, *arguments)

    def run_async(self, script: str, *arguments: Any) -> Any:
        """Return the value that a script passes to its last argument."""
        return self.browser.execute_async_script(script, *arguments)

    def cdp(self, command: str, arguments: dict[str, Any]) -> Any:
        return self.browser.execute_cdp_cmd(command, arguments)

    def wait(self, condition: str, seconds: float = PATIENCE) -> None:
        """Wait until a JavaScript expression is true."""
        end, met = time.monotonic() + seconds, False
        while met is not True:
            assert not met, f"{condition}: {met}"
            assert time.monotonic() < end, f"waited for {condition}"
            try:
                met = self.run_async(WATCH.replace("CONDITION", condition))
            except JavascriptException as error:  # another page has come meanwhile
                if "unloaded" not in str(error):
                    raise

    def pick(self, selector: Any) -> Any:
        element = self.run(IN_SIGHT, selector)
        assert element is not None, f"there is no {selector}"
        return element

    def find(self, name: str) -> Any:
        return self.pick(f"#{name}")

    def element(self, selector: str) -> Any:
        return self.browser.find_element(By.CSS_SELECTOR, selector)

    def elements(self, selector: str) -> list[Any]:
        return self.browser.find_elements(By.CSS_SELECTOR, selector)

    @property
    def active(self) -> Any:
        return self.browser.switch_to.active_element

    def read(self, selector: str) -> str:
        """Return the displayed text of an element, empty if it is hidden; by a single call, as the page may replace it."""
        script = f"{OPEN} return e.checkVisibility() ? e.innerText : ''"
        return re.sub("[ \t]+", " ", self.run(script, selector)).strip()

    def text(self, name: str) -> str:
        return self.read(f"#{name}")

    @property
    def focus(self) -> str:
        return self.run("return document.activeElement.id")

    def content(self, name: str) -> str:
        """Return the text of an element, even if it is hidden."""
        return self.run("return document.getElementById(arguments[0]).textContent", name)

    def texts(self, selector: str) -> list[str]:
        return self.run("return [...document.querySelectorAll(arguments[0])].map((one) => one.innerText)", selector)

    def value(self, name: str) -> str:
        return self.run("return document.getElementById(arguments[0]).value", name)

    def shown(self, name: str) -> bool:
        return self.run(f"{OPEN} return e.checkVisibility({{visibilityProperty: true}})", f"#{name}")

    def ticked(self, name: str) -> bool:
        return self.run("return document.getElementById(arguments[0]).checked", name)

    def count(self, selector: str) -> int:
        return self.run("return document.querySelectorAll(arguments[0]).length", selector)

    @property
    def width(self) -> int:
        """Width of the page in pixels, including overflow."""
        return self.run("return document.documentElement.scrollWidth")

    # -- what a user does ---------------------------------------------------------------------------------------------

    def resize(self, width: int, height: int = 900) -> None:
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.cdp("Emulation.setDeviceMetricsOverride", size)

    def leave(self) -> None:
        """Leave the page for a picture of the same service.

        An address elsewhere would end the browser's process for the page, and the next page would wait for another.
        """
        self.browser.get(f"{self.address}/static/icon.svg")

    def forget(self) -> None:
        """Leave the page and clear its storage."""
        self.leave()
        self.run("sessionStorage.clear()")
        self.cdp("Storage.clearDataForOrigin", {"origin": self.address, "storageTypes": "local_storage"})

    def go(self, path: str = "") -> None:
        self.browser.get(f"{self.address}{path}")
        self.wait(READY)

    def load(self, path: str = "", width: int = 1280) -> None:
        """Load a page with empty storage."""
        self.resize(width)
        self.leave()  # a page that is left by its own address could still change that address
        self.browser.get_log("browser")
        script = self.cdp(
            "Page.addScriptToEvaluateOnNewDocument", {"source": "localStorage.clear(); sessionStorage.clear()"}
        )
        self.go(path)
        self.cdp("Page.removeScriptToEvaluateOnNewDocument", script)

    def reload(self) -> None:
        self.browser.refresh()
        self.wait(READY)

    def back(self) -> None:
        self.browser.back()
        self.wait(READY)

    def assert_no_errors(self) -> None:
        wrong = [row for row in self.browser.get_log("browser") if row["level"] in ("SEVERE", "WARNING")]
        assert not wrong, wrong

    def click(self, name: str) -> None:
        self.press(f"#{name}")

    def centre(self, element: Any) -> Any:
        """Scroll an element to the middle, and wait until nothing moves it any more."""
        self.run_async(STILL, element)
        return element

    def press(self, selector: Any, device: str = "mouse") -> None:
        """Press an element by mouse, Enter or tap; again if it was covered, or moved away because something arrived."""
        if device == "keyboard":
            self.pick(selector).send_keys(Keys.ENTER)
            return
        for _ in range(TRIES):
            if spot := self.run(SPOT, selector):
                pointer = self.actions(0)
                pointer.w3c_actions.pointer_action.move_to_location(*spot)
                pointer.click().perform()
                if self.run("return window.pressed !== 0"):
                    return
            time.sleep(0.02)
        raise AssertionError(f"{selector} is hidden, covered, or never where it was a moment ago")

    def select(self, name: str, value: str) -> None:
        assert self.run(CHOOSE, f"#{name}", value), f"{name} does not offer {value}"

    def unfold(self, *names: str) -> None:
        for name in names:
            self.run(f"{OPEN} e.open = true", f"#{name}")

    def type_into(self, name: str, entry: str) -> None:
        self.enter(f"#{name}", entry)

    def enter(self, selector: str, entry: str) -> None:
        """Focus a field, replace its text at once, and press the keys from the first special key of the entry."""
        text, keys = re.fullmatch("([^\t\ue000-\uf8ff]*)(.*)", entry).groups()
        self.run(REPLACE, selector)
        if text:
            self.cdp("Input.insertText", {"text": text})
        if keys:
            self.actions(0).send_keys(keys.replace("\t", Keys.TAB)).perform()

    def actions(self, duration: int = 250) -> ActionChains:
        return ActionChains(self.browser, duration=duration)

    def drag(self, element: Any, dx: float, dy: float, begin: tuple[float, float] = (0, 0)) -> None:
        chain = self.actions(50).move_to_element_with_offset(self.centre(element), *begin)
        chain.click_and_hold().move_by_offset(dx, dy).release().perform()

    def saved(self, name: str, button: str = "", device: str = "mouse") -> bytes:
        """Return a downloaded file, after a press of its button if a selector is passed."""
        file, end = self.downloads / name, time.monotonic() + PATIENCE
        if button:
            file.unlink(missing_ok=True)
            self.press(button, device)
        while not (file.exists() and file.stat().st_size):
            note = self.run("return document.getElementById('export-note')?.textContent")  # keeps the page awake too
            assert time.monotonic() < end, f"{name} was not saved: {note}"
            time.sleep(0.02)
        return file.read_bytes()

    def middle_of(self, element: Any) -> tuple[float, float]:
        script = "const f = arguments[0].getBoundingClientRect(); return [f.x + f.width / 2, f.y + f.height / 2]"
        return tuple(self.run(script, self.centre(element)))

    def touch(self, points: list[tuple[float, float]]) -> None:
        """Move a finger along points."""
        self.cdp("Emulation.setTouchEmulationEnabled", {"enabled": True})
        for k, (x, y) in enumerate(points):
            points = {"type": "touchMove" if k else "touchStart", "touchPoints": [{"x": x, "y": y}]}
            self.cdp("Input.dispatchTouchEvent", points)
        self.cdp("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
        self.cdp("Emulation.setTouchEmulationEnabled", {"enabled": False})

    def theme(self, name: str) -> None:
        if self.run("return document.documentElement.dataset.theme") != name:
            self.click("theme")

    def faults(self, within: str = "html") -> list[str]:
        """Return serious and critical findings of axe-core within a selector."""
        if not self.run("return Boolean(window.axe)"):
            self.run((ROOT / "tests/vendor/axe.min.js").read_text())
        found = self.run_async(SERIOUS, within)
        return [
            f"{row['id']}: {row['nodes'][0]['html'][:150]} {row['nodes'][0].get('failureSummary', '')[:200]}"
            for row in found["violations"]
            if row["impact"] in ("serious", "critical")
        ]

    def follow_link(self) -> None:
        """Copy the link, leave the page and open the link."""
        self.press("#link")
        self.wait("location.hash.length > 10")
        link = self.browser.current_url
        self.leave()
        self.browser.get(link)

    def record_requests(self) -> None:
        """Record request bodies from now on."""
        self.run(f"if (window.requests) window.requests = []; else {{ {RECORD} }}")

    def last_request(self) -> dict[str, Any]:
        """Return the body of the last request."""
        return self.run("return window.requests.at(-1)")


class MotionPage(Page):
    """The page of motions and paths."""

    def load(self, path: str = "", width: int = 1280) -> None:
        """Load the page with empty storage; without a path open the first machine of the gallery."""
        super().load(path, width)
        if not path:
            self.choose("casement")

    def choose(self, name: str) -> None:
        """Open a machine of the gallery and pause it."""
        self.run(f"document.querySelector('#gallery [data-example={name}]').click()")
        self.pause()

    def renew(self, machine: str = "") -> None:
        """Remove stubs and open a machine of the gallery if a name is passed."""
        self.resize(1280)
        self.run("window.stub = window.guided = null; window.restage?.()")
        self.run("for (const one of document.querySelectorAll('details')) one.open = false")
        if machine:
            self.choose(machine)

    def pause(self) -> None:
        """Pause the linkage at the first sample."""
        self.run(
            "const p = document.getElementById('play'), s = document.getElementById('slider');"
            "if (p.ariaLabel === 'Pause') p.click(); s.value = 0; s.dispatchEvent(new Event('input'))"
        )

    def slide(self, travel: float) -> None:
        script = "const s=document.getElementById('slider');s.value=arguments[0];s.dispatchEvent(new Event('input'))"
        self.run(script, travel)

    def mode(self, name: str) -> None:
        self.press(f"[data-mode={name}]")

    # -- the motion ---------------------------------------------------------------------------------------------------

    def table(self) -> list[list[float]]:
        return self.run(
            "return [...document.querySelectorAll('#poses tbody tr')]"
            ".map(row => [...row.querySelectorAll('input')].map(input => Number(input.value)))"
        )

    def positions(self) -> np.ndarray:
        """Positions of the table."""
        return np.array([row[1:3] for row in self.table()])

    def cell(self, name: str, *keys: str) -> None:
        """Type into a cell of the table."""
        self.enter(f"#poses [aria-label='{name}']", "".join(keys))

    def paste(self, rows: str) -> None:
        self.run(
            "const part = (name) => document.getElementById(name);"
            "part('paste').click(); part('paste-text').value = arguments[0]; part('paste-use').click()",
            rows,
        )
        self.wait("!document.getElementById('paste-use').disabled")

    def load_request(self, request: dict[str, Any]) -> None:
        self.paste(json.dumps(request))
        assert self.text("paste-error") == ""

    def request(self) -> dict[str, Any]:
        """The request as the page shows it."""
        self.unfold("request")
        self.wait("document.getElementById('request-text').textContent")
        return json.loads(self.text("request-text"))

    def limits(self) -> dict[str, Any]:
        return self.request().get("limits", {})

    def undo(self, redo: bool = False) -> None:
        keys = self.actions().key_down(Keys.CONTROL)
        keys = keys.key_down(Keys.SHIFT).send_keys("z").key_up(Keys.SHIFT) if redo else keys.send_keys("z")
        keys.key_up(Keys.CONTROL).perform()

    # -- the canvas ---------------------------------------------------------------------------------------------------

    def canvas(self) -> Any:
        return self.centre(self.find("canvas"))

    def click_canvas(self, *points: tuple[float, float]) -> None:
        canvas, chain = self.canvas(), self.actions(0)
        for x, y in points:
            chain.move_to_element_with_offset(canvas, x, y).click()
        chain.perform()

    def trace(self, points: list[tuple[float, float]], on: str = "canvas") -> None:
        """Drag along points, in pixels from the middle of the canvas, or of another part."""
        x, y = points[0]
        chain = self.actions(5).move_to_element_with_offset(self.centre(self.find(on)), x, y).click_and_hold()
        for u, v in points[1:]:
            chain.move_by_offset(u - x, v - y)
            x, y = u, v
        chain.release().perform()

    def draw(self, points: list[tuple[float, float]]) -> None:
        self.mode("path")
        self.trace(points)

    def view(self) -> tuple[float, float, float]:
        """Middle and scale of the canvas."""
        return tuple(map(float, self.find("canvas").get_attribute("data-view").split(" ")))

    def all_drawn(self) -> dict[str, complex]:
        """Return the drawn position of each joint in world coordinates, once the canvas is drawn at its present size."""
        self.wait(
            "(({ clientWidth, clientHeight, attributes }) => attributes.viewBox.value ==="
            " `0 0 ${clientWidth} ${clientHeight}`)(document.getElementById('canvas'))"
        )
        found, width, height, shown = self.run(
            "const s=document.getElementById('canvas'),f=s.getBoundingClientRect();"
            "const at=(one)=>{const c=one.getBoundingClientRect();"
            "return [c.x+c.width/2-f.x-s.clientLeft, c.y+c.height/2-f.y-s.clientTop]};"
            "return [Object.fromEntries([...s.querySelectorAll('[data-joint]')].map(one=>[one.dataset.joint, at(one)])),"
            "s.clientWidth, s.clientHeight, s.dataset.view.split(' ').map(Number)]"
        )
        (cx, cy, scale), middle = shown, complex(width, -height) / 2
        return {joint: complex(cx, cy) + (complex(x, -y) - middle) / scale for joint, (x, y) in found.items()}

    def drawn(self, joint: str) -> complex:
        return self.all_drawn()[joint]

    def in_view(self) -> bool:
        """Return true if all joints and poses lie inside the canvas."""
        return self.run(
            "const f = document.getElementById('canvas').getBoundingClientRect();"
            "return [...document.querySelectorAll('#canvas [data-joint], #canvas .dot')]"
            ".map((one) => one.getBoundingClientRect())"
            ".every((one) => one.left > f.left && one.right < f.right && one.top > f.top && one.bottom < f.bottom)"
        )

    # -- answers ------------------------------------------------------------------------------------------------------

    def solve(self) -> None:
        self.click("solve")
        self.wait(IDLE)
        self.pause()

    def budgets(self, *stages: float) -> None:
        """Set the budgets in milliseconds of the stages of a search until the page is loaded or renewed."""
        self.run_async(
            "const [stages, done] = arguments; import('/static/service.js').then(({ STAGES }) => {"
            "window.usual ??= [...STAGES]; STAGES.splice(0, STAGES.length, ...stages);"
            "window.restage = () => STAGES.splice(0, STAGES.length, ...window.usual); done(); })",
            stages,
        )

    def unhurried(self) -> None:
        """Search in a single stage to its end, so that the answer is the same on every machine."""
        self.budgets(30_000)

    def wait_for_results(self) -> None:
        """Wait for the first linkages and stop the search."""
        self.wait(f"{CARDS} && !document.getElementById('results').hidden")
        self.run("const s = document.getElementById('stop'); if (!s.hidden) s.click()")
        self.wait(IDLE)

    def solve_soon(self) -> None:
        self.run("document.getElementById('solutions').replaceChildren()")
        self.click("solve")
        self.wait_for_results()
        self.pause()

    def cards(self) -> list[Any]:
        return self.elements("#solutions button")

    def choose_card(self, k: int) -> None:
        """Select a card by a single call: cards are redrawn when their layers are known."""
        self.run("document.querySelectorAll('#solutions button')[arguments[0]].click()", k)

    def links(self) -> list[float]:
        """Lengths of the four links of the selected solution, from the table of numbers."""
        rows = "[...document.querySelectorAll('#numbers tr')].map((row) => [row.cells[0].textContent, row.cells[1].title])"
        found = dict(self.run(f"return {rows}"))
        return [float(found[name].split()[0]) for name in ("Crank", "Coupler", "Rocker", "Ground")]

    def card(self) -> str:
        """Return the text of the selected card."""
        return self.read("#solutions [aria-pressed=true]")

    def outdated(self) -> bool | None:
        """Return true if all visible cards are marked as results of an earlier request, false if none is, None without cards."""
        script = (
            "document.getElementById('tab-choose').click();"
            "return [...document.querySelectorAll('[data-earlier]')].filter((one) => one.closest('.card').checkVisibility())"
            ".map((one) => one.checkVisibility())"
        )
        (all_of_them,) = set(self.run(script)) or {None}
        return all_of_them

    def solve_with_reply(self, request: dict[str, Any], angles: Any, verdicts: Any = VERDICTS) -> None:
        """Load a request and solve it with a stub."""
        self.load_request(request)
        self.stub(request, angles, verdicts)
        self.solve()

    def stub(self, request: dict[str, Any], angles: Any, verdicts: Any = VERDICTS) -> None:
        """Reply to the next requests with `FREE` at some crank angles, repeated for each verdict."""
        turned = (0.3, 0.5) if "rotation" in request else (None, None)
        errors = {"rotation_rms": turned[0], "rotation_max": turned[1], "position_rms": 0.4, "position_max": 0.9}
        solution = FREE.to_dict() | {"errors": errors | {"objective": 0.01}, "crank_angle": list(map(float, angles))}
        solution |= {"transmission_angle_min": 40.0, "transmission_angle_min_turn": 33.0, "excursion": 1.02}
        solution |= {"source": "refined", "type": None, "family": FREE.family, "sensitivity": None, "rounded": None}
        determination = {"ill_posed": False, "resolution": 1e-3, "length_uncertainty": [0, 0, 0, 0]}
        solution |= {"determination": determination}
        report = {"elapsed_ms": {"total": 70.0}, "trace": [[20, 0.1], [60, 0.01]], "stopped_by": "converged"}
        reply = {
            "status": "closest",
            "solutions": [solution | {"rank": k + 1, "verdict": verdict} for k, verdict in enumerate(verdicts)],
            "report": report | {"length_scale": 30.0, "seeds": 9, "windows": None, "exhaustive": None, "notes": []},
        }
        self.run(f"window.stub = arguments[0]; if (!window.requests) {{ {RECORD} }}", reply)
