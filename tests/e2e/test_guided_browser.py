"""Linkages with rails and slots in the page: drawn, moved, judged, saved, and changed by hand."""

import json
import re

import numpy as np
import pytest

from app.query import plain_of
from tests.conftest import some_of
from tests.e2e.page import FREE, IDLE
from tests.linkage_atlas.test_guided import reply_of
from tests.oracles.guided_cases import DRIVES

ANSWERED = """
const whole = window.guided ? null : window.fetch;
window.guided = JSON.stringify(arguments[0]);
if (whole) window.fetch = (address, ...rest) => window.guided && String(address).endsWith("/v2/synthesize")
  ? Promise.resolve(new Response(window.guided, { headers: { "Content-Type": "application/json" } }))
  : whole(address, ...rest);
"""


def request_of(motion) -> dict:
    samples = motion.requested
    position = [[z.real, z.imag] for z in samples.position]
    return {
        "position": position,
        "rotation": np.rad2deg(samples.rotation).tolist(),
        "timing": "free",
        "diverse": False,
    }


def solved(page, drive, **studies):
    """The page with a solution of a drive, as the service would send it."""
    solution, motion = reply_of(drive, noise=0.01, **studies)
    report = {"elapsed_ms": {"total": 5.0}, "trace": [[5.0, solution.errors.objective]], "stopped_by": "converged"}
    report |= {"length_scale": motion.requested.length_scale, "seeds": 1, "notes": []}
    report |= dict.fromkeys(("windows", "exhaustive", "start_from_ranks"))
    reply = {"status": "closest", "solutions": [json.loads(json.dumps(plain_of(solution)))], "report": report}
    page.run(ANSWERED, reply)
    page.load_request(request_of(motion))
    page.solve()
    return solution, motion


@pytest.mark.parametrize("drives", some_of([DRIVES[1:4], DRIVES[4:]], 1))
def test_linkages_are_drawn_moved_and_changed_by_hand(shared, drives) -> None:
    for drive in drives:
        solution, _ = solved(shared, drive, analysis={"crank_speed": 10, "load": {"force": [0, -5]}})
        half_pixel = 0.6 / shared.view()[2]
        joints = solution.linkage.joints(0)
        assert abs(shared.drawn("p") - complex(*joints.body_point[0])) < half_pixel
        types = [guide.guide for guide in solution.guides]
        numbers, legend = shared.text("numbers"), shared.text("legend")
        assert all(guide_type in numbers for guide_type in types)
        assert solution.driver in numbers and "Moment arm, smallest" in numbers
        assert ("rail" in legend, "slot" in legend) == ("rail" in types, "slot" in types)
        assert ("crank" in legend) == ("circle" in types) and "rocker" not in legend and "ground" not in legend
        travel = solution.travel if solution.travel is not None else solution.crank_angle
        shared.slide(abs(travel[-1]))
        at_end = solution.linkage.joints(travel[-1])
        assert abs(shared.drawn("p") - complex(*at_end.body_point[0])) < 2 * half_pixel
        assert ("°" in shared.value("travel")) == (solution.travel is None)
        shared.mode("hand")
        before = shared.text("joints-note")
        x = float(shared.value("joint-b-x"))
        shared.type_into("joint-b-x", f"{x + 2:.3f}\t")
        assert shared.card().startswith("By hand")
        assert shared.text("joints-note") != before and "Largest errors" in shared.text("joints-note")
        if solution.guides[1].guide != "rail":  # the joint of a rail is an end of the used section, which has changed
            assert shared.drawn("b").real == pytest.approx(x + 2, abs=1.2 / shared.view()[2])
        assert shared.count("#refine-here") == 0, "the service refines four-bars only"


def test_the_page_asks_for_all_kinds_and_lists_several(shared) -> None:
    position = [[0, 0], [22, 5], [41, 17], [50, 58]]
    shared.load_request({"position": position, "rotation": [0, 12, 27, 66], "timing": "free", "mechanisms": "all"})
    shared.unfold("limits")
    shared.unhurried()
    assert shared.value("mechanisms") == "all" and shared.request()["mechanisms"] == "all"
    shared.click("solve")
    shared.wait(IDLE)
    names = shared.texts("#solutions .name")
    assert len({name.split(". ", 1)[1] for name in names}) >= 3, names
    shared.select("mechanisms", "two_rails")
    assert shared.request()["mechanisms"] == ["two_rails"]
    shared.select("mechanisms", "four_bar")
    assert "mechanisms" not in shared.request()


def test_files_and_sheet_of_a_linkage_with_a_rail(shared) -> None:
    solution, _ = solved(shared, DRIVES[1])
    assert b"<mujoco" in shared.saved("linkage-1.xml", "[data-format=mjcf]")
    assert b"AcDb" in shared.saved("linkage-1.dxf", "[data-format=dxf]")
    shared.run("dispatchEvent(new Event('beforeprint'))")
    sheet = shared.run("return document.getElementById('sheet').textContent")
    assert solution.driver in sheet and "First guide" in sheet


def test_links_of_any_kind_are_rounded_and_driven_by_their_names(shared) -> None:
    # a slider-crank has two links to round; the reason is shown if none of its lengths closes
    shared.run("window.guided = null")
    shared.unhurried()
    request = {
        "position": [[0, 0], [-60, 40], [-150, 50], [-230, 20]],
        "rotation": [0, -35, -80, -120],
        "round_to": 25,
    }
    shared.load_request({**request, "timing": "free", "mechanisms": ["slider_crank"]})
    shared.solve()
    sentence = re.search(r"With rounded links: (\S+ mm, \S+°)\.", shared.text("status"))
    assert sentence and sentence[1] in shared.card()
    assert re.search(
        r"Rounded links\s+crank \d+, coupler \d+ mm\s+Error when rounded\s+" + sentence[1], shared.text("numbers")
    )
    shared.choose_card(1)
    assert "none of the lengths that were tried closes" in shared.text("numbers")
    shared.load_request({**request, "timing": "free", "mechanisms": ["swinging_block"]})
    shared.solve()
    assert "With rounded links: exact." in shared.text("status")
    shared.renew()
    shared.run("window.guided = null")
    shared.unhurried()
    request = {"position": [[0, 1.1], [0.25, 1.6], [0.9, 2.1]], "rotation": [90, 60, 0], "timing": "free"}
    shared.load_request({**request, "mechanisms": ["two_slots"], "top": 1})
    shared.solve()
    shared.select("drive-kind", "actuator")
    shared.click("drive-find")
    shared.wait("document.querySelectorAll('#drive-found button').length")
    sentence = shared.text("drive-found") + shared.text("drive-numbers")
    assert "on the second block" in sentence and "_" not in sentence


def test_linkages_of_any_kind_are_shown_without_rounding_errors(shared) -> None:
    """Coordinates, travel and prints of an exact linkage, and an error below 1e-10 of the extent, which counts as none."""
    shared.run("window.guided = null")
    shared.unhurried()
    request = {"position": [[0, 0], [80, 60], [180, 80]], "rotation": [0, -5, -12], "timing": "free"}
    shared.load_request({**request, "mechanisms": ["rail_slot"], "top": 2})
    shared.solve()
    shared.mode("hand")
    shared.run("window.dispatchEvent(new Event('beforeprint'))")
    shown = [shared.value("joint-p-x"), shared.value("joint-p-y"), shared.text("travel"), shared.content("sheet")]
    assert all(shown) and not any(re.search(r"\de-\d", text) for text in shown), shown
    shared.mode("move")
    shared.renew()
    shared.run("window.guided = null")
    positions = np.add(FREE.joints([0, 60, 120]).body_point, [[3e-10, 0], [0, 0], [0, 0]])
    shared.solve_with_reply({"position": positions.tolist(), "timing": "free"}, [0, 60, 120])
    assert shared.text("status").startswith("Best found: met to within rounding")
    shared.renew()
    shared.resize(320, 700)
    solved(shared, DRIVES[1])
    rectangles = shared.run(
        "const inside = document.getElementById('canvas').getBoundingClientRect();"
        "const lines = [...document.querySelectorAll('.miss-note tspan')];"
        "return lines.map((one) => one.parentNode.getBoundingClientRect().left - inside.left)"
    )
    assert len(rectangles) == 2 and min(rectangles) > 0
