"""Searches with prescribed timing recover exact linkages and follow the laws of requests and replies.

A wrong basin, a wrong unit, or a reply that depends on the frame of the request would show here.
"""

from typing import Any

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.four_bar import close_loop
from synthesis.limits import Limits
from synthesis.linkage import Linkage, with_links
from synthesis.ranking import SAME
from synthesis.search.report import StoppedBy
from synthesis.search.search import DEFAULT_TOLERANCE, search
from synthesis.search.seeds import SeedTables
from synthesis.studies.determination import determinations
from synthesis.studies.sensitivity import changes
from synthesis.target import Target, make_target
from tests.conftest import some_of
from tests.oracles.classes import EXACT, UNREACHABLE, make_case
from tests.oracles.four_bar_joints import body_point, joints_at
from tests.oracles.recompute import REACHED, compare, recompute

LINKS = ("crank", "coupler", "rocker", "ground")
FEW = 12
"""Samples of requests whose search goes through all of its rounds: its time grows with their number, its steps do not."""


@pytest.fixture(scope="module")
def tables() -> SeedTables:
    return SeedTables()


def ask(request: dict[str, Any]) -> dict[str, Any]:
    return la.synthesize(**request).to_dict()


def target_of(request: dict[str, Any]) -> Target:
    """A request as the numerics see it."""
    parts = ("rotation", "position", "crank_span", "crank_angle", "length_scale")
    return la.Motion(**{name: request.get(name) for name in parts}).target


def links_of(solution: dict[str, Any]) -> np.ndarray:
    return np.array([solution["links"][name] for name in LINKS])


def same_angle(first: float, second: float) -> None:
    """Degrees that agree modulo whole turns."""
    assert abs((first - second + 180) % 360 - 180) < 1e-5


# -- exact answers ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("kind", "seed"), [("change point", 7000435), ("change point", 7000202), ("plain", 7000058)])
def test_an_exact_answer_in_another_valley_is_found(kind: str, seed: int) -> None:
    # the search once ended after two rounds at J of 1e-5, which is far from what noise leaves
    case = make_case(kind, seed, 32 if kind == "change point" else 16)
    reply = la.synthesize(**case.request)
    assert min(solution.errors.objective for solution in reply) < DEFAULT_TOLERANCE


@pytest.mark.parametrize("kind", EXACT)
@pytest.mark.parametrize("seed", some_of(range(3), 1))
def test_an_exact_answer_is_found(kind, seed) -> None:
    case = make_case(kind, 5000 + seed)
    reply = ask(case.request)
    best = compare(case.request, reply["solutions"][0])
    assert best.objective < REACHED
    for solution in reply["solutions"]:
        mine = compare(case.request, solution)
        # a rounding of every number of the motion may be off
        assert mine.gap < 1e-14 * mine.size * 100


@pytest.mark.parametrize("seed", some_of(range(3), 1))
def test_noise_is_fitted_no_worse_than_by_the_truth(seed) -> None:
    case = make_case("noise", 5000 + seed, FEW)
    best = recompute(case.request, ask(case.request)["solutions"][0])
    assert best.objective <= recompute(case.request, case.truth).objective


@pytest.mark.parametrize("scale", [1e-9, 1e9, 1e-45, 1e45])
def test_any_unit_of_length(scale) -> None:
    case = make_case("any order", 5200)
    scaled = case.request | {"position": (scale * np.array(case.request["position"])).tolist()}
    reply = ask(scaled)
    assert recompute(scaled, reply["solutions"][0]).objective < REACHED


# -- weights ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("clockwise", [False, True], ids=["counter-clockwise", "clockwise"])
@pytest.mark.parametrize("limits", [Limits(), Limits(transmission_angle_min=0.1)], ids=["free", "within limits"])
@pytest.mark.parametrize("kind", ["half of the rotations missing", "random", "many samples"])
def test_a_weighted_motion_is_recovered(kind, limits, clockwise, tables) -> None:
    """Missing values are filled with nonsense; the other samples are the motion of a four-bar."""
    random = np.random.default_rng([len(kind), clockwise])
    samples = 200 if kind == "many samples" else 32
    lengths, crank = np.array([1.0, 2.6, 3.1, 3.7]), np.linspace(0, 5, samples)
    theta2 = close_loop(lengths, 0.7 + crank).coupler_angle(1)
    position = 3 - 2j + np.exp(1j * (0.7 + crank)) + 1.4j * np.exp(1j * theta2)
    if kind == "random":
        weights = random.uniform(0.1, 5, (2, samples))
    else:
        weights = np.stack([random.permutation(np.arange(samples) % 2).astype(float), np.ones(samples)])
    rotation = np.where(weights[0] > 0, theta2 + 0.4, random.normal(size=samples))
    target = make_target(rotation, position, 5.0, rotation_weights=weights[0], position_weights=weights[1])
    target = target.mirrored() if clockwise else target
    solutions, report = search(tables, target, limits, 1)
    linkage = solutions[0].linkage
    assert report.stopped_by is StoppedBy.TOLERANCE and solutions[0].errors.objective < DEFAULT_TOLERANCE
    np.testing.assert_allclose(linkage.links, lengths, rtol=1e-6)
    joints = joints_at(linkage, target.crank)
    prescribed = weights[0] > 0
    assert np.max(np.abs(joints.rotation - target.rotation)[prescribed]) < 1e-8
    assert np.max(np.abs(joints.body_point - target.position)) < 1e-8


# -- requests that mean the same --------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", some_of(range(3), 1))
@pytest.mark.parametrize("mirror", [1, -1], ids=["moved", "mirrored and moved"])
def test_a_moved_request_gives_the_moved_linkage(mirror, seed) -> None:
    """Mirrored in the x axis, then turned, scaled and shifted; and all that in radians."""
    case = make_case("any order", 5300 + seed)
    scale, turn, shift = 3.7, 71.0, 2 - 5j

    def moved(point: complex) -> complex:
        return shift + scale * np.exp(1j * np.deg2rad(turn)) * (np.conj(point) if mirror < 0 else point)

    points = moved(np.array(case.request["position"]) @ [1, 1j])
    rotation = np.deg2rad(mirror * np.array(case.request["rotation"]) + turn).tolist()
    position = np.column_stack([points.real, points.imag]).tolist()
    span = np.deg2rad(mirror * case.request["crank_span"])
    request = {"rotation": rotation, "position": position, "crank_span": float(span), "degrees": False}
    old, new = (ask(body)["solutions"][0] for body in (case.request, request))
    np.testing.assert_allclose(links_of(new), scale * links_of(old), rtol=1e-6)
    assert new["branch"] == mirror * old["branch"]
    ours, theirs = new["mount"], old["mount"]
    same_angle(np.rad2deg(new["start_angle"]), mirror * old["start_angle"])
    same_angle(np.rad2deg(ours["ground_angle"]), mirror * theirs["ground_angle"] + turn)
    same_angle(np.rad2deg(ours["coupler_point_polar"]["angle"]), mirror * theirs["coupler_point_polar"]["angle"])
    same_angle(np.rad2deg(new["body_offset"]), mirror * old["body_offset"])
    for name in ("pivot_a", "pivot_b"):
        assert abs(complex(*ours[name]) - moved(complex(*theirs[name]))) < 1e-6 * scale


# -- what a reply holds -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["plain", "rotation only", "position only", UNREACHABLE])
def test_solutions_are_sorted_and_differ(kind) -> None:
    solutions = ask(make_case(kind, 5700).request | {"top": 20})["solutions"]
    if solutions[-1]["has_smallest_error"]:  # with a defect, since it does not come first
        solutions.pop()
    buildable = [solution for solution in solutions if links_of(solution).max() < 100 * links_of(solution).min()]
    assert buildable == solutions[: len(buildable)], "linkages out of proportion come last"
    objectives = [solution["errors"]["objective"] for solution in buildable]
    counted = np.maximum(objectives, DEFAULT_TOLERANCE)  # smaller errors are rounding
    # among errors that differ by rounding only, such as cognates, the smaller linkage comes first
    assert np.all(counted[1:] >= np.maximum.accumulate(counted)[:-1] * (1 - 1e-6))
    assert [s["rank"] for s in solutions] == list(range(1, len(solutions) + 1))
    for k, later in enumerate(solutions):
        for second in solutions[:k]:
            gap = np.max(np.abs(links_of(later) / links_of(later).max() - links_of(second) / links_of(second).max()))
            if gap <= SAME and later["branch"] == second["branch"]:  # then their pose must differ
                assert later["mount"] is not None
                a, b = later["mount"], second["mount"]
                size = links_of(later).max()
                positions = [abs(complex(*a[name]) - complex(*b[name])) for name in ("pivot_a", "pivot_b")]
                radius = abs(a["coupler_point_polar"]["radius"] - b["coupler_point_polar"]["radius"])
                arm = abs((a["coupler_point_polar"]["angle"] - b["coupler_point_polar"]["angle"] + 180) % 360 - 180)
                assert max(*positions, radius, arm * size) > SAME * size


# -- how well a linkage is determined ---------------------------------------------------------------------------------


def motion(target: Target, numbers: np.ndarray, linkage: Linkage) -> np.ndarray:
    """The motion in the objective's measure, from (log links, start, offset, ground turn, pivot, coupler vector)."""
    links = np.exp(numbers[:4])
    start, offset, turn = numbers[4:7]
    scale = target.length_scale
    crank = start + target.crank
    angle = close_loop(links, crank).coupler_angle(linkage.branch)
    pivot = linkage.pivot_a + scale * complex(*numbers[7:9])
    ground = np.exp(1j * (linkage.ground_angle + turn))
    radius, direction = linkage.coupler_point_polar
    vector = radius * np.exp(1j * direction) + scale * complex(*numbers[9:11])
    points = pivot + ground * (links[0] * np.exp(1j * crank) + vector * np.exp(1j * angle))
    rows = [points.real / scale, points.imag / scale]
    if target.rotation is not None:
        rows.insert(0, angle + offset)
    return np.concatenate(rows) / np.sqrt(target.samples)


@pytest.mark.parametrize("kind", ["plain", "position only", "double-crank"])
def test_determination_is_that_of_finite_differences(kind, tables) -> None:
    target = target_of(make_case(kind, 6100).request)
    solution = search(tables, target, Limits(), 1)[0][0]
    linkage = solution.linkage
    at = np.concatenate([np.log(linkage.links), [linkage.start], np.zeros(6)])
    columns = [k for k in range(11) if k != 5 or target.rotation is not None]
    matrix = []
    for k in columns:
        step = np.zeros(11)
        step[k] = 1e-6
        matrix.append((motion(target, at + step, linkage) - motion(target, at - step, linkage)) / 2e-6)
    _, singular, vectors = np.linalg.svd(np.array(matrix).T, full_matrices=False)
    resolution = 1e-7
    mine = determinations(target, [linkage], [resolution])[0]
    uncertainty = resolution * np.sqrt(np.sum((vectors[:, :4] / singular[:, None]) ** 2, axis=0))
    np.testing.assert_allclose(mine.length_uncertainty, uncertainty, rtol=1e-3)


@pytest.mark.parametrize("kind", ["plain", "position only", "rotation only"])
def test_sensitivity_is_that_of_finite_differences(kind, tables) -> None:
    target = target_of(make_case(kind, 6200).request)
    solution = search(tables, target, Limits(), 1)[0][0]
    linkage = solution.linkage
    mine = changes(linkage, target)
    crank, links = linkage.start + target.crank, np.array(linkage.links)
    for k in range(4):
        step = np.zeros(4)
        step[k] = 1e-6 * links[k]
        ahead, behind = (close_loop(links + sign * step, crank).coupler_angle(linkage.branch) for sign in (1, -1))
        if mine[k].rotation is not None:
            change = np.sqrt(np.mean(((ahead - behind) / (2 * step[k])) ** 2))
            assert mine[k].rotation == pytest.approx(change, rel=1e-5)
        if mine[k].position is not None:
            longer, shorter = (with_links(linkage, tuple(links + sign * step)) for sign in (1, -1))
            points = body_point(longer, crank, ahead), body_point(shorter, crank, behind)
            change = np.sqrt(np.mean(np.abs((points[0] - points[1]) / (2 * step[k])) ** 2))
            assert mine[k].position == pytest.approx(change, rel=1e-5)
    assert (mine[0].rotation is None) == (kind == "position only")
    assert (mine[0].position is None) == (kind == "rotation only")
