"""Matches are the same from an atlas, its path, and its file that is opened once."""

import numpy as np
import pytest

import linkage_atlas as la
from linkage_atlas.atlases import as_atlas


@pytest.fixture(scope="module")
def four_bars(tmp_path_factory: pytest.TempPathFactory) -> la.Atlas:
    return la.build_atlas(tmp_path_factory.mktemp("match") / "atlas.h5", 80, samples=64, jobs=1)


def test_an_atlas_is_named_by_its_path_and_opened_once(four_bars: la.Atlas) -> None:
    path = four_bars._path
    rotation = np.sin(np.linspace(0, 1, 13)).tolist()
    expected = la.match(rotation, 120, atlas=four_bars).to_dict()["matches"]
    for named in (path, str(path)):
        assert la.match(rotation, 120, atlas=named).to_dict()["matches"] == expected
    assert as_atlas(str(path)) is as_atlas(path) and as_atlas(four_bars) is four_bars
    position = np.exp(1j * np.deg2rad(np.linspace(0, 120, 13))) + 2 * np.exp(1j * np.deg2rad(rotation))
    rows = [
        la.synthesize(rotation, position, crank_span=120, effort="atlas", atlas=a, top=2) for a in (path, four_bars)
    ]
    assert rows[0].to_dict()["solutions"] == rows[1].to_dict()["solutions"] and len(rows[0].solutions) == 2
    with pytest.raises(la.AtlasError, match="no atlas file"):
        la.match(rotation, 120, atlas="no such atlas.h5")
    with pytest.raises(la.FieldError) as error:
        la.match(rotation, 120, atlas=3)  # type: ignore[arg-type]
    assert error.value.field == "/atlas"
