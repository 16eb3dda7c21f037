"""The front door with free crank angles, missing samples, weights and tolerances: what it takes, refuses and tells."""

import csv
import tracemalloc

import ezdxf
import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.limits import read_limits
from tests.conftest import some_of

CRANK = [0.0, 10.0, 35.0, 50.0, 80.0, 110.0]

FREE = {"timing": "free", "limits": {"preset": "none"}}
HALF = np.linspace(0, np.pi, 10)
LETTER_D = np.concatenate([-50 + 10 * np.arange(10.0), 50 * np.cos(HALF[:-1]) + 40j * np.sin(HALF[:-1])])


@pytest.fixture(scope="module")
def motion():
    """Rotation and positions of a known linkage at `CRANK`."""
    linkage = la.FourBar(19, 72, 144, 165, start_angle=30, pivot_a=(10, 5), ground_angle=20, coupler_point=(50, 30))
    joints = linkage.joints(CRANK)
    return joints.rotation, joints.body_point


def test_the_linkage_and_its_crank_angles_are_found(motion) -> None:
    best = la.synthesize(*motion, **FREE).best
    assert best.linkage.links == pytest.approx([19, 72, 144, 165], rel=1e-9)
    assert best.crank_angle == pytest.approx(CRANK, abs=1e-8)
    assert best.linkage.start_angle == pytest.approx(30, abs=1e-7)
    timed = la.synthesize(*motion, crank_angle=best.crank_angle).best
    assert timed.linkage.links == pytest.approx(best.linkage.links, rel=1e-6)
    assert timed.crank_angle is None and timed.excursion is None


def test_radians_in_radians_out(motion) -> None:
    best = la.synthesize(np.deg2rad(motion[0]), motion[1], **FREE, degrees=False).best
    assert best.crank_angle == pytest.approx(np.deg2rad(CRANK), abs=1e-9)


def test_rotations_alone_fix_nothing(motion) -> None:
    with pytest.raises(la.FieldError, match="any rotation within the coupler's swing") as caught:
        la.synthesize(motion[0], **FREE)
    assert caught.value.field == "/position"


def test_none_is_missing_and_nan_is_an_error(motion) -> None:
    turns = motion[0].tolist()
    some = [None, *turns[1:]]
    timed = la.synthesize(some, motion[1], crank_angle=CRANK).best
    assert timed.linkage.links == pytest.approx([19, 72, 144, 165], rel=1e-6)
    points = [*motion[1].tolist()[:5], None]
    timed = la.synthesize(turns, points, crank_angle=CRANK).best
    assert timed.linkage.links == pytest.approx([19, 72, 144, 165], rel=1e-6)
    with pytest.raises(la.FieldError, match="finite"):
        la.synthesize([np.nan, *turns[1:]], motion[1], **FREE)
    with pytest.raises(la.FieldError, match="at least one entry"):
        la.synthesize([None] * 6, motion[1], **FREE)


def test_a_sample_of_weight_0_counts_for_nothing(motion) -> None:
    turns, points = motion[0].copy(), motion[1].copy()
    turns[2] += 40
    points[2] += 30
    weights = {"rotation": [1, 1, 0, 1, 1, 1], "position": [1, 1, 0, 1, 1, 1]}
    found = la.synthesize(turns, points, **FREE, weights=weights)
    assert found.best.errors.objective < 1e-9
    near = min(np.abs(one.linkage.links - [19, 72, 144, 165]).max() for one in found.solutions)
    assert near < 1e-4, "five poses are left, and this linkage is one of those that pass them"


def test_tolerances_decide_the_status_and_name_the_worst_sample(motion) -> None:
    random = np.random.default_rng(3)
    turns, points = motion[0] + 0.05 * random.standard_normal(6), motion[1] + 0.02 * random.standard_normal((6, 2))
    asked = {"rotation": turns, "position": points, **FREE}
    wide = la.synthesize(**asked, tolerances={"rotation": 1.0, "position": 0.5}, prefer="error")
    assert wide.status == "reached" and wide.best.verdict.within_tolerance
    errors = wide.best.errors
    for part in ("rotation", "position"):
        allowed = {"rotation": 1.0, "position": 0.5, part: 0.02 * getattr(errors, f"{part}_max")}
        narrow = la.synthesize(**asked, tolerances=allowed)
        assert narrow.status == "closest" and not any(one.verdict.within_tolerance for one in narrow.solutions)
        told = next(reason for reason in narrow.best.verdict.reasons if "off by" in reason)
    off = np.linalg.norm(narrow.best.linkage.joints(narrow.best.crank_angle).body_point - points, axis=1)
    assert f"sample {np.argmax(off) + 1} is off by" in told
    assert la.synthesize(**asked).best.verdict.within_tolerance is None


def test_solutions_that_keep_the_tolerances_come_first(motion) -> None:
    each = [0.5] * 6
    found = la.synthesize(*motion, **FREE, tolerances={"position": each}, top=10)
    inside = [one.verdict.within_tolerance for one in found.solutions]
    assert inside == sorted(inside, reverse=True)
    assert [one.rank for one in found.solutions] == list(range(1, len(inside) + 1))


def test_what_one_would_not_build_is_said(motion) -> None:
    best = la.synthesize(*motion, **FREE).best
    assert not best.verdict.practical and best.verdict.works
    assert any("extent" in reason for reason in best.verdict.reasons)
    whole = la.FourBar(30, 70, 60, 80, coupler_point=(40, 20)).joints(np.linspace(0, 300, 12))
    good = la.synthesize(whole.rotation, whole.body_point, **FREE).best
    assert good.verdict.practical and good.verdict.reasons == ()


def test_a_closed_way_may_end_where_it_began() -> None:
    linkage = la.FourBar(19, 72, 64, 80, start_angle=30, coupler_point=(50, 30))
    crank = [0, 40, 80, 130, 200, 260, 300, 330, 360]
    joints = linkage.joints(crank)
    best = la.synthesize(joints.rotation, joints.body_point, **FREE, closed=True).best
    assert best.crank_angle == pytest.approx(crank, abs=1e-7) and best.errors.objective < 1e-9
    assert best.verdict.works and best.linkage.links == pytest.approx([19, 72, 64, 80], rel=1e-8)
    less = la.synthesize(joints.rotation[:-1], joints.body_point[:-1], **FREE, closed=True).best
    assert less.linkage.links == pytest.approx([19, 72, 64, 80], rel=1e-8) and less.crank_angle.size == 8


TRIANGLE, SQUARE = [[0, 0], [10, 0], [5, 8]], [[0, 0], [10, 0], [10, 10], [0, 10]]


@pytest.mark.parametrize("points", some_of([TRIANGLE, LETTER_D, SQUARE], 1))
def test_a_closed_way_keeps_its_limits_on_the_way_back_too(points) -> None:
    """From the last point the crank turns on to the first: a transmission angle below the limit there is met at every turn."""
    found = la.synthesize(position=points, timing="free", closed=True, assembly=True, top=4)
    assert len(found) > 2
    for one in found:
        turned = one.linkage.joints(np.linspace(0, 360, 721)).transmission_angle.min()
        assert turned > 35 - 1e-6 and one.transmission_angle_min == pytest.approx(turned, abs=1e-3)
        free = one.verdict.assembly is not None and one.verdict.assembly.status == "free"
        assert free == (one.linkage.assembly().status == "free"), "as over the whole turn"


@pytest.mark.parametrize(
    ("closed", "asked", "kept"), [(True, {}, 40), (True, {"turn": 50}, 50), (True, {"turn": 20}, 40), (False, {}, 0)]
)
def test_the_transmission_angle_of_a_closed_way_is_a_limit_of_the_whole_turn(closed, asked, kept) -> None:
    """In the search, which else would drop at its end what breaks it on the way back."""
    motion = la.Motion(position=TRIANGLE, timing="free", closed=closed)
    turn = {f"transmission_angle_min_{name}": angle for name, angle in asked.items()}
    limits = read_limits({"preset": "none", "transmission_angle_min": 40} | turn, motion)
    assert limits.transmission_angle_min == pytest.approx(np.deg2rad(40))
    assert limits.transmission_angle_min_turn == pytest.approx(np.deg2rad(kept))


@pytest.mark.parametrize("way", some_of([-1, 1], 1))
def test_what_drives_a_closed_way_drives_it_round(way) -> None:
    """A motor has the torque of the whole turn, and no cylinder, which would have to turn back, is offered."""
    asked = [{"kind": "rotary"}, {"kind": "actuator"}]
    points, load, motor = TRIANGLE[::way], {"force": [0, -100]}, ("rotary", "crank")
    found = la.synthesize(position=points, timing="free", closed=True, load=load, drives=asked, top=8)
    motors = [(one, drive) for one in found for drive in one.drives if (drive.kind, drive.link) == motor]
    assert len(motors) > 2
    for one, motor in motors:
        assert not [drive for drive in one.drives if drive.kind == "actuator"]
        turned = np.linspace(0, 360, 3601)
        height = 100 * one.linkage.joints(turned).body_point[:, 1]
        assert motor.peak_torque == pytest.approx(np.abs(np.gradient(height, np.deg2rad(turned))).max(), rel=1e-3)
        again = [drive.peak_torque for drive in la.drives(one, asked, load=load).drives]
        assert motor.peak_torque == pytest.approx(min(again))
        assert not any("and 4" in refused.reason for refused in one.refused), "there are three poses"


@pytest.mark.parametrize(("mechanisms", "size"), [(None, 1e-3), ("all", 1e4)])
def test_that_a_body_only_turns_is_said(mechanisms, size) -> None:
    turned = np.array([5, 20, 40, 60, 85])
    points = size * (7 + 3j + np.exp(1j * np.deg2rad(turned + 30)))
    points = np.transpose([points.real, points.imag])
    told = f"The body only turns about the point ({7 * size:.6g}, {3 * size:.6g}), to within "
    asked = {"timing": "free", "mechanisms": mechanisms, "top": 1, "budget": 0.05}
    assert la.synthesize(turned, points, **asked).report.notes[0].startswith(told)
    points[2] += 1e-2 * size
    notes = la.synthesize(turned, points, **asked).report.notes
    assert not any("only turns" in note for note in notes)
    round_zero = np.transpose([np.cos(np.deg2rad(turned)), np.sin(np.deg2rad(turned))])
    assert "about the point (0, 0), to within" in la.Motion(turned, size * round_zero, timing="free").notes()[0]
    line = np.transpose([turned, 2 * turned])
    assert not any("only turns" in note for note in la.Motion([30] * 5, line, timing="free").notes())
    assert not la.Motion([0, 90], [[0, 0], [5, 5]], timing="free").notes(), "two poses are always turns about a point"


KINDS_IN_TURN = [["four_bar"], ["rail_slot", "two_slots"], ["slider_crank", "swinging_block"]]


@pytest.mark.parametrize("mechanisms", some_of(KINDS_IN_TURN, 2))
def test_files_show_the_first_sample_wherever_on_the_way_it_is(mechanisms, tmp_path) -> None:
    order = np.array([2, 0, 4, 1, 3])
    turned = np.array([8.0, 23, 35, 52, 64])[order]
    points = np.array([[0.0, 0], [30, 5], [55, 20], [75, 40], [90, 66]])[order]
    limits = {"preset": "none"}
    found = la.synthesize(turned, points, timing="free", order="any", mechanisms=mechanisms, limits=limits, top=5)
    assert found
    for one in found:
        one.linkage.save(tmp_path / "shown.dxf")
        outline = ezdxf.readfile(tmp_path / "shown.dxf").modelspace().query('LWPOLYLINE[layer=="BODY"]').first
        away = [np.hypot(*(place - points[0])) for place in outline.get_points("xy")]
        assert min(away) < one.errors.position_max + 1e-9


def test_no_slider_drives_a_closed_way_and_that_is_said() -> None:
    turned = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    motion = 10 * np.sin(turned), np.transpose([60 * np.cos(turned), 20 * np.sin(turned)])
    found = la.synthesize(*motion, timing="free", closed=True, mechanisms=["slider_crank", "rail_slot"])
    assert found and {one.driver for one in found} == {"crank"} and all(one.verdict.works for one in found)
    assert "would have to turn back on a closed path" in " ".join(found.report.notes)
    with pytest.raises(la.FieldError, match="driver: a slider would have to turn back"):
        la.synthesize(*motion, timing="free", closed=True, mechanisms="all", driver="slider")


@pytest.mark.parametrize("way", [1, -1])
def test_an_analysis_of_a_closed_way_goes_round(way, tmp_path) -> None:
    points = [[0, 0], [10, 0], [5, 8], [1, 4]][::way]
    best = la.synthesize(position=points, timing="free", closed=True, analysis={"crank_speed": 60}).best
    curve = best.analysis.curve.crank_angle
    best.linkage.save(tmp_path / "round.xml")
    assert "6.28319 s at the keyframe's speed" in (tmp_path / "round.xml").read_text()
    assert curve[0] == 0 and curve[-1] == pytest.approx(360 * np.sign(best.crank_angle[-1]))


@pytest.mark.parametrize("kind", ["four_bar", "slider_crank"])
def test_a_table_tells_what_was_asked_for_as_it_was(kind, tmp_path) -> None:
    """Rotations as they were given, though they count modulo a turn; nothing where nothing was asked for."""
    turns, points = [340, None, 0, 10, 20], [[0, 0], [20, 2], None, [60, 10], [80, 8]]
    best = la.synthesize(turns, points, timing="free", mechanisms=[kind], top=1).best
    best.linkage.save(tmp_path / "poses.csv")
    rows = list(csv.DictReader((tmp_path / "poses.csv").read_text().splitlines()))
    cells = [row["rotation_wanted"] for row in rows]
    assert cells[1] == "" and [float(cells[k]) for k in (0, 2, 3, 4)] == pytest.approx([340, 0, 10, 20])
    assert rows[1]["rotation_error"] == rows[2]["x_wanted"] == rows[2]["y_wanted"] == rows[2]["position_error"] == ""
    errors = [float(row["rotation_error"]) for row in rows if row["rotation_error"]]
    assert max(map(abs, errors)) == pytest.approx(best.errors.rotation_max, abs=1e-9)
    for row in (rows[k] for k in (0, 2, 3, 4)):  # got minus wanted, up to whole turns
        gap = float(row["rotation"]) - float(row["rotation_wanted"]) - float(row["rotation_error"])
        assert abs(gap - 360 * round(gap / 360)) < 1e-9
    made = [float(row["rotation"]) for row in rows[2:]]
    assert made == pytest.approx([0, 10, 20], abs=best.errors.rotation_max + 1e-9)
    assert abs(float(rows[1]["rotation"]) - 350) < 90, "within half a turn of its neighbours"
    best.linkage.save(tmp_path / "poses.dxf")
    drawn = ezdxf.readfile(tmp_path / "poses.dxf").modelspace().query("POINT")
    places = [tuple(point.dxf.location)[:2] for point in drawn]
    assert np.allclose(places, [place for place in points if place])


KINDS = ("four_bar", "rail_slot", "slider_crank", "swinging_block")


@pytest.mark.parametrize(("kind", "way"), some_of([(kind, way) for way in (-1, 1) for kind in KINDS], 2))
def test_files_show_the_first_sample_whichever_way_the_drive_goes(kind, way, tmp_path) -> None:
    turned, points = np.array([0, 20, 45, 70]), np.array([[0, 0], [20, 2 * way], [40, 15 * way], [50, 30 * way]])
    found = la.synthesize(way * turned, points, timing="free", mechanisms=[kind], limits={"preset": "none"}, top=3)
    assert len(found) > 1
    for one in found:
        one.linkage.save(tmp_path / "shown.dxf")
        space = ezdxf.readfile(tmp_path / "shown.dxf").modelspace()
        outline, path = (space.query(f'LWPOLYLINE[layer=="{layer}"]').first for layer in ("BODY", "PATH"))
        shown = [path.get_points("xy")[0], min(outline.get_points("xy"), key=lambda place: np.hypot(*place))]
        assert np.hypot(*shown[0]) < one.errors.position_max + 1e-9
        assert np.hypot(*shown[1]) < one.errors.position_max + 1e-9


TILTED = [0, -10, -22, -36, -52, -70, -90, -110]
LID = TILTED, np.array([0, 4 + 12j, 10 + 24j, 19 + 34j, 31 + 42j, 45 + 46j, 60 + 46j, 74 + 42j])
"""Eight poses that no linkage makes exactly."""


KEPT = [{"family": "any", "pivot_box": [0, -60, 120, 20], "link_max": 120, "link_min": 20}]
KEPT += [
    {"transmission_angle_min": 30},
    {"pivot_box": [-50, -60, 120, 20]},
    {"link_max": 70, "family": "double_crank"},
]


@pytest.mark.parametrize("limits", some_of(KEPT, 2))
def test_limits_are_kept_and_cost_little(limits) -> None:
    found = la.synthesize(*LID, timing="free", limits=limits)
    assert found.solutions and found.best.errors.objective < 0.02
    for one in found.solutions:
        links = one.linkage.links
        assert one.transmission_angle_min >= limits.get("transmission_angle_min", 0)
        assert links.max() <= limits.get("link_max", np.inf) and links.min() >= limits.get("link_min", 0)
        low, high = np.split(np.array(limits.get("pivot_box", [-np.inf] * 2 + [np.inf] * 2)), 2)
        for pivot in (one.linkage.pivot_a, one.linkage.pivot_b):
            assert np.all((pivot >= low) & (pivot <= high))
        if limits.get("family", "any") != "any":
            assert one.family in (limits.get("family", "crank_rocker"), "double_crank")


def test_a_closed_path_goes_once_round_and_has_an_order() -> None:
    linkage = la.FourBar(19, 72, 64, 80, start_angle=30, pivot_a=(10, 5), ground_angle=20, coupler_point=(50, 30))
    points = linkage.joints(np.linspace(0, 300, 12)).body_point
    closed = la.synthesize(position=[*points.tolist(), points[0].tolist()], **FREE, closed=True, top=1).best
    assert closed.crank_angle[-1] == pytest.approx(360) and closed.errors.objective < 1e-9
    with pytest.raises(la.FieldError, match="a path has an order") as caught:
        la.synthesize(position=points, **FREE, order="any")
    assert caught.value.field == "/order"


@pytest.mark.parametrize(
    ("rotation", "position"),
    [
        ([0, 0], [[0, 0], [10, 5]]),
        ([0, 0, 0], [[0, 0], [10, 5], [30, 0]]),
        ([0] * 6, [[0, 0], [10, 5], [30, 0], [40, 3], [50, 9], [70, 1]]),
        ([0, 10, 20], [[0, 0], [10, 0], [20, 0]]),
        ([0, 10, 20, 30, 40, 50], [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0], [50, 0]]),
        ([0, 90], [[0, 0], [0, 0.0001]]),
        (None, [[0, 0], [1, 0], [2, 0], [3, 0], [4, 0], [5, 0]]),
        (None, [[0, 0], [1, 0], [1, 1], [0, 1]]),
    ],
)
def test_translations_lines_and_corners_have_a_closest_linkage(rotation, position) -> None:
    found = la.synthesize(rotation, position, **FREE, top=2)
    assert found.solutions and found.status in ("reached", "closest")
    assert found.best.errors.objective < 0.06


def test_the_trace_tells_of_answers_within_the_limits_only() -> None:
    position = [[0, 0], [12.5, 40], [38, 75], [80, 101], [130, 112]]
    limits = {"preset": "practical"}
    found = la.synthesize([0, -12, -30, -52, -80], position, timing="free", limits=limits, prefer="error", top=2)
    assert found.report.trace
    assert min(objective for _, objective in found.report.trace) >= found.best.errors.objective * (1 - 1e-9)


@pytest.mark.parametrize("milliseconds", [1, 10, 20, 60])
def test_a_search_within_limits_that_is_cut_short_claims_nothing(milliseconds) -> None:
    position = [[0, 0], [12.5, 40], [38, 75], [80, 101], [130, 112], [180, 108], [230, 90]]
    rotation = [0, -12, -30, -52, -80, -95, -115]
    asked = {"timing": "free", "limits": {"preset": "practical"}, "budget": milliseconds / 1000}
    found = la.synthesize(rotation, position, **asked)
    assert found.report.stopped_by == "budget"
    assert found.status == ("closest" if found.solutions else "unknown")


@pytest.mark.parametrize("seed", some_of([0, 2, 3], 1))
def test_a_closed_way_of_few_points_stays_inside_its_envelope_on_the_way_back_too(seed):
    """Of four points of half a curve: the search is led by the limits of the whole turn (else nothing is found, or far off)."""
    random, t = np.random.default_rng(seed), np.pi / 4 * np.arange(4)
    z = np.exp(1j * t) + 0.25 * np.exp(-1j * t + 1j * random.uniform(0, 6))
    z = 100 * (z + 0.12 * np.exp(2j * t + 1j * random.uniform(0, 6)))
    spare = 0.3 * max(np.ptp(z.real), np.ptp(z.imag))
    low, high = z.real.min() - spare + 1j * (z.imag.min() - spare), z.real.max() + spare + 1j * (z.imag.max() + spare)
    envelope = [low.real, low.imag, high.real, high.imag]
    found = la.synthesize(position=np.c_[z.real, z.imag], timing="free", closed=True, limits={"envelope": envelope})
    assert found.best.errors.objective < 0.1
    for one in found:
        joints = one.linkage.joints(np.linspace(0, 360, 721))
        for places in (joints.pivot_a, joints.pivot_b, joints.crank_pin, joints.coupler_pin, joints.body_point):
            places = np.atleast_2d(places)
            assert np.all(places >= np.array([low.real, low.imag]) - 1e-3)
            assert np.all(places <= np.array([high.real, high.imag]) + 1e-3)


CORNER = [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0], [40, 10], [40, 20], [40, 30], [40, 40]]
TWO_KINDS = {"mechanisms": ["four_bar", "slider_crank"]}


@pytest.mark.parametrize("more", some_of([{}, TWO_KINDS, {"prefer": "size"}, {"prefer": "transmission"}], 2))
def test_the_first_answer_to_a_drawn_corner_stays_on_it(more):
    """A curve may meet both sides by crossing them and going 96 times as far round between two samples: nobody draws that."""
    best = la.synthesize(position=CORNER, timing="free", **more).best
    assert best.excursion < 1.1
    assert best.verdict.practical
    assert best.errors.position_max < 0.3


def test_no_answer_hangs_a_large_body_on_tiny_links():
    """A hood: linkages with links of 2 to 23 mm for a way of 550 mm come nearest, and hold nothing."""
    rotation = [0, 15, 32, 50, 65]
    position = [[0, 0], [-80, 120], [-190, 220], [-320, 290], [-450, 320]]
    extent = 281.7
    best = la.synthesize(rotation, position, timing="free").best
    assert min(best.links._asdict().values()) >= 0.0499 * extent
    assert best.errors.objective < 4e-3
    tiny = la.synthesize(rotation, position, timing="free", limits={"link_max": 12, "link_min": 1}).best
    assert min(tiny.links._asdict().values()) < 0.03 * extent and tiny.verdict.practical  # asked for


SHORT = [
    {"link_max": 1, "coupler_radius_max": 100},
    {"pivot_box": [60, 0, 60.5, 0.5]},
    {"pivot_a": [60, 0], "pivot_b": [60, 0.8]},
]


@pytest.mark.parametrize("limits", some_of([*SHORT, {"links": {"crank": 1}}], 1))
def test_short_links_that_a_request_needs_are_allowed(limits):
    assert la.synthesize(position=CORNER, timing="free", limits=limits, top=1).solutions


PLACES = [[0, 0], [30, 120], [100, 220], [200, 280], [300, 300]]


@pytest.mark.parametrize(
    ("rotation", "degrees", "asked"),
    [
        ([0, 20, 45, 70, 90], False, "in degrees?"),
        ([0, 0.35, 0.79, 1.22, 1.57], True, "in radians?"),
        ([0, 20, 45, 70, 90], True, None),
        ([0, 0.35, 0.79, 1.22, 1.57], False, None),
        ([0, -0.5, -1, -1.5, -2], True, None),  # two degrees in round numbers
        ([0, 0.05, 0.11, 0.17, 0.22], True, None),
        ([None, 0.35, None, 1.22, 1.57], True, "in radians?"),
    ],
)
def test_rotations_that_look_like_another_unit_are_asked_about(rotation, degrees, asked):
    notes = la.Motion(rotation, PLACES, timing="free", degrees=degrees).notes()
    assert [asked] == [note[note.index("in ") : note.index("?") + 1] for note in notes] if asked else not notes


ARC = [-143.762 - 109.688j, -168.766 - 55.525j, -177.288 + 6.222j, -161.534 + 78.325j, -131.551 + 129.14j]
ARC += [-71.834 + 168.045j, -12.314 + 186.196j, 48.123 + 179.702j]
"""The least J within the practical limits goes 14 times as far between two of these points as they are apart."""
EIGHT = [-82 + 152j, -51 + 227j, -18 + 287j, 15 + 330j, 46 + 354j, 72 + 362j, 93 + 355j, 107 + 338j, 113 + 311j]
EIGHT += [110 + 279j, 99 + 241j, 80 + 197j, 55 + 148j, 27 + 94j, 36j, -21 - 25j, -35 - 84j, -38 - 139j, -30 - 187j]
EIGHT += [-15 - 227j, 6 - 257j, 26 - 279j, 41 - 294j, 46 - 303j, 39 - 309j, 21 - 310j, -7 - 305j, -40 - 291j]
EIGHT += [-74 - 265j, -102 - 224j, -121 - 167j, -129 - 97j, -124 - 16j, -107 + 69j]
"""A slim one: all that the search kept once went 2.7 times as far between two of its 34 points as they are apart."""


@pytest.mark.parametrize(
    ("path", "closed", "most"), [(ARC, False, 0.003), (EIGHT, True, 0.045)], ids=["arc", "eight"]
)
def test_what_is_drawn_by_hand_is_followed_between_its_points_too(path, closed, most):
    asked = {"timing": "free", "closed": closed, "limits": {"preset": "practical"}}
    best = la.synthesize(position=np.array(path), **asked).best
    assert best.excursion < 2.5 and best.errors.objective < most


def test_an_exact_answer_that_strays_does_not_end_the_search():
    """Five points: the first four-bar that meets them goes far away between two of them; another meets them and stays."""
    position = [(106, 17), (166, -2), (249, 19), (261, -17), (286, -37)]
    found = la.synthesize(position=position, timing="free")
    assert found.best.errors.objective < 1e-9 and found.best.verdict.practical
    assert sum(one.verdict.practical for one in found.solutions) >= 3


def test_the_first_linkage_stays_between_samples_and_is_the_same_for_any_number_of_results():
    """A drawn S: the first linkages by their error stray, and behind so many of them one that does not was not seen."""
    points = [(60.1, 99.7), (46.1, 103.6), (36.1, 108.3), (21.1, 103.9), (9.3, 94.9), (1.2, 86.7)]
    points += [(6.9, 73.2), (10.8, 64.4), (23.3, 58.8), (37.5, 51.2), (46.7, 46.6), (53.4, 35.3)]
    points += [(59.4, 22.2), (45.6, 11.7), (35.3, 3.8), (27.8, 0.9), (10.5, 6.1), (1.8, 8.9)]
    found = {top: la.synthesize(position=points, timing="free", top=top) for top in (1, 2, 10)}
    first, *_ = (one.best for one in found.values())
    assert first.excursion < 2.5 and all(one.best.links == first.links for one in found.values())
    strays = [solution.excursion > 2.5 for solution in found[10]]
    assert len(strays) == 10 and strays == sorted(strays)


def test_a_linkage_for_poses_in_any_order_is_refined_on_the_arc_of_its_crank_that_it_uses():
    """On the shortest arc that holds its crank angles it breaks the limits: once it came back worse."""
    poses = [0, 90, 15, 45, 5, 70], [(0, 0), (70, 90), (30, 20), (60, 50), (10, 5), (75, 60)]
    asked = {"timing": "free", "order": "any", "limits": {"family": "any"}}
    for one in la.synthesize(*poses, **asked, top=3):
        again = la.synthesize(*poses, **asked, start_from=[one], local=True).best
        assert again.errors.objective <= one.errors.objective * (1 + 1e-6)
        assert again.transmission_angle_min >= 35 - 1e-6


def test_samples_that_share_a_position_of_the_crank_do_not_lead():
    """Once the first kept the order to rounding alone: two samples 8 apart, and both ends of the path, lay at one crank angle."""
    points = [(31, -7), (-18, -15), (-26, -17), (16, -10), (57, -5), (62, -9), (42, -24), (19, -27), (-2, -4)]
    shared = [
        "share one crank position" in "".join(one.verdict.reasons)
        for one in la.synthesize(position=points, timing="free")
    ]
    assert not shared[0] and shared == sorted(shared)
    allowed = la.synthesize(position=points, timing="free", tolerances={"position": 40}, prefer="error").best
    assert allowed.verdict.within_tolerance and not allowed.verdict.reasons


def test_turning_a_motion_in_the_plane_does_not_lose_its_answers_in_any_order():
    """Once there was nothing for it when turned by 90 degrees: no pair of dyads was left to begin with."""
    rotation, position = [0, 20, 40, 60, 80, 95], [(0, 0), (25, 5), (48, 18), (66, 38), (76, 62), (78, 88)]
    for places in (position, [(-y, x) for x, y in position]):
        assert la.synthesize(rotation, places, timing="free", order="any").best.errors.objective < 0.0065


@pytest.mark.parametrize(
    ("envelope", "said"),
    [
        ([-50, -50, 250, 400], "The position of sample 5 lies outside the envelope and is missed by at least 50"),
        ([50, -50, 250, 400], "3 positions lie outside the envelope; that of sample 1 is missed by at least 50"),
        ([-200, -200, 500, 500], None),
    ],
)
def test_positions_outside_of_the_envelope_are_named(envelope, said):
    rotation = [0, 20, 45, 70, 90]
    notes = la.synthesize(rotation, PLACES, timing="free", limits={"envelope": envelope}, budget=0.05).report.notes
    outside = [note for note in notes if "outside the envelope" in note]
    assert any(note.startswith(said) for note in outside) if said else not outside


def test_links_so_long_that_their_curve_is_rounding_take_no_more_memory_than_others():
    """Without limits a spiral's best links are 7e5 long on a ground of 0.1: halving arcs for accuracy never came to an end."""
    spiral = [(30.0, 0.0), (23.2, 40.0), (-15.2, 56.5), (-54.7, 41.6), (-77.5, 5.8), (-77.5, -36.8), (-56.6, -74.0)]
    tracemalloc.start()
    found = la.synthesize(position=[*spiral, (-21.1, -97.8)], **FREE)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert max(found.best.links) > 1e5 and found.best.excursion < 1.2
    assert peak < 6e7


# -- the body turns as it was asked to -----------------------------------------------------------------------------


def turning(best: la.Solution, rotation: list[float | None]) -> np.ndarray:
    """By how much the body turns from each sample with an angle to the next, followed in small steps of the crank."""
    given = [k for k, angle in enumerate(rotation) if angle is not None]
    crank = np.array(best.crank_angle)
    parts = [np.linspace(a, b, 500) for a, b in zip(crank[given][:-1], crank[given][1:])]
    return np.array([np.ptp(np.unwrap(best.linkage.joints(one).rotation, period=360)[[0, -1]]) for one in parts])


@pytest.mark.parametrize("half", [180, -180])
def test_a_body_is_turned_over_the_way_that_the_sign_says(half: float) -> None:
    found = la.synthesize([0, half], [[0, 0], [120, 0]], timing="free")
    best = found.best
    gone = np.unwrap(best.linkage.joints(np.linspace(*best.crank_angle, 1000)).rotation, period=360)
    assert gone[-1] - gone[0] == pytest.approx(half, abs=1e-6) and best.verdict.practical


def test_angles_at_both_ends_are_met_without_further_turns() -> None:
    """Nothing between says how the body turns: the nearest four-bars take it round by -270 degrees, and are told from others."""
    rotation = [0, *[None] * 9, 90]
    found = la.synthesize(rotation, [[10 * k, k * (10 - k)] for k in range(11)], timing="free")
    good = [one for one in found if one.verdict.practical]
    assert good and turning(good[0], rotation) == pytest.approx([90], abs=3)
    assert all((turning(one, rotation)[0] < 100) == (not _told(one)) for one in found)


def _told(one: la.Solution) -> list[str]:
    return [reason for reason in one.verdict.reasons if reason.startswith("the body turns by")]


def test_a_body_that_turns_the_other_way_round_is_told() -> None:
    """These four poses have one exact full crank, and it goes round by -289.7 degrees where 70.3 were asked for."""
    places = [[0, 0], [40, 11], [55, 70], [91, 84]]
    seen = 0
    for rotation in ([-23.0, 47.3, 40.4, 36.0], [0, 172], [0, 60, 150, 200]):
        for one in la.synthesize(rotation, places[: len(rotation)], **FREE):
            wrong = np.abs(turning(one, rotation) - np.abs(np.diff(rotation))) > 180
            told = _told(one)
            assert bool(told) == bool(wrong.any())
            assert not (told and one.verdict.practical)
            if told:
                first = int(np.argmax(wrong)) + 1
                assert f"from sample {first} to {first + 1}, not by {np.diff(rotation)[first - 1]:.4g}" in told[0]
                seen += 1
    assert seen


def test_wrapped_angles_turn_on() -> None:
    found = la.synthesize([340, 350, 0, 10, 20], [[0, 0], [10, 4], [22, 6], [35, 6], [47, 4]], timing="free")
    assert turning(found.best, [340, 350, 0, 10, 20]) == pytest.approx([10] * 4, abs=1)
    assert found.best.verdict.practical


@pytest.mark.parametrize("last", [[], [[0, 0]]], ids=["left out", "repeated"])
def test_a_closed_way_counts_the_turn_back_too(last: list[list[float]]) -> None:
    """A coupler that goes round with its crank turns by 360 degrees over the whole way, from 315 on to 360, and not back to 0."""
    linkage = la.FourBar(90, 75, 80, 30, start_angle=20, pivot_a=(0, 0), coupler_point=(60, 40))
    joints = linkage.joints(np.linspace(0, 360, 9))
    rotation, places = joints.rotation - joints.rotation[0], joints.body_point
    count = 8 + len(last)
    free = FREE | {"closed": True}
    spinning = la.synthesize(rotation[:count], places[:count], **free)
    assert spinning.best.errors.objective < 1e-9
    assert not _told(spinning.best)


def test_what_turns_on_sliders_is_told_alike() -> None:
    rotation, places = [0, *[None] * 3, 170], [[18 * k, 2 * k * (4 - k)] for k in range(5)]
    seen = set()
    for one in la.synthesize(rotation, places, **FREE, mechanisms=["slider_crank", "swinging_block"]):
        told = bool(_told(one))
        travel = one.travel if one.crank_angle is None else one.crank_angle
        gone = np.unwrap(one.linkage.joints(np.linspace(travel[0], travel[-1], 4000)).rotation, period=360)
        assert told == (abs(gone[-1] - gone[0] - 170) > 180)
        assert not (told and one.verdict.practical)
        seen.add(told)
    assert seen == {False}, "those that turn otherwise cannot be used, and others can"


@pytest.mark.parametrize(
    ("family", "lengths", "least"),
    [("any", (60, 80, 70, 92), 30), ("any", (60, 80, 70, 90), 24), ("full_crank", (60, 80, 70, 88), 30)],
)
def test_given_lengths_that_keep_a_limit_are_found(family: str, lengths: tuple[int, ...], least: float) -> None:
    links = dict(zip(("crank", "coupler", "rocker", "ground"), lengths))
    limits = {"family": family, "links": links, "transmission_angle_min": least, "transmission_angle_min_turn": 0}
    place = [[0, 0], [20, 10], [40, 25], [60, 50], [70, 80], [70, 110]]
    found = la.synthesize(rotation=[0, 10, 25, 45, 70, 90], position=place, timing="free", limits=limits, top=1)
    assert tuple(found.best.links) == pytest.approx(lengths)
    assert found.best.transmission_angle_min >= least - 1e-6 and found.best.errors.objective < 0.13
