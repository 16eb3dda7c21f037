"""Residuals of the determination are the errors of the solution, wherever the crank starts.

The coupler of a double-crank turns with its crank: a start in the second half of its turn once put a whole turn into them.
"""

import numpy as np
import pytest

from synthesis.fourbar.determination import residuals
from synthesis.linkage import four_bar
from synthesis.solution import assess
from synthesis.target import make_target


@pytest.mark.parametrize("start", np.linspace(0, 6, 7))
def test_residuals_are_the_errors_of_a_double_crank(start) -> None:
    linkage = four_bar((90.0, 70.0, 80.0, 40.0), 1, start, 3 + 4j, 0.5, (60.0, 0.4), 0.0)
    crank = np.linspace(0, 2.0, 9)
    body = linkage.motions(crank)[1]
    noise = np.random.default_rng(1).normal(size=(2, 9))
    target = make_target(body.angle + 0.02 * noise[0], body.origin + noise[1], crank_angle=crank)
    (solution,) = assess(target, [linkage])
    remaining = residuals(target, [solution.linkage])[0]
    assert np.sqrt(remaining @ remaining) == pytest.approx(solution.errors.objective, rel=1e-9)
