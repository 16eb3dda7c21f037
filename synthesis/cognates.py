"""Roberts' cognates of a four-bar: the other two linkages whose body points draw the same curve."""

from __future__ import annotations

from synthesis.linkage import Lengths, Linkage

Cognate = tuple[Lengths, tuple[complex, complex]]
"""Lengths crank, coupler, rocker, ground, and the fixed pivots of crank and rocker."""

_TOLERANCE = 1e-4
"""Relative difference of lengths and pivots below which two linkages are the same."""


def cognates(linkage: Linkage) -> list[Cognate]:
    """Return the two cognates of a mounted linkage; each may be driven from either side.

    Law: the cognates of a cognate are the linkage itself and its other cognate.
    """
    l1, l2, l3, l4 = linkage.links
    part = linkage.arm / l2
    a, b = linkage.pivot_a, linkage.pivot_b
    third = complex(a + part * (b - a))
    first, second = abs(part), abs(1 - part)
    return [
        ((first * l2, first * l1, first * l3, first * l4), (a, third)),
        ((second * l1, second * l3, second * l2, second * l4), (third, b)),
    ]


def are_cognates(first: Linkage, second: Linkage) -> bool:
    """Check whether two mounted linkages are cognates of each other, to 1e-4 of their size."""
    second_shape = (second.links, (second.pivot_a, second.pivot_b))
    return any(
        _alike(lengths, pivots, *second_shape) or _alike(lengths[2::-1] + lengths[3:], pivots[::-1], *second_shape)
        for lengths, pivots in cognates(first)
    )


def _alike(
    lengths: tuple[float, ...],
    pivots: tuple[complex, ...],
    second_lengths: tuple[float, ...],
    second_pivots: tuple[complex, ...],
) -> bool:
    size = max(second_lengths)
    gaps = [abs(a - b) for a, b in zip(lengths + pivots, second_lengths + second_pivots)]
    return max(gaps) < _TOLERANCE * size
