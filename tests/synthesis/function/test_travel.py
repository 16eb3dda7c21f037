"""Functions with travel agree with the kinematics of their linkages, and derivatives with differences.

A slider, cylinder or crank that is measured from a wrong origin would show here.
"""

import numpy as np
import pytest

from synthesis.function.travel_search import ANGLE, LAWS, Law
from synthesis.guides import Circle

every_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: f"{law.kind}-{law.driver}")


def candidates(law: Law, count: int = 40) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unknowns (n, 5), branches and an input (M,) over which all close."""
    random, found, sides = np.random.default_rng(3), [], []
    travel = np.linspace(0.0, 0.9, 13)
    while len(found) < count:
        row = np.concatenate([random.uniform(-1, 1, 3), [random.uniform(-3, 3)], [0.3]])
        row[law.size : 3] = 0.0
        side = np.array([float(random.choice(law.branches))])
        if law.at(row[None], side, travel[None]).possible.all() and law.sines(row[None], travel[None]).min() > 0.05:
            found.append(row)
            sides.append(side[0])
    return np.array(found), np.array(sides), travel


@every_law
def test_the_output_is_that_of_the_linkage(law: Law) -> None:
    unknowns, branch, travel = candidates(law)
    value = law.at(unknowns, branch, np.broadcast_to(travel, (len(unknowns), travel.size))).value
    sine = law.sines(unknowns, np.broadcast_to(travel, (len(unknowns), travel.size)))
    for unknown, side, row, smallest in zip(unknowns, branch, value, sine):
        linkage = law.linkage(law.of(unknown[None])[0], int(side), float(unknown[3]))
        assert linkage.kind is law.kind and linkage.driver is law.driver
        start = linkage.start - unknown[3]
        start = np.mod(start + np.pi, 2 * np.pi) - np.pi if law.input == ANGLE else start
        assert start == pytest.approx(0, abs=1e-9)
        body = linkage.body(linkage.start + travel)
        second = linkage.guides[1]
        if law.output == ANGLE:
            if isinstance(second, Circle):
                point = body.position + np.exp(1j * body.rotation) * second.body_point
                built = np.angle(point - second.pivot)
            else:
                built = body.rotation
            np.testing.assert_allclose(np.exp(1j * built), np.exp(1j * row), atol=1e-9)
        else:
            np.testing.assert_allclose(linkage.along(1, travel), row, atol=1e-9)
        np.testing.assert_allclose(np.sin(body.transmission_angle), np.abs(smallest), atol=1e-7)


@every_law
def test_slopes_are_derivatives(law: Law) -> None:
    unknowns, branch, travel = candidates(law)
    positions, h = np.broadcast_to(travel, (len(unknowns), travel.size)), 1e-6
    found = law.at(unknowns, branch, positions)
    for k in [*range(law.size), 3]:
        ends = [law.at(unknowns + sign * h * np.eye(5)[k], branch, positions).value for sign in (1, -1)]
        difference = ends[0] - ends[1]
        if law.output == ANGLE:
            difference -= 2 * np.pi * np.round(difference / (2 * np.pi))
        np.testing.assert_allclose(found.slope[:, k], difference / (2 * h), rtol=1e-5, atol=1e-6)
