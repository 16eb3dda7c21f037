"""Several kinds of mechanism in one request: what is refused, what comes back side by side; four-bars alone stay as they were."""

from itertools import count, pairwise

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.assemblies import assembled
from synthesis.work import OutOfTime
from tests.conftest import some_of
from tests.linkage_atlas.test_assembly import by_layers
from tests.oracles.guided import random_motion
from tests.oracles.largest import TWO_RAILS

_FREE = {"timing": "free", "limits": {"preset": "none"}}
_FOUR = {"rotation": [0, 20, 50, 85], "position": [[0, 0], [100, 20], [180, 70], [220, 150]]}
_FLAP = {
    "rotation": [0, 12, 28, 46, 64, 80, 90],
    "position": [[0, 0], [20, 60], [60, 115], [115, 155], [180, 175], [250, 170], [315, 145]],
}


def beats(one, other, layers=lambda _: 0) -> bool:
    """Whether a solution with the same drive is as good in all measures and better in one."""
    pairs = [
        (max(one.errors.objective, 1e-10), max(other.errors.objective, 1e-10)),
        (one.size, other.size),
        (-one.transmission_angle_min, -other.transmission_angle_min),
        (layers(one), layers(other)),
    ]
    return one.driver == other.driver and all(a <= b for a, b in pairs) and any(a < b for a, b in pairs)


def test_the_one_rail_and_slot_of_four_poses():
    found = la.synthesize(**_FOUR, **_FREE, mechanisms=["rail_slot"], driver="slider")
    best = found.best
    assert found.status == "reached"
    assert (best.kind, best.driver) == ("rail_slot", "slider")
    assert best.errors.objective < 1e-9
    assert best.travel is not None and len(best.travel) == 4
    # its own numbers lead the body through the poses, also where its travel is given
    again = la.Linkage.from_dict(best.to_dict()).joints(best.travel)
    assert np.allclose(again.body_point, _FOUR["position"], atol=1e-7)
    assert np.allclose(again.rotation, _FOUR["rotation"], atol=1e-7)
    timed = la.synthesize(**_FOUR, travel=best.travel, mechanisms="all", driver="slider")
    assert timed.status == "reached"
    assert any(one.kind == "rail_slot" and np.allclose(one.travel, best.travel) for one in timed)


def test_four_bars_alone_answer_as_ever():
    plain = la.synthesize(**_FLAP, timing="free", top=3)
    named = la.synthesize(**_FLAP, timing="free", top=3, mechanisms=["four_bar"])
    assert [one.to_dict() for one in plain] == [one.to_dict() for one in named]


def test_no_solution_beats_another_that_is_driven_alike():
    found = la.synthesize(**_FLAP, timing="free", mechanisms=["four_bar", "slider_crank", "rail_slot"])
    assert {one.kind for one in found} >= {"four_bar", "slider_crank"}
    assert [one.rank for one in found] == list(range(1, len(found) + 1))
    assert not any(beats(one, other) for one in found for other in found if not other.least_error)
    assert all(one.transmission_angle_min > 35 - 1e-6 for one in found)


PREFERRED = [("size", "slider_crank"), ("transmission", "swinging_block"), ("crank_span", "swinging_block")]


@pytest.mark.parametrize(("prefer", "kind"), some_of(PREFERRED, 1))
def test_what_is_preferred_is_searched_for_among_all_kinds(prefer, kind):
    """Beyond what the search for the least error leaves: within a tenth of it, and better; no less swing is to be had."""
    casement = {
        "rotation": [0, 15, 30, 45, 60, 75, 90],
        "position": [[0, 0], [28, 75], [77, 141], [141, 194], [215, 232], [297, 253], [380, 260]],
    }

    def measure(one):
        swing = np.ptp(one.crank_angle)
        return {"size": one.size, "transmission": -one.transmission_angle_min, "crank_span": swing}[prefer]

    asked = casement | {"timing": "free", "mechanisms": [kind], "driver": "crank"}
    plain, better = la.synthesize(**asked), la.synthesize(**asked, prefer=prefer)
    least = plain.best.errors.objective
    assert better.best.errors.objective <= 1.1 * least * (1 + 1e-6)
    known = min(measure(one) for one in plain if one.errors.objective <= 1.1 * least)
    assert measure(better.best) <= known - (0.0 if prefer == "crank_span" else 0.02 * abs(known))


_TURNED = {"rotation": [0, 15, 40, 70], "position": [[0, 0], [40, 8], [75, 30], [90, 60]], "timing": "free"}


@pytest.mark.parametrize("motion", some_of([_FOUR | {"travel_span": 200}, _FOUR | {"timing": "free"}, _TURNED], 1))
def test_layers_are_preferred_among_all_kinds(motion):
    """Of those that are near: first the free ones over whose fixed pivots nothing passes; none is beaten in that and all else."""
    plain = la.synthesize(**motion, mechanisms="all", assembly=True)
    found = la.synthesize(**motion, mechanisms="all", prefer="layers")
    least = min(one.errors.objective for one in plain)
    near = [one for one in found if one.errors.objective <= 1.1 * max(least, 1e-10)]
    keys = [by_layers(one) for one in near]
    assert keys == sorted(keys) and keys
    assert keys[0] == min(by_layers(one) for one in plain if one.errors.objective <= 1.1 * max(least, 1e-10))
    assert len({one.kind for one in found}) > 2
    assert not any(beats(one, other, by_layers) for one in near for other in near if not other.least_error)


@pytest.mark.parametrize("mechanisms", some_of([["four_bar", "two_rails"], "all"], 1), ids=len)
def test_of_several_kinds_those_with_free_layers_come_first(mechanisms):
    found = la.synthesize(**_FLAP, timing="free", mechanisms=mechanisms, assembly=True, top=20)
    free = [one.verdict.assembly.free for one in found if one.verdict.works]
    assert set(free) == {True, False} and free == sorted(free, reverse=True)


@pytest.mark.parametrize("mechanisms", [["slider_crank", "rail_slot"], "four_bar"], ids=len)
def test_layers_that_the_time_did_not_reach_are_said(monkeypatch, mechanisms):
    asked = _FOUR | {"timing": "free", "mechanisms": mechanisms, "prefer": "layers", "tolerances": {"position": 5}}
    calls: list = []

    def two_in_time(*given):
        calls.append(given)
        if len(calls) > 2:
            raise OutOfTime
        return assembled(*given)

    monkeypatch.setattr("linkage_atlas.preferences.assembled", two_in_time)
    found = la.synthesize(**asked)
    assert (found.report.stopped_by, len(calls)) == ("budget", 3)
    said = [note for note in found.report.notes if "layers of" in note]
    assert len(said) == 1 and "near enough" in said[0]
    if mechanisms == "four_bar":
        monkeypatch.undo()
        whole = la.synthesize(**asked)
        assert whole.report.stopped_by != "budget" and not any("near enough" in note for note in whole.report.notes)


def test_no_linkage_at_all_has_no_layers():
    boxed = {"pivot_a_box": [1e5, 1e5, 1.001e5, 1.001e5], "pivot_b_box": [-1e5, -1e5, -0.999e5, -0.999e5]}
    asked = {"timing": "free", "prefer": "layers", "limits": {**boxed, "link_max": 10}, "budget": 0.1}
    for mechanisms in (None, "all"):
        assert not la.synthesize(**_FOUR, **asked, mechanisms=mechanisms).solutions


SEVERAL = ["slider_crank", "swinging_block", "rail_slot", "two_rails"]


@pytest.mark.parametrize("mechanisms", some_of([SEVERAL, "all"], 1), ids=len)
def test_what_turns_about_a_pin_is_driven_by_what_moves_and_made_by_no_kind_that_cannot(mechanisms):
    """About a fixed point: a cylinder on it would have no stroke, and two rails would miss the motion by most of its size."""
    turned = np.deg2rad(angles := [0, 20, 40, 60, 80])
    position = np.round(100 * np.stack([np.cos(turned), np.sin(turned)], axis=1), 4)
    found = la.synthesize(rotation=angles, position=position, timing="free", mechanisms=mechanisms)
    assert len(found) >= 5
    for one in found:
        assert one.errors.objective < 0.1
        if one.kind != "four_bar":
            drive = one.crank_angle if one.travel is None else one.travel
            assert np.ptp(drive) > 0.1
            # a slot that slides no way is a pin
            strokes = [np.ptp(guide.used) for guide in one.linkage.guides if hasattr(guide, "used")]
            assert min(strokes) > 0.05
            off = np.linalg.norm(one.linkage.joints(drive).body_point - position, axis=1)
            assert np.max(off) == pytest.approx(one.errors.position_max, abs=1e-6)


def test_crank_angles_and_positions_alone_find_a_slider_crank():
    t = np.linspace(0.4, 2.0, 9)
    angle = np.arcsin((0.2 - np.sin(t)) / 2.5)
    place = np.exp(1j * t) + 0.8 * np.exp(1j * (angle + 0.5))
    found = la.synthesize(position=place, crank_angle=t - t[0], degrees=False, mechanisms=["slider_crank"])
    assert found.best.errors.objective < 1e-8


SEEDS = [(kind, seed) for seed in range(2) for kind in ("slider_crank", "swinging_block")]


@pytest.mark.parametrize(("kind", "seed"), some_of(SEEDS, 2))
def test_positions_alone_find_the_linkage_that_made_them(kind, seed):
    _, place, _ = random_motion(np.random.default_rng(seed), kind, 10)
    found = la.synthesize(position=place, **_FREE, mechanisms=[kind])
    assert {one.kind for one in found} <= {kind}
    best = found.best
    drive = best.crank_angle if best.travel is None else best.travel
    off = np.linalg.norm(best.linkage.joints(drive).body_point - np.c_[place.real, place.imag], axis=1)
    assert np.max(off) == pytest.approx(best.errors.position_max, abs=1e-9 * np.ptp(place.real))
    assert best.errors.objective < 1e-8


def test_round_a_closed_way_goes_only_what_turns():
    t = 2 * np.pi * np.arange(8) / 8
    place = np.exp(1j * t) + 0.15 * np.exp(-2j * t)
    found = la.synthesize(position=np.c_[place.real, place.imag], timing="free", closed=True, mechanisms="all")
    assert {one.driver for one in found} <= {"crank", "hinge"} and len({one.kind for one in found}) > 1
    for one in found:
        assert one.linkage.turns_fully
    asked = {"position": np.c_[place.real, place.imag], "timing": "free", "closed": True}
    with pytest.raises(la.FieldError, match=r"turns fully"):
        la.synthesize(**asked, mechanisms=["two_rails"])
    assert {one.kind for one in la.synthesize(**asked, mechanisms=["two_rails", "four_bar"])} == {"four_bar"}


def test_a_study_that_is_cut_down_says_so():
    study = {"links": 0.1, "samples": 100_000}
    found = la.synthesize(**_FOUR, timing="free", mechanisms=["two_slots"], tolerance_study=study, budget=0.3)
    assert found.best.tolerance_study.samples < 100_000
    assert any("instead of 100,000" in note for note in found.report.notes)


def test_what_is_driven_by_given_travel_is_found_from_many_samples_as_from_few():
    """Descents look at some of many samples; the answer is as exact on all of them."""
    rails = la.Linkage.from_dict(TWO_RAILS)
    travel = np.linspace(0, 50, 400) ** 1.1
    body = rails.joints(travel)
    asked = {"travel": travel - travel[0], "mechanisms": ["two_rails"], "limits": {"preset": "none"}}
    found = la.synthesize(body.rotation, body.body_point, **asked)
    assert found.status == "reached" and found.best.errors.objective < 1e-9


def test_in_any_order_angles_of_what_turns_lie_within_a_turn():
    found = la.synthesize(**_FLAP, timing="free", order="any", mechanisms=["slider_crank", "swinging_block"])
    angles = [one.crank_angle for one in found if one.crank_angle is not None]
    assert len(angles) >= 2
    for one, own in zip((one for one in found if one.crank_angle is not None), angles):
        assert np.all((own >= 0) & (own < 360))
        off = np.linalg.norm(one.linkage.joints(own).body_point - _FLAP["position"], axis=1)
        assert np.max(off) == pytest.approx(one.errors.position_max, abs=1e-6)


def test_why_nothing_goes_round_is_said_at_once() -> None:
    turn = np.linspace(0, 2 * np.pi, 18, endpoint=False)
    oval: dict = {"position": np.c_[80 * np.cos(turn), 40 * np.sin(turn)], "timing": "free", "closed": True}
    with pytest.raises(la.FieldError, match="turns fully"):  # its slot never passes the rail's direction
        la.synthesize(**oval, mechanisms=["rail_slot"])
    still = la.synthesize(**oval, rotation=10 * np.sin(turn), mechanisms=["two_slots"])
    assert still.status == "infeasible" and "comes back without a full turn" in still.report.notes[-1]
    round_once = la.synthesize(**oval, rotation=np.rad2deg(turn), mechanisms=["slider_crank"])
    assert round_once.status == "infeasible" and "makes a full turn" in round_once.report.notes[-1]


@pytest.mark.parametrize("turned", some_of([True, False], 1))
def test_what_two_slots_draw_round_a_turn_is_found(turned) -> None:
    """The sides of an angle of 60 degrees of the body slide through two pins."""
    turn = np.linspace(0, 2 * np.pi, 18, endpoint=False)
    one, other = np.exp(1j * turn), np.exp(1j * (turn + np.pi / 3))
    corner = 40 * other.imag / (np.conj(one) * other).imag * one
    rotation = np.rad2deg(turn) if turned else None
    found = la.synthesize(rotation, corner + (30 + 10j) * one, **_FREE, closed=True, mechanisms=["two_slots"])
    assert found.status == "reached" and found.best.driver == "hinge"


def test_the_way_back_of_a_closed_way_counts_as_one_between_samples() -> None:
    """Half an oval: from the last sample back to the first the body point goes round the other half."""
    angle = np.linspace(0, np.pi, 7)
    position = np.c_[100 * np.cos(angle), 70 * np.sin(angle)].round(1)
    for one in la.synthesize(position=position, timing="free", closed=True, mechanisms=["swinging_block"]):
        turned = np.asarray(one.crank_angle)
        back = np.linspace(turned[-1], turned[0] + np.copysign(360, turned[-1]), 2000)
        places = np.asarray(one.linkage.joints(back).body_point)
        way, chord = np.hypot(*np.diff(places, axis=0).T).sum(), np.hypot(*(places[-1] - places[0]))
        assert one.excursion >= 0.99 * way / chord


def test_one_kind_may_be_named_without_a_list() -> None:
    poses = ([0, 20, 50, 85], [[0, 0], [100, 20], [180, 70], [220, 150]])
    found = la.synthesize(*poses, timing="free", mechanisms="rail_slot", top=1)
    assert found.best.kind == "rail_slot"
    with pytest.raises(la.FieldError, match="railslot") as refused:
        la.synthesize(*poses, timing="free", mechanisms="railslot")
    assert refused.value.field.startswith("/mechanisms")
    with pytest.raises(la.FieldError, match="start_from"):
        la.synthesize(*poses, timing="free", mechanisms="all", start_from=[la.FourBar(19, 72, 144, 165)])


@pytest.mark.parametrize("seeds", some_of([[0, 3], [0, 1, 2, 3]], 1), ids=len)
@pytest.mark.parametrize("preset", ["practical", "none"])
def test_a_cylinder_whose_length_passes_zero_is_no_practical_drive(preset: str, seeds: list[int]) -> None:
    passing = 0
    for seed in seeds:
        rng = np.random.default_rng(seed)
        count = 3 + seed % 3
        rotation = np.cumsum(rng.uniform(5, 25, count))
        motion = la.Motion(rotation, np.cumsum(rng.uniform(-30, 60, (count, 2)), axis=0), timing="free")
        kinds = ["swinging_block", "rail_slot", "two_slots"]
        found = la.synthesize(motion, la.Limits(preset=preset), mechanisms=kinds, driver="cylinder").solutions
        assert found
        for one in found:
            length = one.start + np.asarray(one.travel)
            passes = bool(length.min() * length.max() <= 0)
            told = [reason for reason in one.verdict.reasons if "length of its cylinder passes 0" in reason]
            assert bool(told) is passes
            assert not (passes and one.verdict.practical)
            passing += passes
    assert (passing > 0) is (preset == "none")


BEAN = [[-19, 151], [-53, 143], [-82, 123], [-100, 92], [-81, 78], [-52, 93], [-20, 103]]
BEAN += [[15, 106], [51, 100], [80, 109], [58, 136], [25, 149], [-9, 154]]
STAIRS = [[0, 0], [322, 1], [379, -6], [400, 73], [397, 128], [438, 306], [805, 303]]


@pytest.mark.parametrize(
    ("points", "closed", "readings"),
    some_of([(BEAN, True, (100, 200, None)), (STAIRS, False, (400, 500, None))], 1),
    ids=["cut off", "nearer"],
)
def test_more_time_only_adds_to_what_sliders_begin_with(points, closed, readings) -> None:
    """Along a path they begin with rotations of four-bars: a nearer one of these led to sliders three times as far off.

    So did one that a few rounds more led to, where the time had been up before these ended. By a clock that counts its
    readings, of which the whole searches take 2,066 and some 900; the first rounds of the four-bars some 200.
    """
    asked = la.Motion(None, points, closed=closed, timing="free")
    limits, found = la.Limits(preset="practical"), []
    for budget in readings:
        work = la.Work(budget, clock=count().__next__)
        one = la.synthesize(asked, limits, mechanisms="all", budget=budget, work=lambda _, work=work: work)
        found.append(one.solutions[0].errors.objective)
    assert all(more <= some * (1 + 1e-6) for some, more in pairwise(found))


FIVE = [[49.5, -23.7], [61.5, 49.5], [-30.2, 84.2], [-82.8, -1.6], [-23.0, -56.8]]
SEVEN = [[-90.9, -119.4], [0.6, -155.5], [94.1, -121], [138.6, -37.6], [120.5, 43.6], [68.4, 85.8], [20.5, 91.2]]
IN_STEP = [
    {"position": FIVE, "rotation": [-2.4, -9.1, -11.6, -16.0, -24.8], "crank_span": 194.6},
    {"position": SEVEN, "rotation": [-2.1, -9.7, -13.2, -21.9, -27.6, -33.8, -38.5], "crank_span": 115.4},
]
OF_KINDS = [*zip(IN_STEP + IN_STEP[::-1], ("slider_crank", "swinging_block") * 2)]


@pytest.mark.parametrize(("motion", "kind"), some_of(OF_KINDS, 2))
def test_without_limits_a_crank_in_step_is_met_no_worse_than_within_some(motion, kind) -> None:
    """Poses in step with a crank were called infeasible where nothing was limited."""
    asked = {**motion, "mechanisms": [kind]}
    free, practical = (la.synthesize(**asked, limits=limits) for limits in ({}, {"preset": "practical"}))
    assert free.status == practical.status == "closest"
    assert free.solutions[0].errors.objective <= practical.solutions[0].errors.objective
