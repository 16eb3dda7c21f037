"""Roberts' cognates: three different four-bars whose body points draw the same curve.

With the coupler c = C - D and the body point's arm P - D = k c (k complex, constant), the three share the pivots A, B and
O = A + k (B - A). In the parallelogram A, D, P, D' the link A D' turns with the coupler and D' P with the crank; the same
at B. (S. Roberts, Proc. London Math. Soc. s1-7 (1875) 14-23; Bottema and Roth, Theoretical Kinematics, 1979.)
"""

from __future__ import annotations

import numpy as np

from synthesis.fourbar.linkage import Linkage

Cognate = tuple[tuple[float, float, float, float], tuple[complex, complex]]
"""Lengths crank, coupler, rocker, ground, and the fixed pivots of crank and rocker."""

_NEAR = 1e-4


def cognates(linkage: Linkage) -> list[Cognate]:
    """The two others of a mounted linkage; each may be driven from either side.

    Law: the cognates of a cognate are the linkage itself and the other one.
    """
    assert linkage.coupler_point is not None
    radius, angle = linkage.coupler_point
    l1, l2, l3, l4 = linkage.links
    part = radius / l2 * np.exp(1j * angle)
    a, b = linkage.pivot_a, linkage.pivot_b
    third = complex(a + part * (b - a))
    first, second = abs(part), abs(1 - part)
    return [
        ((first * l2, first * l1, first * l3, first * l4), (a, third)),
        ((second * l1, second * l3, second * l2, second * l4), (third, b)),
    ]


def are_cognates(one: Linkage, other: Linkage) -> bool:
    """Whether two mounted linkages are cognates of each other, to 1e-4 of their size."""
    mine = (other.links, (other.pivot_a, other.pivot_b))
    return any(
        _alike(lengths, pivots, *mine) or _alike(lengths[2::-1] + lengths[3:], pivots[::-1], *mine)
        for lengths, pivots in cognates(one)
    )


def _alike(
    lengths: tuple[float, ...], pivots: tuple[complex, ...], other: tuple[float, ...], others: tuple[complex, ...]
) -> bool:
    size = max(other)
    gaps = [abs(a - b) for a, b in zip(lengths + pivots, other + others)]
    return max(gaps) < _NEAR * size
