"""The crescent and its slot, compared with published values and with an independent implementation.

The tests would detect a wrong critical closure, a wrong order of the crossings, and a chain whose links change
length.
"""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.errors import FieldError
from synthesis.scenes.chain.closure import closing_links
from synthesis.scenes.chain.crescent import Dimensions
from synthesis.scenes.chain.slot import analyse_slot, crescent_slot, pins_at

REFERENCE = json.loads((Path(__file__).parents[3] / "reference" / "chain.json").read_text())
PRINTED, AS_PRINTED, CANONICAL = REFERENCE["published"], REFERENCE["as_printed"], REFERENCE["canonical"]
L, N, R1 = 131.0, 16, 181.78
R0 = L / math.sqrt(2)


@pytest.fixture(scope="module")
def canonical():
    return crescent_slot(Dimensions(L, N, R1))


@pytest.fixture(scope="module")
def printed():
    radii = (PRINTED["wheel_radius"], PRINTED["lower_radius"], PRINTED["eccentricity"])
    return crescent_slot(Dimensions(L, N, R1, *radii))


# Published numbers


def test_p1_p2_p6_p7_p8_critical_closure_gives_the_printed_layout(canonical, printed) -> None:
    crescent = canonical[0]
    assert crescent.wheel_radius == pytest.approx(PRINTED["wheel_radius"], abs=0.005)
    assert crescent.lower_radius == pytest.approx(PRINTED["lower_radius"], abs=0.01)
    assert crescent.eccentricity == pytest.approx(PRINTED["eccentricity"], abs=0.01)
    assert math.degrees(crescent.xi) == pytest.approx(PRINTED["xi_deg"], abs=0.05)
    assert math.degrees(crescent.alpha) == pytest.approx(PRINTED["alpha_deg"], abs=0.05)
    for layout in (crescent, printed[0]):
        assert math.degrees(layout.xi + layout.alpha) == pytest.approx(90, abs=1e-9)


def test_p5_sixteen_links_close(canonical, printed) -> None:
    assert closing_links(printed[0].track, L) == PRINTED["links"]
    assert closing_links(canonical[0].track, L) == PRINTED["links"]


# Regression values


# Laws


@settings(derandomize=True, deadline=None, max_examples=6)
@given(
    upper=st.floats(0.8, 6),
    wheel=st.floats(0.55, 2),
    links=st.integers(5, 60),
    scale=st.sampled_from([1e-9, 1.0, 131.0, 1e9 / 40]),
)
def test_a_chain_closes_or_the_error_gives_the_number_of_links(upper, wheel, links, scale) -> None:
    try:
        crescent, slot = crescent_slot(Dimensions(scale, links, upper * scale, wheel * scale))
    except FieldError as error:
        assert error.field == "/links" and error.details["amount"] > 0
        missing = error.details["nearest_links"] > links
        assert ("missing_length" if missing else "excess_length") in error.details
        links = error.details["nearest_links"]
        crescent, slot = crescent_slot(Dimensions(scale, links, upper * scale, wheel * scale))
    facts = analyse_slot(slot, np.linspace(slot.start, slot.end, 31))
    assert closing_links(crescent.track, scale) == links
    assert facts.chord_error < 1e-12 * scale * max(1, crescent.lower_radius / scale)
    assert abs(facts.slack_min) < 1e-9 * scale
    assert facts.end_step < 1e-8 * scale
    assert 0 <= slot.start < slot.chain.period
    # the results are proportional to the unit of length
    _, unit = crescent_slot(Dimensions(1.0, links, upper, wheel))
    phases = np.linspace(0, 1, 7)
    here = slot.path(slot.start + phases * slot.chain.period) / scale
    # the phase of a minimum is known to the square root of the rounding error, but the slot does not move with it
    assert slot.free == unit.free
    assert np.abs(here - unit.path(unit.start + phases * unit.chain.period)).max() < 1e-6


# All pins and their angles

PHASES = 9001


@pytest.fixture(scope="module")
def found(canonical):
    crescent, slot = canonical
    phases = np.linspace(slot.start, slot.end, PHASES)
    return crescent, slot, pins_at(crescent, slot, phases)


def test_the_angles_determine_the_position_of_every_pin(found) -> None:
    """Convert the angles back to points by the definitions of the source."""
    crescent, slot, pins = found
    theta = pins.theta
    r0, r1, r2, b = crescent.wheel_radius, crescent.upper_radius, crescent.lower_radius, crescent.eccentricity
    c = r0 + r1
    back = {
        0: -c + r0 * np.exp(1j * theta),
        1: 1j * b + r2 * np.exp(1j * (theta - np.pi / 2)),
        2: c + r0 * np.exp(1j * (np.pi - theta)),
        3: r1 * np.exp(1j * (theta - np.pi / 2)),
    }
    for pin in set(range(16)) - {slot.free - 1}:
        points = np.choose(pins.segment[:, pin], [back[part][:, pin] for part in range(4)])
        assert np.abs(points - pins.points[:, pin]).max() < 1e-9, pin
    free = slot.free - 1
    radius = np.abs(pins.points[:, free])
    assert np.abs(radius * np.exp(1j * (theta[:, free] - np.pi / 2)) - pins.points[:, free]).max() < 1e-9
