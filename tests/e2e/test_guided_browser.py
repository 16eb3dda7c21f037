"""Linkages with rails and slots in the page: drawn, moved, judged, saved, and changed by hand."""

import json
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest

from app.query import plain_of
from tests.e2e.page import FREE, IDLE
from tests.linkage_atlas.test_guided import reply_of
from tests.oracles.guided_cases import DRIVES, NAMES

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
    page.take(request_of(motion))
    page.solve()
    return solution, motion


def driven(indices: Iterable[int], default: int) -> list[Any]:
    """Drives at some places of the list; the default run takes the first so many."""
    wide = [pytest.mark.wide]
    return [pytest.param(DRIVES[k], id=NAMES[k], marks=wide * (n >= default)) for n, k in enumerate(indices)]


@pytest.mark.parametrize("drive", driven(range(1, len(DRIVES)), 3))
def test_a_linkage_is_drawn_moved_and_described(standing, drive) -> None:
    page = standing
    solution, _ = solved(page, drive, analysis={"crank_speed": 10, "load": {"force": [0, -5]}})
    half_pixel = 0.6 / page.view()[2]
    joints = solution.linkage.joints(0)
    assert abs(page.drawn("p") - complex(*joints.body_point[0])) < half_pixel
    sorts = [guide.guide for guide in solution.guides]
    words = page.text("numbers")
    for sort in set(sorts):
        assert sort in words
    assert solution.driver in words and "Moment arm, least" in words
    legend = page.text("legend")
    assert ("rail" in legend, "slot" in legend) == ("rail" in sorts, "slot" in sorts)
    assert ("crank" in legend) == ("circle" in sorts) and "rocker" not in legend and "ground" not in legend
    travel = solution.travel if solution.travel is not None else solution.crank_angle
    page.slide(abs(travel[-1]))
    there = solution.linkage.joints(travel[-1])
    assert abs(page.drawn("p") - complex(*there.body_point[0])) < 2 * half_pixel
    assert ("°" in page.value("travel")) == (solution.travel is None)


@pytest.mark.parametrize("drive", driven(range(1, len(DRIVES), 3), 2))
def test_guides_are_changed_by_hand(standing, drive) -> None:
    page = standing
    solution, _ = solved(page, drive)
    page.mode("hand")
    before = page.text("joints-note")
    x = float(page.value("joint-b-x"))
    page.type_into("joint-b-x", f"{x + 2:.3f}\t")
    assert page.card().startswith("By hand")
    assert page.text("joints-note") != before and "Off by at most" in page.text("joints-note")
    if solution.guides[1].guide != "rail":  # whose joint is an end of the part that is used, which has changed too
        assert page.drawn("b").real == pytest.approx(x + 2, abs=1.2 / page.view()[2])
    assert page.count("#refine-here") == 0, "the service refines four-bars only"


def test_the_page_asks_for_all_kinds_and_lists_several(standing) -> None:
    page = standing
    position = [[0, 0], [22, 5], [41, 17], [50, 58]]
    page.take({"position": position, "rotation": [0, 12, 27, 66], "timing": "free", "mechanisms": "all"})
    page.unfold("limits")
    page.unhurried()
    assert page.value("mechanisms") == "all" and page.request()["mechanisms"] == "all"
    page.click("solve")
    page.wait(IDLE)
    names = page.texts("#solutions .name")
    assert len({name.split(". ", 1)[1] for name in names}) >= 3, names
    page.select("mechanisms", "two_rails")
    assert page.request()["mechanisms"] == ["two_rails"]
    page.select("mechanisms", "four_bar")
    assert "mechanisms" not in page.request()


@pytest.mark.parametrize("drive", driven([1, 5], 1))
def test_files_and_sheet_of_a_linkage_with_a_rail(standing, drive) -> None:
    page = standing
    solution, _ = solved(page, drive)
    assert b"<mujoco" in page.saved("linkage-1.xml", "[data-format=mjcf]")
    assert b"AcDb" in page.saved("linkage-1.dxf", "[data-format=dxf]")
    assert page.one("[data-format=pylinkage]").get_attribute("disabled")
    page.run("dispatchEvent(new Event('beforeprint'))")
    sheet = page.run("return document.getElementById('sheet').textContent")
    assert solution.driver in sheet and "First guide" in sheet


def test_the_worst_pose_is_told_whole_on_a_narrow_canvas(standing) -> None:
    page = standing
    page.resize(320, 700)
    solved(page, DRIVES[1])
    rectangles = page.run(
        "const inside = document.getElementById('canvas').getBoundingClientRect();"
        "const lines = [...document.querySelectorAll('.miss-note tspan')];"
        "return lines.map((one) => one.parentNode.getBoundingClientRect().left - inside.left)"
    )
    assert len(rectangles) == 2 and min(rectangles) > 0


def test_links_of_any_kind_are_rounded_and_driven_by_their_names(standing) -> None:
    # a slider-crank has two links to round; the reason is shown if none of its lengths closes
    page = standing
    page.run("window.guided = null")
    page.unhurried()
    request = {
        "position": [[0, 0], [-60, 40], [-150, 50], [-230, 20]],
        "rotation": [0, -35, -80, -120],
        "round_to": 25,
    }
    page.take({**request, "timing": "free", "mechanisms": ["slider_crank"]})
    page.solve()
    sentence = re.search(r"With rounded links: (\S+ mm, \S+°)\.", page.text("status"))
    assert sentence and sentence[1] in page.card()
    assert re.search(
        r"Rounded links\s+crank \d+, coupler \d+ mm\s+Error when rounded\s+" + sentence[1], page.text("numbers")
    )
    page.choose_card(1)
    assert "none of the lengths tried closes" in page.text("numbers")
    page.take({**request, "timing": "free", "mechanisms": ["swinging_block"]})
    page.solve()
    assert "With rounded links: exact." in page.text("status")
    standing.renew()
    page = standing
    page.run("window.guided = null")
    page.unhurried()
    request = {"position": [[0, 1.1], [0.25, 1.6], [0.9, 2.1]], "rotation": [90, 60, 0], "timing": "free"}
    page.take({**request, "mechanisms": ["two_slots"], "top": 1})
    page.solve()
    page.select("drive-kind", "actuator")
    page.click("drive-find")
    page.wait("document.querySelectorAll('#drive-found button').length")
    sentence = page.text("drive-found") + page.text("drive-numbers")
    assert "on the second block" in sentence and "_" not in sentence


def test_what_is_rounding_alone_is_told_as_nothing(standing) -> None:
    """Coordinates, travel and prints of an exact linkage, and an error below 1e-10 of the extent, which counts as none."""
    page = standing
    page.run("window.guided = null")
    page.unhurried()
    request = {"position": [[0, 0], [80, 60], [180, 80]], "rotation": [0, -5, -12], "timing": "free"}
    page.take({**request, "mechanisms": ["rail_slot"], "top": 2})
    page.solve()
    page.mode("hand")
    page.run("window.dispatchEvent(new Event('beforeprint'))")
    shown = [page.value("joint-p-x"), page.value("joint-p-y"), page.text("travel"), page.content("sheet")]
    assert all(shown) and not any(re.search(r"\de-\d", text) for text in shown), shown
    page.mode("move")
    standing.renew()
    page = standing
    page.run("window.guided = null")
    positions = np.add(FREE.joints([0, 60, 120]).body_point, [[3e-10, 0], [0, 0], [0, 0]])
    page.answered({"position": positions.tolist(), "timing": "free"}, [0, 60, 120])
    assert page.text("status").startswith("Best found: met to within rounding")
