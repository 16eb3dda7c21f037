"""What the lift's figures must show whatever the machine."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import report
from benchmarks.lift_pictures import REFERENCE, task
from synthesis.scenes.lift.optimum import ARMS, FITTED_LENGTHS, STROKE, Evaluator, Objective, project
from synthesis.scenes.lift.pose import Cylinder

RESULTS = report.load("lift")


def test_the_printed_f_are_met_as_said() -> None:
    """rms over the five lengths with a printed f, at n = 310 and at the n of least squares and its neighbours."""
    lengths = [length for length in ARMS if length not in FITTED_LENGTHS]

    def rms(n: int) -> float:
        misses = [
            float(Evaluator(task(Objective("discrete", n), cylinder=Cylinder(length, 100.0)))(on_constraints))
            - REFERENCE["table_2"][f"{length:g}"]["printed"]
            for length in lengths
            for on_constraints in (project(ARMS[length], ARMS[length], length, *STROKE),)
        ]
        return float(np.sqrt(np.mean(np.square(misses))))

    steps = RESULTS["steps"]
    assert rms(310) == pytest.approx(steps["rms_even"], rel=1e-9)
    assert rms(steps["fitted"]) == pytest.approx(steps["rms_fitted"], rel=1e-9)
    assert rms(steps["fitted"]) < min(rms(steps["fitted"] - 1), rms(steps["fitted"] + 1), rms(310))
