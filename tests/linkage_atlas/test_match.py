"""Matches among several kinds of mechanism are the best rows of all atlases, each with its kind.

A row of the wrong kind, or an atlas that is not loaded again, would show here.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.atlases import as_atlas
from tests.oracles.slider_crank import body_angle

KINDS = ["four_bar", "slider_crank"]


@pytest.fixture(scope="module")
def four_bars(tmp_path_factory: pytest.TempPathFactory) -> la.Atlas:
    return la.build_atlas(tmp_path_factory.mktemp("match") / "atlas.h5", 80, samples=64, jobs=1)


@pytest.fixture(scope="module")
def sliders(tmp_path_factory: pytest.TempPathFactory) -> la.Atlas:
    return la.build_atlas(tmp_path_factory.mktemp("sliders") / "s.h5", 60, samples=64, kind="slider_crank", jobs=1)


def rod(lengths: list[int], start: float, branch: int = 1, span: float = 120.0) -> np.ndarray:
    """Return the angle of a rod in degrees by the textbook formula; branch -1 is the negated offset."""
    crank = np.deg2rad(start + np.linspace(0, span, 13))
    return np.rad2deg(body_angle([[*lengths[:2], branch * lengths[2]]], crank)[0])


@pytest.mark.parametrize("degrees", [True, False])
@pytest.mark.parametrize("branch", [1, -1])
def test_a_row_of_slider_cranks_is_matched_to_itself(sliders: la.Atlas, branch: int, degrees: bool) -> None:
    unit = 1.0 if degrees else np.pi / 180
    expected = unit * (rod([12, 40, 8], 70, branch) + 30)
    found = la.match(expected, 120 * unit, atlas=sliders, mechanisms=["slider_crank"], top=3, degrees=degrees)
    first = found.matches[0]
    assert (first.kind, first.type.lengths, first.branch) == ("slider_crank", [12, 40, 8], branch)
    assert first.start_angle == pytest.approx(70 * unit) and first.rotation_rms < 1e-12
    assert first.offset == pytest.approx(30 * unit)
    for solution in found:  # each linkage turns as its row
        assert solution.linkage.kind == "slider_crank" and solution.linkage.driver == "crank"
        joints = solution.linkage.joints(np.linspace(0, 120 * unit, 13))
        assert np.sqrt(np.mean((joints.rotation - expected) ** 2)) == pytest.approx(solution.rotation_rms, abs=1e-9)
    assert found.report.exhaustive and found.report.windows == len(sliders) * 720
    assert json.loads(json.dumps(found.to_dict())) == found.to_dict() and "slider-crank" in repr(found)


def test_the_rows_of_both_kinds_are_the_best_of_all(four_bars: la.Atlas) -> None:
    expected = rod([100, 500, 40], 20) + np.linspace(0, 0.3, 13)
    single = {kind: la.match(expected, 120, atlas=four_bars, mechanisms=[kind], top=6) for kind in KINDS}
    both = la.match(expected, 120, atlas=four_bars, mechanisms="all", top=6)
    all_cases = [match for found in single.values() for match in found]
    best = sorted(all_cases, key=lambda match: match.rotation_rms)[:6]
    assert [(linkage.kind, linkage.type, linkage.rotation_rms) for linkage in both] == [
        (o.kind, o.type, o.rotation_rms) for o in best
    ]
    assert [match.rank for match in both] == [1, 2, 3, 4, 5, 6] and {linkage.kind for linkage in both} == set(KINDS)
    assert both.report.windows == sum(result.report.windows for result in single.values())
    repeated = la.match(expected, 120, atlas=four_bars, mechanisms=KINDS[::-1], top=6)
    assert both.to_dict()["matches"] == repeated.to_dict()["matches"]
    assert {linkage.kind for linkage in la.match(expected, 120, atlas=four_bars, top=6)} == {"four_bar"}


def test_an_atlas_is_named_by_its_path_and_opened_once(four_bars: la.Atlas) -> None:
    path = four_bars._path
    rod_angles = rod([100, 500, 40], 20)
    expected = la.match(rod_angles, 120, atlas=four_bars).to_dict()["matches"]
    for named in (path, str(path)):
        assert la.match(rod_angles, 120, atlas=named).to_dict()["matches"] == expected
    assert as_atlas(str(path)) is as_atlas(path) and as_atlas(four_bars) is four_bars
    position = np.exp(1j * np.deg2rad(np.linspace(0, 120, 13))) + 2 * np.exp(1j * np.deg2rad(rod_angles))
    rows = [
        la.synthesize(rod_angles, position, crank_span=120, effort="atlas", atlas=a, top=2) for a in (path, four_bars)
    ]
    assert rows[0].to_dict()["solutions"] == rows[1].to_dict()["solutions"] and len(rows[0].solutions) == 2
    with pytest.raises(la.AtlasError, match="no atlas file"):
        la.match(rod_angles, 120, atlas="no such atlas.h5")
    with pytest.raises(la.FieldError) as error:
        la.match(rod_angles, 120, atlas=3)  # type: ignore[arg-type]
    assert error.value.field == "/atlas"


WRONG = [({"mechanisms": kinds}, "/mechanisms") for kinds in ([], "every", ["four_bar"])]
WRONG += [({"mechanisms": ["four_bar", "six_bar"]}, "/mechanisms/1")]


@pytest.mark.parametrize(
    ("fields", "field"), [*WRONG, ({"mechanisms": ["slider_crank"], "curve": "rocker"}, "/curve")]
)
def test_what_is_refused(sliders: la.Atlas, fields: dict, field: str) -> None:
    with pytest.raises(la.FieldError) as error:
        la.match([0, 1, 3], 30, atlas=sliders, **fields)
    assert error.value.field == field


def test_a_kind_has_its_own_rule(tmp_path: Path) -> None:
    for wrong, field in (({"kind": "six_bar"}, "/kind"), ({"kind": "slider_crank", "order": "increasing"}, "/order")):
        with pytest.raises(la.FieldError) as error:
            la.build_atlas(tmp_path / "no.h5", **wrong)
        assert error.value.field == field
