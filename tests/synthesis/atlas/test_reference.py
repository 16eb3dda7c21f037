"""Counts, numbers and features of the atlas have the published digits of `tests/reference`.

An atlas that no longer agrees with the paper would show here.
"""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest

import linkage_atlas as la
from synthesis.atlas import haar
from synthesis.four_bar import coupler_angle
from synthesis.fourbar.dimension_types import TypeRule, count_types, enumerate_types

PRINTED = json.loads((Path(__file__).parents[2] / "reference" / "sun_liu_chu.json").read_text())
HALF_OF_LAST_PLACE = 0.5e-4


@pytest.fixture(scope="module")
def types() -> np.ndarray:
    return enumerate_types(TypeRule(**PRINTED["rule"]))


def test_types_are_counted_and_numbered_as_printed(types) -> None:
    assert TypeRule() == TypeRule(**PRINTED["rule"])
    assert len(types) == count_types(TypeRule()) == PRINTED["count"]
    assert types[:10].tolist() == PRINTED["first_types"]
    assert types[PRINTED["numbered"]["number"] - 1].tolist() == PRINTED["numbered"]["lengths"]


def test_table_2_is_met_to_the_last_place() -> None:
    table = PRINTED["table_2"]
    crank = np.linspace(*np.deg2rad(table["crank_deg"]), 2 ** table["levels"])
    coupler = coupler_angle(PRINTED["numbered"]["lengths"], table["branch"], crank)
    body = table["body"]
    ends = {end: body[f"L_{end}"] * np.exp(1j * np.deg2rad(body[f"theta_{end}_deg"])) for end in "PQ"}
    line = (ends["Q"] - ends["P"]) * np.exp(1j * (coupler + np.deg2rad(body["theta4_deg"])))
    for name, curve in {"coupler": coupler, "body": np.unwrap(np.angle(line))}.items():
        average, details = haar.features(curve)
        assert average == pytest.approx(table["average"][name], abs=HALF_OF_LAST_PLACE)
        assert details[: len(table["details"])] == pytest.approx(table["details"], abs=HALF_OF_LAST_PLACE)
    assert np.angle(line * np.exp(-1j * coupler)) == pytest.approx(table["K"], abs=HALF_OF_LAST_PLACE)


def test_the_example_script_recognises_the_published_type_from_the_file(atlas_path, monkeypatch, capsys) -> None:
    """The script uses only h5py and pywt; `la.match` finds the same type at the same start."""
    script = Path(__file__).parents[3] / "docs" / "examples" / "ex11_atlas_and_wavelets.py"
    monkeypatch.setattr("sys.argv", [str(script), str(atlas_path)])
    pytest.importorskip("matplotlib.pyplot").switch_backend("agg")
    runpy.run_path(str(script))
    first, *recognised = capsys.readouterr().out.splitlines()
    digits = [float(word) for word in first.partition("details")[2].split()]
    assert digits == PRINTED["table_2"]["details"] and "1.0388" in first
    assert len(recognised) == 10 and "45185  [ 19  72 144 165]" in recognised[0]
    crank = np.deg2rad(np.linspace(30, 100, 16))
    curve = coupler_angle(PRINTED["numbered"]["lengths"], 1, crank)
    best = la.match(curve, np.deg2rad(70), atlas=atlas_path, degrees=False).matches
    assert len(best) == 10 and (best[0].type.number, best[0].branch) == (45_185, 1)
    assert best[0].start_angle == pytest.approx(np.deg2rad(30))
    # by Parseval the rms error is the distance of the orthonormal details
    weights = haar.block_roots(16) / 4
    for match in best:
        own = coupler_angle(match.type.lengths, match.branch, match.start_angle + crank - crank[0])
        gap = np.linalg.norm(weights * (haar.features(own)[1] - haar.features(curve)[1]))
        assert gap == pytest.approx(match.rotation_rms, abs=1e-12)
