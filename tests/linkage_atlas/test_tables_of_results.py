"""Results are sequences and pandas tables, motions come from tables, and errors can be handed to an optimiser.

A column under a wrong name, an error in another unit, or an atlas counted from 0 would show here.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

import linkage_atlas as la

CASEMENT = Path(__file__).parents[2] / "app" / "examples" / "casement.csv"
POSITION = [[0, 0], [40, 8], [75, 30], [90, 60], [95, 90]]
ROTATION = [0, 10, 25, 40, 50]


@pytest.fixture
def pandas():
    """Imported here: every process of the tests reads this file."""
    return pytest.importorskip("pandas")


def test_a_motion_is_read_from_a_path_a_buffer_and_a_pandas_table(pandas) -> None:
    motion = la.Motion.from_table(CASEMENT)
    table = pandas.read_csv(CASEMENT, sep=";", decimal=",").rename(columns={"x": "TX", "y": "TY", "phi": "RZ"})
    buffers = (CASEMENT.open(), CASEMENT.open("rb"), io.StringIO(CASEMENT.read_text()))
    columns = {"x": "TX", "y": "TY", "angle": "RZ"}
    motions = [*map(la.Motion.from_table, buffers), la.Motion.from_table(table, columns=columns)]
    for read in motions:
        assert np.array_equal(read.position, motion.position) and np.array_equal(read.rotation, motion.rotation)
    for buffer in buffers:
        buffer.close()


def test_results_are_sequences_with_a_table(pandas) -> None:
    motion = la.Motion(ROTATION, POSITION)
    result = la.synthesize(motion, top=3)
    drives = la.drives(result.linkage, [{"kind": "rotary"}], load={"torque": 10})
    for answer, name in ((result, "solutions"), (drives, "drives")):
        assert list(answer) == getattr(answer, name) and answer[0] is getattr(answer, name)[0] and len(answer) > 0
    table = result.to_dataframe()
    assert table["errors.position_max"].tolist() == [solution.errors.position_max for solution in result]
    assert table["links.crank"].tolist() == [solution.linkage.crank for solution in result]
    assert table["mount.pivot_a.0"][0] == result.linkage.pivot_a[0]
    crank = [table[f"crank_angle.{k}"] for k in range(len(motion))]
    assert np.transpose(crank).tolist() == [solution.crank_angle.tolist() for solution in result]
    assert not any("curve" in name for name in drives.to_dataframe())
    assert drives.to_dataframe()["kind"].tolist() == ["rotary"]


@pytest.mark.parametrize("degrees", [True, False])
@pytest.mark.parametrize("arguments", [{}, {"crank_span": 60.0}, {"closed": True, "order": "any"}])
def test_the_objective_is_that_of_the_solution(degrees, arguments) -> None:
    unit = 1.0 if degrees else np.deg2rad(1.0)
    weights = {"rotation": [1, 0, 2, 1, 1], "position": [1, 1, 1, 3, 1]}
    arguments = {name: value * unit if name == "crank_span" else value for name, value in arguments.items()}
    motion = la.Motion(np.array(ROTATION) * unit, POSITION, weights=weights, degrees=degrees, **arguments)
    best = la.synthesize(motion, la.Limits(preset="none"), top=1).best
    assert la.objective(best.linkage, motion) == la.objective(best, motion)
    assert la.objective(best, motion) == pytest.approx(best.errors.objective, rel=1e-6, abs=1e-9)
    errors = la.residuals(best.linkage, motion, None if best.crank_angle is None else best.crank_angle)
    assert errors.shape == (15,) and errors[1] == 0


def test_free_crank_angles_of_another_linkage_are_needed() -> None:
    with pytest.raises(la.FieldError, match="travel"):
        la.objective(la.FourBar(19, 72, 144, 165), la.Motion(position=POSITION))


def test_types_of_an_atlas_are_counted_from_one(small_bytes, tmp_path) -> None:
    (tmp_path / "small.h5").write_bytes(small_bytes)
    atlas = la.load_atlas(tmp_path / "small.h5")
    assert [kind.number for kind in atlas] == list(range(1, len(atlas) + 1))
    assert atlas[len(atlas)].lengths == list(atlas)[-1].lengths
    for number in (0, -1, len(atlas) + 1):
        with pytest.raises(IndexError, match=str(number)):
            atlas[number]
    curve = np.cumsum(np.arange(8.0))
    assert np.allclose(la.haar.curve_from_features(*la.haar.features(curve)), curve)
