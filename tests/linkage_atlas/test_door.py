"""The Python interface takes arrays, names wrong arguments and gives the same answers as HTTP.

An argument that is read differently, or an import that loads heavy libraries, would show here.
"""

import dataclasses
import doctest
import importlib
import json
import pkgutil
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import linkage_atlas as la
from app.main import create_app
from app.registry import worked_example
from app.settings import Settings
from linkage_atlas.limits import LIMITS

ROOT = Path(__file__).parents[2]
EXAMPLE = worked_example()
LENGTHS = (19.0, 72.0, 144.0, 165.0)
LAW = settings(derandomize=True, deadline=None, max_examples=60)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[la.Atlas, Path]:
    path = tmp_path_factory.mktemp("door") / "small.h5"
    return la.build_atlas(path, 60, 2, "full_crank", 32, jobs=1), path


@pytest.fixture(scope="module")
def found() -> la.Result:
    return la.synthesize(**EXAMPLE, top=2, sensitivity=True, round_to=1.0)


turned = np.deg2rad
"""Degrees as radians."""


# -- synthesize -------------------------------------------------------------------------------------------------------


def test_the_worked_example_is_solved(found) -> None:
    assert found.status == "reached" and found.report.stopped_by == "tolerance"
    linkage = found.linkage
    assert linkage is found.solutions[0].linkage and found.best is found.solutions[0]
    assert linkage.links == pytest.approx(LENGTHS, abs=1e-6) and linkage.branch == 1
    assert (linkage.start_angle, linkage.ground_angle) == pytest.approx((30, 30), abs=1e-6)
    assert linkage.coupler_point_polar == pytest.approx((20, 60), abs=1e-5)
    joints = linkage.joints(np.linspace(0, EXAMPLE["crank_span"], 16))
    assert joints.body_point == pytest.approx(np.array(EXAMPLE["position"]), abs=1e-8)
    assert joints.rotation == pytest.approx(np.array(EXAMPLE["rotation"]), abs=1e-7)
    assert "reached: 2 solutions" in repr(found) and "crank_rocker" in repr(found)


def test_answers_are_indexed_counted_and_iterated(found, built) -> None:
    generators = la.function([0, 12, 31, 62, 90], 80, top=2)
    matches = la.match(EXAMPLE["rotation"], EXAMPLE["crank_span"], atlas=built[0], top=3)
    for answer, listed in ((found, found.solutions), (generators, generators.solutions), (matches, matches.matches)):
        assert answer and len(answer) == len(listed) > 1 and list(answer) == listed
        assert answer[0] is listed[0] and answer[-1] is listed[-1] and answer[1:] == listed[1:]
        with pytest.raises(IndexError):
            answer[len(listed)]
    nothing = la.synthesize([0, 8, 19, 31], crank_span=90, limits={"link_min": 5, "link_max": 5.1})
    assert nothing.status == "infeasible" and len(nothing) == 0 and not nothing


def test_radians_go_in_and_come_out(found) -> None:
    limits = {"transmission_angle_min": 20.0}
    old = la.synthesize(**EXAMPLE, top=1, limits=limits, sensitivity=True)
    limits = {"transmission_angle_min": turned(20.0)}
    request = turned(EXAMPLE["rotation"]), EXAMPLE["position"], turned(70)
    new = la.synthesize(*request, top=1, limits=limits, degrees=False, sensitivity=True)
    linkage, second = old.linkage, new.linkage
    assert second.links == pytest.approx(linkage.links, rel=1e-6)
    for name in ("start_angle", "ground_angle", "body_offset"):
        assert getattr(second, name) == pytest.approx(turned(getattr(linkage, name)), abs=1e-6), name
    assert second.coupler_point_polar[1] == pytest.approx(turned(linkage.coupler_point_polar[1]), abs=1e-6)
    assert new.best.transmission_angle_min == pytest.approx(turned(old.best.transmission_angle_min), abs=1e-6)
    for ours, theirs in zip(new.best.sensitivity, old.best.sensitivity):
        assert ours.rotation == pytest.approx(turned(theirs.rotation), rel=1e-5)
        assert ours.position == pytest.approx(theirs.position, rel=1e-5)
    crank = np.linspace(0, 70, 5)
    assert second.joints(turned(crank)).rotation == pytest.approx(turned(linkage.joints(crank).rotation), abs=1e-6)


def without_times(reply: dict[str, Any]) -> dict[str, Any]:
    report = {k: v for k, v in reply["report"].items() if k not in ("elapsed_ms", "trace")}
    return reply | {"report": report | {"objectives": [objective for _, objective in reply["report"]["trace"]]}}


FREE = {"rotation": [None, 12, 27, 45, 66], "position": [[0, 0], [22, 5], [41, 17], None, [50, 58]], "timing": "free"}


def test_the_reply_over_http_is_the_result_as_a_dict(built) -> None:
    atlas, path = built
    with TestClient(create_app(Settings(atlas=path, workers=1))) as client:
        for request in (EXAMPLE, EXAMPLE | {"effort": "atlas"}, FREE):
            request = request | {"top": 2, "round_to": 0.5, "sensitivity": True}
            reply = client.post("/v2/synthesize", json=request)
            assert reply.status_code == 200
            mine = la.synthesize(**request, budget=30, atlas=atlas).to_dict()
            assert without_times(reply.json()) == without_times(json.loads(json.dumps(mine)))


def test_a_budget_and_cancelled_work_end_the_search() -> None:
    noise = np.random.default_rng(1).normal(size=40).cumsum()
    result = la.synthesize(noise, crank_span=300, budget=0.05, limits={"family": "any"})
    assert result.status == "closest" and result.report.stopped_by == "budget"
    with pytest.raises(la.Cancelled):
        la.synthesize(noise, crank_span=300, work=lambda budget: la.Work(budget, lambda: True))


def test_a_wrapped_rotation_goes_the_short_way_and_that_is_said(built) -> None:
    complete = np.linspace(0, 40, 16)
    for low in (0.0, -180.0):
        wrapped = [(value + 345) % 360 + low for value in complete]
        for degrees, unit in ((True, 1.0), (False, np.pi / 180)):
            request = la.Motion(np.multiply(wrapped, unit), crank_span=70 * unit, degrees=degrees)
            assert np.diff(request.samples.rotation) == pytest.approx(np.deg2rad(np.diff(complete)), abs=1e-12)
            assert "the short way" in request.notes()[0]
    found = la.synthesize([340, 350, 0, 10], crank_span=60, top=1)
    assert found.best.errors.rotation_max < 0.2
    assert "from sample 2 (350) to 3 (0) is taken as a turn of 10 degrees" in found.report.notes[0]
    assert la.match([340, 350, 0, 10], 60, top=1, atlas=built[0]).report.notes == found.report.notes[:1]


WRONG = [
    (table["of"], table["base"] | change, field, *words)
    for table in json.loads((Path(__file__).parent / "wrong.json").read_text())
    for change, field, *words in table["wrong"]
]
"""Calls with wrong arguments, the field that is named, and words of the message."""
SOLIDS = la.FourBar(*LENGTHS, start_angle=30, coupler_point_polar=(20, 60), body_offset=-76).solids
CALLS = {"solids": SOLIDS, "assembly": lambda linkage, **options: la.Linkage.from_dict(linkage).assembly(**options)}


@pytest.mark.parametrize("row", WRONG, ids=lambda row: f"{row[0]} {row[2]} {' '.join(row[3:])}")
def test_what_is_wrong_is_named(row) -> None:
    name, arguments, field, *words = row
    with pytest.raises(la.FieldError) as caught:
        CALLS.get(name, getattr(la, name, None))(**arguments)
    assert caught.value.field == field and all(word in caught.value.message for word in words)


# -- atlases and match ------------------------------------------------------------------------------------------------


def test_a_bad_atlas_and_a_bad_rule_are_named(built, tmp_path) -> None:
    with pytest.raises(la.AtlasError) as caught:
        la.load_atlas(tmp_path / "none.h5")
    assert caught.value.fault is la.AtlasFault.MISSING
    for limits in ({"max_bytes": 100}, {"max_types": 10}):
        with pytest.raises(la.AtlasError) as caught:
            la.load_atlas(str(built[1]), **limits)
        assert caught.value.fault is la.AtlasFault.LIMIT
    for name, value in {"perimeter": 3, "smallest": 0, "order": "any", "samples": 100}.items():
        with pytest.raises(la.FieldError) as wrong:
            la.build_atlas(tmp_path / "atlas.h5", **({"perimeter": 60} | {name: value}))
        assert wrong.value.field == f"/{name}"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("degrees", [True, False], ids=["degrees", "radians"])
def test_a_row_of_the_atlas_is_matched_to_itself(built, degrees) -> None:
    atlas, _ = built
    unit = 1.0 if degrees else np.pi / 180
    number = 321
    lengths = atlas[number].lengths
    row = la.FourBar(*lengths, branch=-1, start_angle=40 * unit, degrees=degrees)
    crank = np.linspace(0, 200, 30) * unit
    rotation = row.joints(crank).rotation + 25 * unit
    matches = la.match(rotation, crank[-1], atlas=atlas, degrees=degrees, top=4)
    first = matches.matches[0]
    assert (first.type.number, first.type.lengths, first.branch) == (number, lengths, -1)
    assert first.start_angle == pytest.approx(40 * unit) and first.rotation_rms < 1e-9 * unit
    assert [m.rank for m in matches.matches] == [1, 2, 3, 4]
    # the linkage of a match performs the requested rotation: its offset is its body's
    assert first.linkage.joints(crank).rotation == pytest.approx(rotation, abs=1e-9)
    assert first.offset == first.linkage.body_offset
    for match in matches.matches:
        gap = match.linkage.joints(crank).rotation - rotation
        assert np.sqrt(np.mean(gap**2)) == pytest.approx(match.rotation_rms, abs=1e-9)
    values = matches.to_dict()
    assert json.loads(json.dumps(values)) == values and "4 matches" in repr(matches)
    with pytest.raises(la.FieldError, match="top"):
        la.match(rotation, crank[-1], atlas=atlas, top=0)


# -- the four-bar -----------------------------------------------------------------------------------------------------

length, angle, coordinate = st.floats(0.5, 20), st.floats(-400, 400), st.floats(-50, 50)


def linkages_in(degrees: bool) -> st.SearchStrategy[la.FourBar]:
    # the longest link is scaled so that the loop can be assembled
    lengths = st.tuples(*[length] * 4).map(
        lambda four: tuple(min(side, (sum(four) - max(four)) * 0.999) for side in four)
    )
    return st.builds(
        lambda lengths, branch, **more: la.FourBar(*lengths, branch, **more),
        lengths,
        st.sampled_from([1, -1]),
        start_angle=angle,
        pivot_a=st.tuples(coordinate, coordinate),
        ground_angle=angle,
        coupler_point_polar=st.one_of(st.none(), st.tuples(length, angle)),
        body_offset=st.one_of(st.none(), angle),
        degrees=st.just(degrees),
    )


linkages = st.booleans().flatmap(lambda degrees: st.tuples(linkages_in(degrees), st.just(degrees)))


def distance(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return np.linalg.norm(first - second, axis=-1)


@LAW
@given(linkages, st.lists(angle, min_size=1, max_size=5))
def test_links_keep_their_lengths_wherever_the_loop_closes(linkage, crank) -> None:
    four_bar, degrees = linkage
    joints = four_bar.joints(crank)
    assert joints.pivot_a.shape == joints.pivot_b.shape == (2,)
    assert joints.crank_pin.shape == joints.coupler_pin.shape == (len(crank), 2)
    closed = np.isfinite(joints.coupler_pin).all(axis=1)
    assume(closed.any())
    a, b, d, c = joints.pivot_a, joints.pivot_b, joints.crank_pin[closed], joints.coupler_pin[closed]
    rounding = 1e-10 * (1 + np.abs(four_bar.links).max())
    for found, expected in zip((distance(d, a), distance(c, d), distance(c, b), distance(b, a)), four_bar.links):
        assert np.all(np.abs(found - expected) < rounding)
    # the directions are the links' directions, the branch is the side of C
    radian = np.pi / 180 if degrees else 1.0
    for pin, second, direction in ((d, a, joints.crank_direction), (c, d, joints.coupler_direction)):
        ray = np.stack([np.cos(direction[closed] * radian), np.sin(direction[closed] * radian)], axis=1)
        assert np.all(np.abs(pin - second - ray * distance(pin, second)[:, None]) < rounding)
    across = (b - d)[:, 0] * (c - d)[:, 1] - (b - d)[:, 1] * (c - d)[:, 0]
    assert np.all(four_bar.branch * across > -rounding * np.abs(four_bar.links).max())
    assert (joints.body_point is None) == (four_bar.coupler_point_polar is None)
    if four_bar.coupler_point_polar is not None:
        assert np.all(np.abs(distance(joints.body_point[closed], d) - four_bar.coupler_point_polar[0]) < rounding)


@LAW
@given(linkages)
def test_a_linkage_comes_back_from_its_dict(linkage) -> None:
    four_bar, degrees = linkage
    values = json.loads(json.dumps(four_bar.to_dict()))
    back = la.Linkage.from_dict(values, degrees)
    assert np.array_equal(back.links, four_bar.links) and (back.branch, back.family) == (
        four_bar.branch,
        four_bar.family,
    )
    for name in ("start_angle", "ground_angle", "body_offset", "coupler_point_polar", "pivot_a", "pivot_b"):
        expected = getattr(four_bar, name)
        if expected is None:
            assert getattr(back, name) is None
        else:
            assert getattr(back, name) == pytest.approx(expected, rel=1e-12, abs=1e-12), name


# -- the module -------------------------------------------------------------------------------------------------------

HEAVY = {"numpy", "h5py", "pywt", "scipy", "pydantic", "fastapi", "ezdxf", "matplotlib"}


def fresh(code: str) -> str:
    """Return the output of a new process."""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_the_import_loads_nothing_heavy() -> None:
    assert not HEAVY & set(fresh("import sys, linkage_atlas; print(*sys.modules)").split())


@pytest.mark.timed
def test_the_import_costs_little() -> None:
    code = "import time; begin = time.process_time(); import linkage_atlas; print(time.process_time() - begin)"
    assert min(float(fresh(code)) for _ in range(5)) < 0.15


def test_every_name_of_the_door_is_there_and_no_other() -> None:
    assert dir(la) == sorted(la.__all__) and len(set(la.__all__)) == len(la.__all__)
    for name in la.__all__:
        assert getattr(la, name) is not None
    with pytest.raises(AttributeError, match="synthesise"):
        _ = la.synthesise


def test_the_examples_of_the_docstrings_are_true() -> None:
    names = [module.name for module in pkgutil.walk_packages(la.__path__, "linkage_atlas.")]
    names += ["linkage_atlas", "synthesis.atlas.haar", "synthesis.errors", "synthesis.work"]
    results = [doctest.testmod(importlib.import_module(name)) for name in names]
    assert sum(result.failed for result in results) == 0


@pytest.mark.parametrize("name", [name for name in la.__all__ if callable(getattr(la, name))])
def test_public_docstrings_are_complete(name) -> None:
    """Parameters, returned values and fields of records are described, and there is an example."""
    validate = pytest.importorskip("numpydoc.validate").validate
    optional = {"ES01", "SA01"}  # extended summary, see also
    if name.endswith(("batch", "batch_commands")):  # the commands of the batch job have no use in Python
        optional.add("EX01")
    if name == "AtlasFault":
        optional.add("PR01")  # numpydoc takes the arguments of `enum.Enum` as parameters
    assert [error for error in validate(f"linkage_atlas.{name}")["errors"] if error[0] not in optional] == []


def test_the_fields_of_limits_are_described_and_checked_by_name() -> None:
    described = re.findall(r"^    (\w+) : ", la.Limits.__doc__ or "", re.MULTILINE)
    assert described == [field.name for field in dataclasses.fields(la.Limits)] == [*LIMITS, "preset"]
    with pytest.raises(la.FieldError, match="near: link_max"):
        la.Limits(link_mx=200)


def test_a_table_is_a_motion(tmp_path) -> None:
    table = tmp_path / "poses.csv"
    table.write_text("x,y,angle\n0,0,350\n6,2,10\n12,2,30\n")
    motion = la.Motion.from_table(table, unwrap=True)
    assert motion.free and np.rad2deg(motion.samples.rotation).tolist() == pytest.approx([350, 370, 390])
    assert not la.Motion.from_table(table, crank_span=80).free


def lengths(*links: float) -> dict[str, float]:
    return dict(zip(("crank", "coupler", "rocker", "ground"), links))


@pytest.mark.parametrize(
    ("angles", "reported"),
    [
        ({"crank_span": 1.57}, "crank"),
        ({"crank_angle": [0, 0.4, 0.79, 1.57]}, "crank"),
        ({"crank_span": 5}, None),
        ({"crank_span": 90}, None),
        ({"rotation": [0, 0.2, 0.5, 1.13], "crank_span": 90}, "rotation"),
        ({"rotation": [0, 0.2, 0.5, 1.13], "position": None, "crank_span": 90}, "rotation"),
        ({"rotation": [0, 0.2, 0.5, 0.9], "crank_span": 90}, None),
        ({"crank_span": 45, "rotation": [0, 0.2, 0.5, 1.13], "degrees": False}, "crank"),
    ],
)
def test_angles_that_look_as_if_in_the_other_unit_are_asked_about(angles, reported) -> None:
    motion = la.Motion(**{"rotation": [0, 10, 25, 45], "position": [[0, 0], [50, 10], [100, 35], [140, 75]]} | angles)
    assert [note.split()[1] for note in motion.notes() if "taken in" in note] == (
        [] if reported is None else [reported]
    )


@pytest.mark.parametrize("name", ["rotation", "position"])
def test_what_is_behind_a_mask_is_not_taken(name) -> None:
    motion = {"rotation": np.array([0.0, 10, 25]), "position": np.array([[0.0, 0], [50, 10], [99, 30]])}
    motion[name] = np.ma.array(motion[name], mask=np.arange(motion[name].size).reshape(motion[name].shape) == 1)
    with pytest.raises(la.FieldError, match="without a mask") as error:
        la.Motion(**motion, timing="free")
    assert error.value.field == f"/{name}"
