"""The atlas of slider-cranks: the same file, index and scan as of four-bars, against all windows one by one."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from data_build.batch import build_atlas, local_executor
from synthesis.atlas import haar, window_index
from synthesis.atlas.file import decode_atlas, encode_atlas, load_atlas
from synthesis.atlas.scan import Scan
from synthesis.atlas.table import Atlas, AtlasRule, atlas_of_rule
from synthesis.atlas.windows import Windows, best_of, joined
from synthesis.errors import AtlasError
from synthesis.pose import objective
from synthesis.slider import SliderTypeRule
from synthesis.target import Target, make_target
from synthesis.work import Work
from tests.conftest import some_of
from tests.oracles.slider_crank import body_angle

RULE = AtlasRule(SliderTypeRule(30, 2), 64)
STARTS = 360


@pytest.fixture(scope="module")
def atlas() -> Atlas:
    return atlas_of_rule(RULE)


def test_a_row_is_the_curve_of_its_lengths(atlas: Atlas) -> None:
    crank = np.arange(64) * (2 * np.pi / 64)
    curves = haar.curve_from_features(atlas.average, atlas.details)
    np.testing.assert_allclose(curves, body_angle(atlas.lengths, crank), atol=1e-6)
    assert not atlas.winding.any()


def test_the_file_is_that_of_four_bars_with_a_kind(atlas: Atlas, tmp_path: Path) -> None:
    path = tmp_path / "slider.h5"
    with local_executor(1) as executor:
        build_atlas(RULE, path, executor)
    loaded = load_atlas(path)
    assert loaded.rule == RULE and loaded.mechanism is RULE.kind.mechanism and loaded.mechanism.kind == "slider_crank"
    for name in ("lengths", "average", "details", "winding", "curve_error"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(atlas, name))
    with h5py.File(path) as file:
        assert '"kind": "slider_crank"' in file.attrs["rule"] and "rod angle" in file.attrs["curve"]
        assert file["lengths"].shape == (len(atlas), 3) and "e offset" in file["lengths"].attrs["units"]
    assert "kind" not in AtlasRule().as_json()  # files of four-bars are what they were


def test_a_file_of_another_kind_than_its_rows_is_refused(atlas: Atlas) -> None:
    class Claims(AtlasRule):
        def as_json(self) -> dict[str, object]:
            return {**super().as_json(), "kind": "four_bar", "order": "increasing"}

    object.__setattr__(atlas, "rule", Claims(RULE.types, RULE.samples))
    try:
        with pytest.raises(AtlasError):
            decode_atlas(encode_atlas(atlas))
    finally:
        object.__setattr__(atlas, "rule", RULE)


def every_window(lengths: np.ndarray, target: Target) -> Windows:
    """All windows with their errors by the formula of books; branch -1 is the offset negated, and none where that is 0."""
    start, found = np.arange(STARTS), []
    crank = np.deg2rad(start)[:, None] + target.crank
    for row, one in enumerate(lengths.astype(float)):
        for side in (1, -1) if one[2] else (1,):
            angle = body_angle(np.tile(one * [1, 1, side], (STARTS, 1)), crank)
            found.append(Windows(np.full(STARTS, row), start, np.full(STARTS, side), objective(target, angle)))
    return joined(found)


SPANS = (20.0, 75.0, 200.0, 360.0)
WHAT = ("rotation", "position", "both", "noise")
CASES = [(SPANS[(k + turn) % len(SPANS)], WHAT[k % 4]) for turn in range(len(SPANS)) for k in range(4)]
"""The first four have each of what is asked for, the first eight each with two spans."""


@pytest.mark.parametrize(("span", "what"), some_of(CASES, 5))
def test_the_scan_is_the_sort_of_all_windows(atlas: Atlas, span: float, what: str, monkeypatch) -> None:
    for name in ("MOST_LEAVES", "LARGEST_LIMIT", "MOST_WINDOWS", "MOST_PLACED"):
        monkeypatch.setattr(window_index, name, np.inf)
    random, scan = np.random.default_rng(int(span)), Scan(atlas)
    crank = np.deg2rad(np.linspace(0, span, 11))
    lengths = atlas.lengths[random.integers(len(atlas))].astype(float)
    angle = body_angle([lengths * [1, 1.03, -1]], random.uniform(0, 6) + crank)[0]
    if what == "noise":
        angle = np.cumsum(random.normal(size=11))
    position = np.array([1, 0.3, -0.8]) @ [np.ones(11), np.exp(1j * crank), np.exp(1j * angle)]
    asked = None if what == "position" else angle, position if what in ("position", "both") else None
    target = make_target(*asked, crank_angle=crank)
    windows = every_window(atlas.lengths, target)
    for by_index in (False, True):
        if by_index:
            scan.prepare_short_spans(Work())
        for top in (1, 40):
            found, report = scan.best(target, top)
            best = best_of(windows, top)
            assert report.exhaustive and scan.windows == len(atlas) * 2 * STARTS
            np.testing.assert_allclose(found.error, best.error, rtol=1e-9, atol=1e-12)
            for column, wished in zip(found[:3], best[:3]):
                np.testing.assert_array_equal(column, wished)
