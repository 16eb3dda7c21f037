"""Linkages are ordered by the documented criteria, each before the next.

A linkage in front that cannot be used, or that is huge, would show here.
"""

from dataclasses import replace

import numpy as np
import pytest

from synthesis.ranking import PREFERENCES, Score, key

COMPACT = Score(
    usable=True,
    error=5e-4,
    size=2.0,
    transmission=np.deg2rad(50.0),
    swing=1.0,
    ratio=3.0,
    longest=30.0,
    accurate=True,
)


def first(prefer: str, *scores: Score) -> Score:
    return min(scores, key=lambda score: key(score, prefer))


@pytest.mark.parametrize("prefer", PREFERENCES)
@pytest.mark.parametrize(
    "worse",
    [
        replace(COMPACT, usable=False, error=0.0, size=0.5),
        replace(COMPACT, accurate=False, size=0.5, error=0.1, transmission=1.5, swing=0.1),
        replace(COMPACT, layers=(True, 0, 0), error=0.0, size=0.5),
        replace(COMPACT, has_drive=False, error=0.0, size=0.5),
    ],
    ids=["not usable", "not accurate", "collides", "no drive"],
)
def test_criteria_precede_the_preference(prefer: str, worse: Score) -> None:
    assert first(prefer, worse, COMPACT) is COMPACT
