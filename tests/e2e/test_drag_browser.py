"""The selected linkage follows the hand: it is refined in the browser, keeps its kind, and returns with the motion.

A drag that exchanges or loses the linkage, or leaves an error that the service would not leave, shows here.
"""

import json

import numpy as np
import pytest
from selenium.webdriver.common.keys import Keys

import linkage_atlas as la
from tests.e2e.page import EXAMPLES
from tests.oracles.guided_cases import DRIVES, good_linkage

MOVED = "document.getElementById('status').textContent.startsWith('Moved with the motion')"
DRAGGED = {
    "a pose": "[data-pose='4'] .hit",
    "the arm of a pose": "[data-pose='0'] circle.turner",
    "a pivot": "#canvas [data-joint=a]",
    "a corner of the pivot box": "[data-corner='0 3']",
}


def hold(page, selector: str, *steps: tuple[float, float]) -> None:
    """Press a part of the canvas and move the pointer, without release."""
    chain = page.actions(50).move_to_element(page.centre(page.pick(selector))).click_and_hold()
    for step in steps:
        chain.move_by_offset(*step)
    chain.perform()


def title(page) -> str:
    """Kind or family on the selected card."""
    return page.card().splitlines()[0].split(" ", 1)[1].split(" · ")[0]


def test_the_linkage_follows_what_is_dragged_and_returns(shared) -> None:
    for part, selector in DRAGGED.items():
        shared.choose("pick")
        joints, links, kind = shared.all_drawn(), shared.links(), title(shared)
        hold(shared, selector, (9, -7), (9, -7))
        shared.wait("[...document.querySelectorAll('[data-earlier]')].some((one) => one.checkVisibility())")
        held = shared.all_drawn()
        assert any(abs(held[name] - joints[name]) > 1 / shared.view()[2] for name in "abcd"), f"{part}, at once"
        shared.actions(0).release().perform()
        shared.wait(MOVED)
        assert shared.outdated() is False
        assert title(shared) == kind and shared.links() != links, part
        assert shared.links() == pytest.approx(links, rel=0.3), f"the same linkage after {part}, somewhat changed"
        shared.click("undo")
        assert shared.links() == pytest.approx(links, rel=1e-6), part
    for name in ("wiper", "carton"):
        shared.choose(name)
        links, status = shared.links(), shared.text("status")
        hold(shared, DRAGGED["a pose"], (30, -20), (25, 15))
        shared.actions(50).move_by_offset(-55, 5).release().perform()
        shared.wait(f"document.getElementById('status').textContent === {json.dumps(status)}")
        assert shared.links() == pytest.approx(links, rel=1e-6) and shared.outdated() is False


def test_the_linkage_follows_arrow_keys_and_numbers_in_the_table(shared) -> None:
    shared.choose("carton")
    links, kind, (_, x, *_) = shared.links(), title(shared), shared.table()[4]
    shared.pick("[data-pose='4']").send_keys(Keys.ARROW_RIGHT)
    shared.wait(MOVED)
    moved = shared.links()
    assert moved != links and title(shared) == kind
    shared.cell("Pose 5, x", str(x + 4), Keys.TAB)
    shared.wait(f"{MOVED} && document.getElementById('numbers').textContent.length")
    shared.cell("Pose 5, x", str(x), Keys.TAB)
    shared.wait("!document.getElementById('status').textContent.startsWith('Moved')")
    assert shared.links() == pytest.approx(links, rel=1e-6)


def test_a_better_linkage_is_offered_beside_the_one_that_was_moved(shared) -> None:
    example = next(item for item in EXAMPLES if item["name"] == "carton")
    shared.choose("carton")
    shared.stub(example["request"], [0.0] * len(example["request"]["position"]))
    shared.drag(shared.pick(DRAGGED["a pose"]), 40, -30)
    shared.wait("document.getElementById('status').textContent.includes('A better linkage was found')")
    assert "Moved" in shared.card() and len(shared.cards()) > 1
    links = shared.links()
    shared.run(
        "[...document.querySelectorAll('#solutions button')].find((one) => one.innerText.includes('better')).click()"
    )
    assert shared.links() != links and "better" in shared.card()


def refined() -> list[dict]:
    """Linkages with their motion, a changed motion, and the error after a refinement in Python."""
    random, cases = np.random.default_rng(60), []

    def add(before: dict, solution: dict, after: dict) -> None:
        fields = {name: value for name, value in after.items() if name not in ("top", "diverse", "limits")}
        motion = la.Motion(**fields)
        found = la.synthesize(motion, after.get("limits"), start_from=[solution], refine_only=True, top=1)
        objective = found.best.errors.objective
        cases.append({"before": before, "solution": solution, "after": after, "objective": objective})

    for example in EXAMPLES:
        request = example["request"]
        positions = np.array(request["position"], dtype=float)
        direction = np.exp(1j * random.uniform(0, 2 * np.pi))
        shift = 0.1 * np.ptp(positions, axis=0).max() * np.array([direction.real, direction.imag])
        positions[random.integers(1, len(positions))] += shift
        add(request, example["reply"]["solutions"][0], request | {"position": positions.tolist()})
    for drive in DRIVES:
        linkage = good_linkage(random, drive, 0.0, 1.0, 0.5)
        travel = np.linspace(0, 1, 3)
        body = linkage.body(linkage.start + travel)
        positions = np.stack([body.position.real, body.position.imag], axis=1)
        request = {"position": positions.tolist(), "rotation": np.rad2deg(body.rotation).tolist(), "timing": "free"}
        request["limits"] = {"preset": "none", "family": "any"}
        solution = la.Linkage.of(linkage, np.pi / 180, None).to_dict()
        solution["crank_angle" if drive[1].turns else "travel"] = (
            (np.rad2deg(1) if drive[1].turns else 1.0) * travel
        ).tolist()
        positions[1] += 0.02 * np.ptp(positions, axis=0).max()
        add(request, solution, request | {"position": positions.tolist()})
    return cases


FOLLOW = """
const [cases, done] = arguments;
Promise.all(["follow", "formats", "hand"].map((name) => import(`/static/${name}.js`)))
.then(([{followed}, {fromRequest}, {measured}]) => {
  done(cases.map(({before, solution, after}) => {
    let last = null;
    for (const made of followed(fromRequest(after), solution, {solution, motion: fromRequest(before)})) last = made;
    return measured(last(), fromRequest(after)).solution;
  }));
});
"""


def test_refinement_in_the_browser_agrees_with_pythons(shared) -> None:
    """Python recomputes the same errors, and its own refinement leaves errors of about the same size."""
    cases = refined()
    ratios = []
    for case, solution in zip(cases, shared.run_async(FOLLOW, cases)):
        request, errors = case["after"], solution["errors"]
        drive = solution.get("crank_angle") or solution.get("travel") or request.get("crank_angle")
        if drive is None:
            drive = np.linspace(0, request["crank_span"], len(request["position"])) * request.get("direction", 1)
        away = la.Linkage.from_dict(solution).joints(drive).body_point - np.array(request["position"])
        assert np.sqrt((away**2).sum(axis=1).mean()) == pytest.approx(errors["position_rms"], rel=1e-6, abs=1e-9)
        assert solution["branch"] == case["solution"]["branch"]
        assert solution.get("family") == case["solution"].get("family", solution.get("family"))
        ratios.append((errors["objective"] + 1e-9) / (case["objective"] + 1e-9))
    assert np.median(ratios) < 1.02 and np.mean(np.array(ratios) < 1.15) > 0.9
    assert max(ratios) < 3, "another local minimum"
