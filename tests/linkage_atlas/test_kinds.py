"""Requests for several kinds of mechanism return solutions side by side, ranked by the same rule.

A kind that hides a better kind, or a drive that cannot move the linkage, would show here.
"""

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of, ticking
from tests.linkage_atlas.test_assembly import by_layers
from tests.oracles.guided import random_motion

_FREE = {"timing": "free", "limits": {"preset": "none"}}
_FOUR = {"rotation": [0, 20, 50, 85], "position": [[0, 0], [100, 20], [180, 70], [220, 150]]}
_FLAP = {
    "rotation": [0, 12, 28, 46, 64, 80, 90],
    "position": [[0, 0], [20, 60], [60, 115], [115, 155], [180, 175], [250, 170], [315, 145]],
}


def beats(solution, second, layers=lambda _: 0) -> bool:
    """Return true if a solution with the same drive is as good in all measures and better in at least one of them."""
    pairs = [
        (max(solution.errors.objective, 1e-10), max(second.errors.objective, 1e-10)),
        (solution.size, second.size),
        (-solution.transmission_angle_min, -second.transmission_angle_min),
        (layers(solution), layers(second)),
    ]
    return solution.driver == second.driver and all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def test_the_one_rail_and_slot_of_four_poses():
    found = la.synthesize(**_FOUR, **_FREE, mechanisms=["rail_slot"], driver="slider")
    best = found.best
    assert found.status == "reached"
    assert (best.kind, best.driver) == ("rail_slot", "slider")
    assert best.errors.objective < 1e-9
    assert best.travel is not None and len(best.travel) == 4
    # its own numbers lead the body through the poses, also where its travel is given
    repeated = la.Linkage.from_dict(best.to_dict()).joints(best.travel)
    assert np.allclose(repeated.body_point, _FOUR["position"], atol=1e-7)
    assert np.allclose(repeated.rotation, _FOUR["rotation"], atol=1e-7)
    timed = la.synthesize(**_FOUR, travel=best.travel, mechanisms="all", driver="slider")
    assert timed.status == "reached"
    assert any(linkage.kind == "rail_slot" and np.allclose(linkage.travel, best.travel) for linkage in timed)


def test_no_solution_beats_another_that_is_driven_alike():
    found = la.synthesize(**_FLAP, timing="free", mechanisms=["four_bar", "slider_crank", "rail_slot"])
    assert {linkage.kind for linkage in found} >= {"four_bar", "slider_crank"}
    assert [solution.rank for solution in found] == list(range(1, len(found) + 1))
    assert not any(beats(solution, second) for solution in found for second in found if not second.has_smallest_error)
    assert all(solution.transmission_angle_min > 35 - 1e-6 for solution in found)


PREFERRED = [("size", "slider_crank"), ("transmission", "swinging_block"), ("crank_span", "swinging_block")]


@pytest.mark.parametrize(("prefer", "kind"), some_of(PREFERRED, 1))
def test_what_is_preferred_is_searched_for_among_all_kinds(prefer, kind):
    """Beyond what the search for the least error leaves: within a tenth of it, and better; no less swing is to be had."""
    casement = {
        "rotation": [0, 15, 30, 45, 60, 75, 90],
        "position": [[0, 0], [28, 75], [77, 141], [141, 194], [215, 232], [297, 253], [380, 260]],
    }

    def measure(solution):
        swing = np.ptp(solution.crank_angle)
        return {"size": solution.size, "transmission": -solution.transmission_angle_min, "crank_span": swing}[prefer]

    request = casement | {"timing": "free", "mechanisms": [kind], "driver": "crank"}
    plain, better = la.synthesize(**request), la.synthesize(**request, prefer=prefer)
    smallest = plain.best.errors.objective
    assert better.best.errors.objective <= 1.1 * smallest * (1 + 1e-6)
    known = min(measure(solution) for solution in plain if solution.errors.objective <= 1.1 * smallest)
    assert measure(better.best) <= known - (0.0 if prefer == "crank_span" else 0.02 * abs(known))


_TURNED = {"rotation": [0, 15, 40, 70], "position": [[0, 0], [40, 8], [75, 30], [90, 60]], "timing": "free"}


@pytest.mark.parametrize("motion", some_of([_FOUR | {"travel_span": 200}, _FOUR | {"timing": "free"}, _TURNED], 1))
def test_layers_are_preferred_among_all_kinds(motion):
    """Among linkages that are near: first the free layers over whose fixed pivots no link passes."""
    plain = la.synthesize(**motion, mechanisms="all", assembly=True)
    found = la.synthesize(**motion, mechanisms="all", prefer="layers")
    smallest = min(solution.errors.objective for solution in plain)
    close = [solution for solution in found if solution.errors.objective <= 1.1 * max(smallest, 1e-10)]
    keys = [by_layers(solution) for solution in close]
    assert keys == sorted(keys) and keys
    assert keys[0] == min(
        by_layers(solution) for solution in plain if solution.errors.objective <= 1.1 * max(smallest, 1e-10)
    )
    assert len({linkage.kind for linkage in found}) > 2
    assert not any(
        beats(solution, second, by_layers) for solution in close for second in close if not second.has_smallest_error
    )


SEVERAL = ["slider_crank", "swinging_block", "rail_slot", "two_rails"]


@pytest.mark.parametrize("mechanisms", some_of([SEVERAL, "all"], 1), ids=len)
def test_what_turns_about_a_pin_is_driven_by_what_moves_and_made_by_no_kind_that_cannot(mechanisms):
    """About a fixed point: a cylinder on it would have no stroke, and two rails would miss the motion by most of its size."""
    turned = np.deg2rad(angles := [0, 20, 40, 60, 80])
    position = np.round(100 * np.stack([np.cos(turned), np.sin(turned)], axis=1), 4)
    found = la.synthesize(rotation=angles, position=position, timing="free", mechanisms=mechanisms)
    assert len(found) >= 5
    for linkage in found:
        assert linkage.errors.objective < 0.1
        if linkage.kind != "four_bar":
            drive = linkage.crank_angle if linkage.travel is None else linkage.travel
            assert np.ptp(drive) > 0.1
            # a slot that slides no way is a pin
            strokes = [np.ptp(guide.used) for guide in linkage.linkage.guides if hasattr(guide, "used")]
            assert min(strokes) > 0.05
            off = np.linalg.norm(linkage.linkage.joints(drive).body_point - position, axis=1)
            assert np.max(off) == pytest.approx(linkage.errors.position_max, abs=1e-6)


def test_a_motion_that_is_small_beside_its_length_scale_comes_back() -> None:
    """Almost only the rotations count, and the positions decide between the guides that allow them."""
    crank = 20 * np.exp(1j * np.deg2rad(np.linspace(20, 140, 12)))
    rod = np.sqrt(60**2 - (crank.imag - 5) ** 2) + 1j * (5 - crank.imag)
    position = crank + 0.6 * rod * np.exp(0.4j)
    request = {"position": position, "timing": "free", "length_scale": 1000, "limits": {"preset": "none"}}
    found = la.synthesize(np.rad2deg(np.angle(rod)), **request, mechanisms=["slider_crank"], top=1)
    assert found.best.errors.position_max < 1e-8


SEEDS = [(kind, seed) for seed in range(2) for kind in ("slider_crank", "swinging_block")]


@pytest.mark.parametrize(("kind", "seed"), some_of(SEEDS, 2))
def test_positions_alone_find_the_linkage_that_made_them(kind, seed):
    _, position, _ = random_motion(np.random.default_rng(seed), kind, 10)
    found = la.synthesize(position=position, **_FREE, mechanisms=[kind])
    assert {linkage.kind for linkage in found} <= {kind}
    best = found.best
    drive = best.crank_angle if best.travel is None else best.travel
    off = np.linalg.norm(best.linkage.joints(drive).body_point - np.c_[position.real, position.imag], axis=1)
    assert np.max(off) == pytest.approx(best.errors.position_max, abs=1e-9 * np.ptp(position.real))
    assert best.errors.objective < 1e-8


def test_round_a_closed_way_goes_only_what_turns():
    t = 2 * np.pi * np.arange(8) / 8
    position = np.exp(1j * t) + 0.15 * np.exp(-2j * t)
    found = la.synthesize(position=np.c_[position.real, position.imag], timing="free", closed=True, mechanisms="all")
    assert {solution.driver for solution in found} <= {"crank", "hinge"} and len(
        {linkage.kind for linkage in found}
    ) > 1
    for solution in found:
        assert solution.linkage.turns_fully
    request = {"position": np.c_[position.real, position.imag], "timing": "free", "closed": True}
    with pytest.raises(la.FieldError, match=r"turns fully"):
        la.synthesize(**request, mechanisms=["two_rails"])
    assert {linkage.kind for linkage in la.synthesize(**request, mechanisms=["two_rails", "four_bar"])} == {
        "four_bar"
    }


def test_why_nothing_goes_round_is_said_at_once() -> None:
    turn = np.linspace(0, 2 * np.pi, 18, endpoint=False)
    oval: dict = {"position": np.c_[80 * np.cos(turn), 40 * np.sin(turn)], "timing": "free", "closed": True}
    with pytest.raises(la.FieldError, match="turns fully"):  # its slot never passes the rail's direction
        la.synthesize(**oval, mechanisms=["rail_slot"])
    still = la.synthesize(**oval, rotation=10 * np.sin(turn), mechanisms=["two_slots"])
    assert still.status == "infeasible" and "returns without a full turn" in still.report.notes[-1]
    round_once = la.synthesize(**oval, rotation=np.rad2deg(turn), mechanisms=["slider_crank"])
    assert round_once.status == "infeasible" and "makes a full turn" in round_once.report.notes[-1]


def test_alternatives_to_an_exact_linkage_are_sought_as_long_again_unless_a_budget_is_given() -> None:
    crank = 40 * np.exp(1j * np.deg2rad(np.linspace(20, 110, 8)))
    rod = np.sqrt(100**2 - (crank.imag - 10) ** 2) + 1j * (10 - crank.imag)
    angle = np.rad2deg(np.angle(rod))
    point = crank + 0.6 * rod
    found = {}
    for budget in (None, 10):
        found[budget] = la.synthesize(
            rotation=angle - angle[0],
            position=np.column_stack([point.real, point.imag]),
            timing="free",
            mechanisms="slider_crank",
            budget=budget,
            work=ticking(1e-3),
        )
    short, long = found.values()
    known = next(time for time, objective in short.report.trace if objective < 1e-9)
    assert short.status == "reached" and short.report.stopped_by == "tolerance"
    assert short.report.elapsed_ms["total"] < known + max(20, known) + 100
    assert long.report.elapsed_ms["total"] > 3 * short.report.elapsed_ms["total"]
