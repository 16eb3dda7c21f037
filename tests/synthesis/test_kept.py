"""What a search leaves for the next one: the same numbers after a journey as bytes, and in a mirror."""

import numpy as np
import pytest

from synthesis.fourbar.linkage import Linkage
from synthesis.fourbar.mechanism import GrashofChart
from synthesis.kept import Kept
from synthesis.target import make_target

CRANK = np.linspace(0, 1.2, 7)
LINKAGES = [
    Linkage((19, 72, 144, 165), 1, 0.5, 3 + 4j, 0.3, (20, 1.1), -0.2),
    Linkage((50, 40, 60, 20), -1, 4.0, -1j, 2.0, (7, 0.0), None),
    Linkage((50, 60, 60, 80), 1, 1.0, 0j, 0.0, None, None),
]


@pytest.fixture
def kept() -> Kept:
    return Kept.of([(one, CRANK) for one in LINKAGES], 5)


def test_bytes_hold_all_numbers(kept) -> None:
    again = Kept.unpacked(kept.packed())
    assert again.searches == 5
    for mine, theirs in zip(kept[1:], again[1:]):
        np.testing.assert_array_equal(mine, theirs)
    assert Kept.unpacked(b"").packed() == b"" and not len(Kept.unpacked(b"").branch)


def test_two_mirrors_are_none(kept) -> None:
    for mine, theirs in zip(kept[1:], kept.mirrored().mirrored()[1:]):
        np.testing.assert_array_equal(mine, theirs)


def test_candidates_draw_what_the_linkages_do(kept) -> None:
    some = kept.among("full_crank")
    assert [tuple(row) for row in some.links] == [LINKAGES[0].links, LINKAGES[1].links]
    assert len(kept.among("any").branch) == len(kept.among("double_crank").branch) == 1
    for k, one in enumerate(LINKAGES[:2]):
        wanted = one.joints(CRANK).body_point
        target = make_target(position=wanted, crank_angle=CRANK)
        chart = GrashofChart()
        timed = some.candidates(target, chart, some.crank).take([k])
        body = chart.at(timed.shape, timed.angles, timed.branch, derivatives=False)
        (a, z1, z2), scale = timed.pose[0], target.length_scale
        found = target.middle + scale * (a + z1 * np.exp(1j * timed.angles[0]) + z2 * np.exp(1j * body.angle[0]))
        np.testing.assert_allclose(found, wanted, atol=1e-12 * scale)


@pytest.mark.parametrize("samples", [2, 6, 8, 20])
def test_crank_angles_at_other_samples_go_the_same_way(kept, samples) -> None:
    crank = kept.at(samples)
    assert crank.shape == (3, samples) and np.all(np.diff(crank) > 0)
    np.testing.assert_allclose(crank[:, [0, -1]], CRANK[[0, -1]][None].repeat(3, 0))
