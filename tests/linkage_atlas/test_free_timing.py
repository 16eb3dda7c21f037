"""Requests without crank angles, with missing samples, weights, tolerances and closed paths are answered as
documented.

A lost sample, an unreported turn of the body, or a detour between two samples would show here.
"""

import csv

import ezdxf
import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of
from tests.oracles.free_classes import free_case, free_request

CRANK = [0.0, 10.0, 35.0, 50.0, 80.0, 110.0]

FREE = {"timing": "free", "limits": {"preset": "none"}}
HALF = np.linspace(0, np.pi, 10)
LETTER_D = np.concatenate([-50 + 10 * np.arange(10.0), 50 * np.cos(HALF[:-1]) + 40j * np.sin(HALF[:-1])])


@pytest.fixture(scope="module")
def motion():
    """Rotation and positions of a known linkage at `CRANK`."""
    linkage = la.FourBar(
        19, 72, 144, 165, start_angle=30, pivot_a=(10, 5), ground_angle=20, coupler_point_polar=(50, 30)
    )
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


def test_none_is_missing_and_nan_is_an_error(motion) -> None:
    turns = motion[0].tolist()
    selected = [None, *turns[1:]]
    timed = la.synthesize(selected, motion[1], crank_angle=CRANK).best
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
    close = min(np.abs(solution.linkage.links - [19, 72, 144, 165]).max() for solution in found.solutions)
    assert close < 1e-4, "five poses are left, and this linkage is one of those that pass them"


def test_tolerances_decide_the_status_and_name_the_worst_sample(motion) -> None:
    random = np.random.default_rng(3)
    turns, points = motion[0] + 0.05 * random.standard_normal(6), motion[1] + 0.02 * random.standard_normal((6, 2))
    request = {"rotation": turns, "position": points, **FREE}
    wide = la.synthesize(**request, tolerances={"rotation": 1.0, "position": 0.5}, prefer="error")
    assert wide.status == "reached" and wide.best.verdict.within_tolerance
    errors = wide.best.errors
    for part in ("rotation", "position"):
        allowed = {"rotation": 1.0, "position": 0.5, part: 0.02 * getattr(errors, f"{part}_max")}
        narrow = la.synthesize(**request, tolerances=allowed)
        assert narrow.status == "closest" and not any(
            solution.verdict.within_tolerance for solution in narrow.solutions
        )
        reported = next(reason for reason in narrow.best.verdict.reasons if "off by" in reason)
    off = np.linalg.norm(narrow.best.linkage.joints(narrow.best.crank_angle).body_point - points, axis=1)
    assert f"sample {np.argmax(off) + 1} is off by" in reported
    assert la.synthesize(**request).best.verdict.within_tolerance is None


TRIANGLE, SQUARE = [[0, 0], [10, 0], [5, 8]], [[0, 0], [10, 0], [10, 10], [0, 10]]


@pytest.mark.parametrize("points", some_of([TRIANGLE, LETTER_D, SQUARE], 1))
def test_a_closed_way_keeps_its_limits_on_the_way_back_too(points) -> None:
    """From the last point the crank turns on to the first: a transmission angle below the limit there is met at every turn."""
    found = la.synthesize(position=points, timing="free", closed=True, assembly=True, top=4)
    assert len(found) > 2
    for solution in found:
        turned = solution.linkage.joints(np.linspace(0, 360, 721)).transmission_angle.min()
        assert turned > 35 - 1e-6 and solution.transmission_angle_min == pytest.approx(turned, abs=1e-3)
        free = solution.verdict.assembly is not None and solution.verdict.assembly.status == "free"
        assert free == (solution.linkage.assembly().status == "free"), "as over the whole turn"


@pytest.mark.parametrize(("mechanisms", "size"), [(None, 1e-3), ("all", 1e4)])
def test_a_note_names_the_hinge_or_straight_guide_that_makes_a_motion_alone(mechanisms, size) -> None:
    turned = np.array([5, 20, 40, 60, 85])
    points = size * (7 + 3j + np.exp(1j * np.deg2rad(turned + 30)))
    points = np.transpose([points.real, points.imag])
    reported = f"The body only turns about the point ({7 * size:.6g}, {3 * size:.6g}), to within "
    request = {"timing": "free", "mechanisms": mechanisms, "top": 1, "budget": 0.05}
    assert la.synthesize(turned, points, **request).report.notes[0].startswith(reported)
    points[2] += 1e-2 * size
    notes = la.synthesize(turned, points, **request).report.notes
    assert not any("only turns" in note for note in notes)
    round_zero = np.transpose([np.cos(np.deg2rad(turned)), np.sin(np.deg2rad(turned))])
    assert "about the point (0, 0), to within" in la.Motion(turned, size * round_zero, timing="free").notes()[0]
    line = size * np.transpose([turned, 2 * turned])
    (note,) = la.Motion([30] * 5, line, timing="free").notes()
    assert note.startswith("the body only shifts along a straight line, to within ")
    line[2, 0] += 2 * size
    for straight in (la.Motion([30] * 5, line, timing="free"), la.Motion(position=line[:2], timing="free")):
        assert not straight.notes(), "a curve, and a point on a line, may need a linkage"
    assert not la.Motion([0, 90], [[0, 0], [5, 5]], timing="free").notes(), "two poses are always turns about a point"


@pytest.mark.parametrize("kind", ["four_bar", "slider_crank"])
def test_a_table_tells_what_was_asked_for_as_it_was(kind, tmp_path) -> None:
    """Rotations as in the request, though they count modulo a turn; empty cells for missing values."""
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
    built = [float(row["rotation"]) for row in rows[2:]]
    assert built == pytest.approx([0, 10, 20], abs=best.errors.rotation_max + 1e-9)
    assert abs(float(rows[1]["rotation"]) - 350) < 90, "within half a turn of its neighbours"
    best.linkage.save(tmp_path / "poses.dxf")
    drawn = ezdxf.readfile(tmp_path / "poses.dxf").modelspace().query("POINT")
    positions = [tuple(point.dxf.location)[:2] for point in drawn]
    assert np.allclose(positions, [point for point in points if point])


def test_a_closed_path_goes_once_round_and_has_an_order() -> None:
    linkage = la.FourBar(
        19, 72, 64, 80, start_angle=30, pivot_a=(10, 5), ground_angle=20, coupler_point_polar=(50, 30)
    )
    points = linkage.joints(np.linspace(0, 300, 12)).body_point
    closed = la.synthesize(position=[*points.tolist(), points[0].tolist()], **FREE, closed=True, top=1).best
    assert closed.crank_angle[-1] == pytest.approx(360) and closed.errors.objective < 1e-9
    with pytest.raises(la.FieldError, match="'any' needs rotation and position") as caught:
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


CORNER = [[0, 0], [10, 0], [20, 0], [30, 0], [40, 0], [40, 10], [40, 20], [40, 30], [40, 40]]
TWO_KINDS = {"mechanisms": ["four_bar", "slider_crank"]}


@pytest.mark.parametrize("more", some_of([{}, TWO_KINDS, {"prefer": "size"}, {"prefer": "transmission"}], 2))
def test_the_first_answer_to_a_drawn_corner_stays_on_it(more):
    """A curve may meet both sides by crossing them with a detour of 96 times the distance between two samples."""
    best = la.synthesize(position=CORNER, timing="free", **more).best
    assert best.excursion < 1.1
    assert best.verdict.practical
    assert best.errors.position_max < 0.3


POSITIONS = [[0, 0], [30, 120], [100, 220], [200, 280], [300, 300]]


ARC = [-143.762 - 109.688j, -168.766 - 55.525j, -177.288 + 6.222j, -161.534 + 78.325j, -131.551 + 129.14j]
ARC += [-71.834 + 168.045j, -12.314 + 186.196j, 48.123 + 179.702j]
"""The least J within the practical limits goes 14 times as far between two of these points as they are apart."""
EIGHT = [-82 + 152j, -51 + 227j, -18 + 287j, 15 + 330j, 46 + 354j, 72 + 362j, 93 + 355j, 107 + 338j, 113 + 311j]
EIGHT += [110 + 279j, 99 + 241j, 80 + 197j, 55 + 148j, 27 + 94j, 36j, -21 - 25j, -35 - 84j, -38 - 139j, -30 - 187j]
EIGHT += [-15 - 227j, 6 - 257j, 26 - 279j, 41 - 294j, 46 - 303j, 39 - 309j, 21 - 310j, -7 - 305j, -40 - 291j]
EIGHT += [-74 - 265j, -102 - 224j, -121 - 167j, -129 - 97j, -124 - 16j, -107 + 69j]
"""A slim letter: a linkage once went 2.7 times as far between two of its 34 points as they are apart."""


@pytest.mark.parametrize(
    ("path", "closed", "largest"), [(ARC, False, 0.003), (EIGHT, True, 0.045)], ids=["arc", "eight"]
)
def test_what_is_drawn_by_hand_is_followed_between_its_points_too(path, closed, largest):
    request = {"timing": "free", "closed": closed, "limits": {"preset": "practical"}}
    best = la.synthesize(position=np.array(path), **request).best
    assert best.excursion < 2.5 and best.errors.objective < largest


def test_the_first_linkage_stays_between_samples_and_is_the_same_for_any_number_of_results():
    """A drawn S: linkages that stay between the samples must not be cut off behind linkages with smaller errors."""
    points = [(60.1, 99.7), (46.1, 103.6), (36.1, 108.3), (21.1, 103.9), (9.3, 94.9), (1.2, 86.7)]
    points += [(6.9, 73.2), (10.8, 64.4), (23.3, 58.8), (37.5, 51.2), (46.7, 46.6), (53.4, 35.3)]
    points += [(59.4, 22.2), (45.6, 11.7), (35.3, 3.8), (27.8, 0.9), (10.5, 6.1), (1.8, 8.9)]
    found = {top: la.synthesize(position=points, timing="free", top=top) for top in (1, 2, 10)}
    first, *_ = (result.best for result in found.values())
    assert first.excursion < 2.5 and all(result.best.links == first.links for result in found.values())
    strays = [solution.excursion > 2.5 for solution in found[10]]
    assert len(strays) == 10 and strays == sorted(strays)


@pytest.mark.parametrize(("seed", "closed"), [(1, True), (5, False)])
def test_wider_limits_never_give_a_worse_first_linkage(seed, closed):
    """Without limits most candidates leave such a path between samples, and usable ones were lost among them."""
    random = np.random.default_rng(seed)
    turn = np.arange(24) / 24 if closed else np.linspace(0, 0.6, 24)
    path = sum(
        100 * complex(*random.normal(size=2)) / wave**1.5 * np.exp(2j * np.pi * sense * wave * turn)
        for wave in (1, 2, 3)
        for sense in (1, -1)
    )
    motion = la.Motion(position=np.column_stack([path.real, path.imag]), timing="free", closed=closed)
    practical, unlimited = (
        la.synthesize(motion, {"preset": name}, prefer="error").best for name in ("practical", "none")
    )
    assert practical.excursion < 2.5 and not (unlimited.excursion or 0) > 2.5
    assert unlimited.errors.objective <= practical.errors.objective * (1 + 1e-9)


def test_an_exact_linkage_that_leaves_the_samples_stays_in_the_list_behind_usable_linkages():
    _, request = free_request(free_case(7_000_005, 6), "motion", 7_000_005)
    found = la.synthesize(**request, prefer="error").solutions
    assert found[0].excursion < 2.5 and found[0].errors.objective > 0.01
    exact = [solution.excursion for solution in found if solution.errors.objective < 1e-9]
    assert len(exact) == 1 and exact[0] > 2.5


@pytest.mark.parametrize(
    ("envelope", "said"),
    [
        ([-50, -50, 250, 400], "The position of sample 5 lies outside the envelope and is missed by at least 50"),
        ([50, -50, 250, 400], "3 positions lie outside the envelope; sample 1 is missed by at least 50"),
        ([-200, -200, 500, 500], None),
    ],
)
def test_positions_outside_of_the_envelope_are_named(envelope, said):
    rotation = [0, 20, 45, 70, 90]
    notes = la.synthesize(rotation, POSITIONS, timing="free", limits={"envelope": envelope}, budget=0.05).report.notes
    outside = [note for note in notes if "outside the envelope" in note]
    assert any(note.startswith(said) for note in outside) if said else not outside


# -- the body turns as requested


def turning(best: la.Solution, rotation: list[float | None]) -> np.ndarray:
    """Return the turn of the body between consecutive samples with an angle, followed in small steps of the crank."""
    prescribed = [k for k, angle in enumerate(rotation) if angle is not None]
    crank = np.array(best.crank_angle)
    parts = [np.linspace(a, b, 500) for a, b in zip(crank[prescribed][:-1], crank[prescribed][1:])]
    return np.array([np.ptp(np.unwrap(best.linkage.joints(part).rotation, period=360)[[0, -1]]) for part in parts])


@pytest.mark.parametrize("half", [180, -180])
def test_a_body_is_turned_over_the_way_that_the_sign_says(half: float) -> None:
    found = la.synthesize([0, half], [[0, 0], [120, 0]], timing="free")
    best = found.best
    gone = np.unwrap(best.linkage.joints(np.linspace(*best.crank_angle, 1000)).rotation, period=360)
    assert gone[-1] - gone[0] == pytest.approx(half, abs=1e-6) and best.verdict.practical


def turn_notes(solution: la.Solution) -> list[str]:
    return [reason for reason in solution.verdict.reasons if reason.startswith("the body turns by")]


def test_a_body_that_turns_the_other_way_round_is_told() -> None:
    """These four poses have a single exact full crank, which turns by -289.7 degrees instead of 70.3."""
    positions = [[0, 0], [40, 11], [55, 70], [91, 84]]
    seen = 0
    for rotation in ([-23.0, 47.3, 40.4, 36.0], [0, 172], [0, 60, 150, 200]):
        for solution in la.synthesize(rotation, positions[: len(rotation)], **FREE):
            wrong = np.abs(turning(solution, rotation) - np.abs(np.diff(rotation))) > 180
            reported = turn_notes(solution)
            assert bool(reported) == bool(wrong.any())
            assert not (reported and solution.verdict.practical)
            if reported:
                first = int(np.argmax(wrong)) + 1
                assert f"from sample {first} to {first + 1}, not by {np.diff(rotation)[first - 1]:.4g}" in reported[0]
                seen += 1
    assert seen
