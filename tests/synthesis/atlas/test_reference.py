"""The published digits: `tests/reference`."""

import json
from pathlib import Path

import numpy as np
import pytest

from synthesis.atlas import haar
from synthesis.fourbar.dimension_types import TypeRule, count_types, enumerate_types
from synthesis.fourbar.kinematics import coupler_angle

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
