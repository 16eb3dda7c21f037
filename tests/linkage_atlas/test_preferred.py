"""What is preferred among linkages inside the tolerances, which preset holds by default, and by what limits one is judged."""

import numpy as np
import pytest

import linkage_atlas as la
from tests.conftest import some_of

LINE = np.column_stack([np.linspace(0, 70, 12), np.zeros(12)])
CASEMENT = {
    "rotation": [0, 8, 17, 27, 38, 50, 62, 75],
    "position": [[0, 0], [40, 8], [80, 22], [118, 42], [150, 66], [178, 95], [198, 128], [210, 160]],
    "timing": "free",
    "tolerances": {"position": 2.0, "rotation": 1.0},
}


def measured(solution: la.Solution) -> dict[str, float]:
    """Size, transmission angle and swing from the linkage's own numbers."""
    one = solution.linkage
    assert solution.crank_angle is not None and one.pivot_a is not None and one.coupler_point is not None
    size, swing = max(*one.links, one.coupler_point[0]), float(np.ptp(solution.crank_angle))
    return {"size": size, "transmission": -solution.transmission_angle_min, "crank_span": swing}


def test_a_line_with_a_tolerance_gets_a_small_linkage() -> None:
    # once 25 nanometres off with links of 300 mm, where 0.1 mm was allowed
    found = la.synthesize(position=LINE, timing="free", tolerances={"position": 0.1}, prefer="size", top=3)
    best = found.best
    assert found.status == "reached" and best.verdict.within_tolerance
    assert max(*best.linkage.links, best.linkage.coupler_point[0]) < 80
    off = np.linalg.norm(best.linkage.joints(best.crank_angle).body_point - LINE, axis=1)
    assert 1e-4 < off.max() <= 0.1
    sizes = [one.size for one in found.solutions]
    assert sizes == sorted(sizes)


@pytest.fixture(scope="module")
def by_error() -> la.Solution:
    return la.synthesize(**CASEMENT, prefer="error", top=1).best


@pytest.mark.parametrize("prefer", some_of(["transmission", "size", "crank_span"], 1))
def test_what_is_preferred_is_searched_for(prefer: str, by_error: la.Solution) -> None:
    found = la.synthesize(**CASEMENT, prefer=prefer, top=3)
    assert found.status == "reached" and all(one.verdict.within_tolerance for one in found.solutions)
    values = [measured(one)[prefer] for one in found.solutions]
    worth = {"size": 0.5, "transmission": 1.15, "crank_span": 0.85}[prefer]  # the others' share of the least error's
    assert values[0] <= worth * measured(by_error)[prefer]
    if prefer != "size":  # which counts the pivots too
        assert values == sorted(values)


def test_the_smallest_error_is_marked_and_in_the_list(by_error: la.Solution) -> None:
    without = {name: value for name, value in CASEMENT.items() if name != "tolerances"}
    found = la.synthesize(**without, top=3)
    (marked,) = [solution for solution in found if solution.least_error]
    assert marked.errors.objective == min(solution.errors.objective for solution in found)
    assert marked.errors.objective == pytest.approx(by_error.errors.objective, rel=0.02)
    assert found.best.errors.objective <= 1.1 * marked.errors.objective


# -- presets and verdicts ---------------------------------------------------------------------------------------------


def test_the_practical_preset_holds_where_crank_angles_are_free() -> None:
    # once Python gave a crank of 30,615 for a box of 0.1 mm
    position = [[0, 0], [30, 40], [80, 50], [120, 30], [140, -10], [130, -60], [100, -90]]
    asked = {"position": position, "timing": "free", "top": 3}
    box = {"pivot_box": [50, -20, 50.1, -19.9]}
    kept = la.synthesize(**asked, limits=box)
    assert all(max(one.linkage.links) <= 10 * 120 for one in kept.solutions)
    wide = la.synthesize(**asked, prefer="error")
    assert wide.best.verdict.practical and wide.best.transmission_angle_min >= 35 - 1e-9
    none = la.synthesize(**asked, limits={"preset": "none"})
    # below the tolerance all are alike
    assert none.best.errors.objective <= max(wide.best.errors.objective * 1.01, 1e-10)


@pytest.mark.parametrize("extents", some_of([12, 20, 7], 1))
def test_the_preset_leaves_room_for_a_shortest_link(extents) -> None:
    # once it left none from ten extents on, and took ten seconds and more to say that nothing was found
    turn = np.linspace(0, 2 * np.pi, 18, endpoint=False)
    oval = {"position": np.c_[80 * np.cos(turn), 40 * np.sin(turn)], "timing": "free", "closed": True}
    found = la.synthesize(**oval, limits={"link_min": extents * 80}, top=3)
    assert found.status == "closest"
    for one in found:
        links = one.linkage.links
        assert extents * 80 <= min(links) and max(links) <= 2 * extents * 80
        assert one.transmission_angle_min >= 35 - 1e-9
        assert not any("link" in reason or "pivot" in reason for reason in one.verdict.reasons)


EVENLY, EVENLY_ROUND = np.linspace(0, 1, 9), np.linspace(0, 1, 12, endpoint=False)
EGG = [85.93 - 0.05j, 78.69 + 14.83j, 66.26 + 30.78j, 47.39 + 39.51j, 22.03 + 47.13j, -0.59 + 48j, -19.5 + 47j]
EGG += [-37.3 + 40.49j, -47.88 + 30.38j, -52.6 + 14.15j, -54.76 - 0.57j, -52.06 - 13.58j, -47.33 - 30.23j]
EGG += [-35.66 - 41.32j, -19.53 - 47.93j, -0.11 - 51.29j, 22.23 - 47.65j, 46.88 - 40.5j, 66.53 - 28.82j]
EGG += [80.18 - 17.16j, 84.34 + 0.09j]
"""An egg by hand."""


@pytest.mark.parametrize(
    ("asked", "tops"),
    [
        ({"rotation": 40 * EVENLY}, (1, 5)),
        ({"rotation": 0 * EVENLY, "position": np.column_stack([100 * EVENLY, 0 * EVENLY])}, (5,)),
        ({"position": np.column_stack([100 * EVENLY, 0 * EVENLY]), "mechanisms": ["four_bar", "slider_crank"]}, (1,)),
    ],
    ids=["turn", "shift", "line, two kinds"],
)
def test_a_linkage_out_of_all_proportion_does_not_come_first(asked, tops) -> None:
    # once links of 7 million grounds, and of 3 million times the way, came first: nobody builds those
    for top in tops:
        found = la.synthesize(**asked, crank_span=20, top=top)
        if found.best.kind == "four_bar":
            assert max(found.best.linkage.links) <= 30 * min(found.best.linkage.links)
        assert found.best.size is None or found.best.size <= 30
        assert any("out of all proportion" in note for note in found.report.notes)
        assert found.best.errors.objective < 0.02
        assert found.best.rank == 1
    least = la.synthesize(**asked, crank_span=20, limits={"preset": "none"}, top=1)
    assert least.best.errors.objective < found.best.errors.objective
    assert not any("out of all proportion" in note for note in least.report.notes)


TURN = 2 * np.pi * EVENLY_ROUND
ELLIPSE = {"position": np.round(60 * np.cos(TURN) + 30j * np.sin(TURN)), "crank_angle": 360 * EVENLY_ROUND}


def proportion(one: la.Solution) -> float:
    """Extents, or shortest links, that the longest part is."""
    return max(one.size or 0.0, max(one.linkage.links) / min(one.linkage.links))


def within(extents: float) -> dict[str, object]:
    """Limits of all lengths and places."""
    far, box = 2 * extents * 60, 1.4 * extents * 60
    return {"link_max": far, "coupler_radius_max": far, "pivot_box": [-box, -box, box, box]}


def test_all_of_fair_size_is_looked_at_before_what_is_out_of_all_proportion() -> None:
    # once those within ten times alone: 0.0177 came first, and a limit on all lengths that is met by less had 0.0113
    found = la.synthesize(**ELLIPSE)
    first = found.best
    assert 10 < proportion(first) <= 30 * (1 + 1e-9) and first.errors.objective < 0.0113
    (least,) = [solution for solution in found if solution.least_error]
    assert proportion(least) > 100 and least.errors.objective < 0.1 * first.errors.objective
    # nor does a wider limit make the first worse: once 0.0019 within 60 times, and 0.0177 within 80
    wider = [la.synthesize(**ELLIPSE, limits=within(far), top=1) for far in (5, 30, 60, 80, 1e4)]
    assert np.all(np.diff([one.best.errors.objective for one in wider]) <= 1e-9)


@pytest.mark.parametrize("preset", [None, "none"])
def test_of_cognates_the_smaller_comes_first_wherever_the_path_lies(preset) -> None:
    # once rounding chose: of two of the same error one is 61 extents large and one 104, which is out of all proportion,
    # so that a path that was moved had an answer of 1.6 times the error
    path, limits = np.array(EGG), {} if preset is None else {"preset": preset}
    for moved in (path, path + 1234.5 - 987.25j, 1000 * path, np.exp(0.6j) * path):
        found = la.synthesize(position=moved, crank_span=-360, top=2, limits=limits)
        assert found.solutions[0].size < 70
        assert found.solutions[0].errors.objective < 0.0154


def test_of_linkages_inside_the_tolerances_those_that_stay_between_samples_are_preferred() -> None:
    # once the smallest came first, though its body point went 4 times as far between two samples as they are apart
    along = np.linspace(0, 1, 3)
    position = np.column_stack([250 * along, 60 * np.sin(np.pi * along)])
    asked = {"timing": "free", "tolerances": {"position": 5, "rotation": 2}, "limits": {"family": "any"}}
    found = la.synthesize(180 * along, position, **asked)
    assert found.status == "reached" and found.best.verdict.practical
    assert found.best.excursion is not None and found.best.excursion <= 2.5


def test_an_exact_linkage_stays_first_however_long_it_is() -> None:
    long = la.FourBar(19, 7200, 14400, 21570, start_angle=30)
    asked = {"rotation": long.joints(np.linspace(0, 300, 16)).rotation, "crank_span": 300}
    found = la.synthesize(**asked, top=1)
    assert found.status == "reached" and found.best.errors.objective < 1e-10
    assert max(found.best.linkage.links) > 100 * min(found.best.linkage.links)


def test_a_linkage_is_judged_by_the_limits_that_were_asked_for() -> None:
    # once told in red: "transmission angle 30 degrees, below 35", where 30 was asked for, and met
    linkage = la.FourBar(35, 60, 60, 82, start_angle=120, pivot_a=(10, 5), ground_angle=20, coupler_point=(50, 30))
    joints = linkage.joints(np.linspace(0, 70, 9))
    asked = {"rotation": joints.rotation, "position": joints.body_point, "crank_span": 70, "top": 1}
    best = la.synthesize(**asked).best
    assert 20 < best.transmission_angle_min < 35 and not best.verdict.practical
    assert "below 35" in "".join(best.verdict.reasons)
    least = best.transmission_angle_min - 1
    kept = la.synthesize(**asked, limits={"transmission_angle_min": least}).best
    assert kept.linkage.links == pytest.approx(best.linkage.links, rel=1e-6)
    assert kept.verdict.practical and kept.verdict.buildable is None and not kept.verdict.reasons


def test_alternatives_do_not_look_alike() -> None:
    asked = {name: value for name, value in CASEMENT.items() if name != "tolerances"}
    for limits in ({"family": "any"}, {"preset": "none"}, {}):
        found = la.synthesize(**asked, limits=limits, top=10).solutions
        links = np.log([one.linkage.links for one in found])
        for k, one in enumerate(found):
            for m in range(k):
                same = (one.family, one.linkage.branch) == (found[m].family, found[m].linkage.branch)
                assert not same or np.abs(links[k] - links[m]).max() > np.log(1.02)


def test_exact_answers_are_ranked_by_what_one_would_build() -> None:
    # once the first turned its crank by 214 degrees, and ran past the last pose and back
    found = la.synthesize([0, 15, 40], [[0, 0], [40, 8], [75, 30]], timing="free")
    assert found.status == "reached" and found.best.excursion < 2.5
    assert np.ptp(found.best.crank_angle) < 120
