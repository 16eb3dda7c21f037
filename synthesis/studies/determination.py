"""Determination of the lengths of a four-bar by a motion, from the singular values of the motion's derivatives.

The unknowns are the dimensions of both guides over the linkage's size, and the drive at the first sample, or at every
sample if the crank angles were found with the linkage. Lengths and pivots that the limits give are held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Floats
from synthesis.limits import LINKS, PIVOTS
from synthesis.linkage import Linkage
from synthesis.studies.sensitivity import guide_dimensions, length_changes, motion_derivatives, null_space
from synthesis.target import Target

_FREE = 1e3
"""Relative uncertainty of a length above which the motion does not determine it."""
_FLOOR = 2e-13
"""Singular value, over the largest, that is rounding."""


@dataclass(frozen=True)
class Determination:
    """Determination of a linkage by a motion.

    An error ``resolution`` of the motion, measured as in the objective, moves the logarithm of a length by up to
    ``length_uncertainty``, to first order (Golub and Van Loan, Matrix Computations, 5.3).
    """

    length_uncertainty: Floats
    """(4,) relative; infinite if the motion does not fix a length at all. Without positions the ground is exact."""
    resolution: float

    ILL_POSED = 1e-3

    @property
    def ill_posed(self) -> bool:
        """True if some length is not even determined to a thousandth at this resolution."""
        return bool(np.max(self.length_uncertainty) > self.ILL_POSED)


def determinations(
    target: Target, linkages: Sequence[Linkage], resolutions: Sequence[float], held: Sequence[str] = ()
) -> list[Determination]:
    """Return how well the motion fixes the lengths of each four-bar; see `Determination`.

    Parameters
    ----------
    target : Target
        If the crank angles were found, with a row of crank angles for each linkage.
    linkages : sequence of Linkage
    resolutions : sequence of float
        Error of the motion, in the objective's measure, that is considered for each.
    held : sequence of str
        Names of the lengths and fixed pivots that are given, which the motion does not have to determine.
    """
    rows = enumerate(zip(linkages, resolutions))
    return [_determination(target.one_of(k), linkage, resolution, held) for k, (linkage, resolution) in rows]


def _determination(target: Target, linkage: Linkage, resolution: float, held: Sequence[str]) -> Determination:
    given, size = [name in held for name in LINKS], linkage.reach
    units = [
        pair
        for _, pair in guide_dimensions(linkage)
        if not any(name in held and unit.fixed for name, unit in zip(PIVOTS, pair))
    ]
    scale = np.append(np.full(len(units), size), 1.0)[: len(units) + (not target.found)]
    derivatives = motion_derivatives(target, linkage, target.crank, units, free=target.found)
    matrix = np.nan_to_num(derivatives.reshape(scale.size, -1).T) * scale
    changes = length_changes(linkage, units)
    lengths = np.array([changes[name] for name in LINKS]) * size / np.array(linkage.links)[:, None]
    if target.position is None:  # then the ground is the unit of length
        lengths = lengths - lengths[3]
    lengths = np.pad(lengths, ((0, 0), (0, scale.size - len(units))))
    free = null_space(lengths[given])
    lengths = lengths @ free
    lengths[given] = 0.0
    return Determination(uncertainties(matrix @ free, lengths, resolution), resolution)


def uncertainties(matrix: Floats, lengths: Floats, resolution: ArrayLike) -> Floats:
    """Return the relative uncertainties of lengths (..., 4) of which a motion is known up to errors ``resolution`` (...).

    ``matrix`` (..., n, m): derivatives of the motion by the unknowns, in the objective's measure. ``lengths`` (4, m): relative
    changes of the lengths by them; zeros if a length is given.
    """
    _, singular, vectors = np.linalg.svd(np.linalg.qr(matrix, mode="r"))
    missing = vectors.shape[-1] - singular.shape[-1]
    singular = np.pad(singular, [(0, 0)] * (singular.ndim - 1) + [(0, missing)])[..., None, :]
    shares = np.abs(lengths @ np.swapaxes(vectors, -1, -2))
    free = singular <= _FLOOR * np.max(singular, axis=-1, keepdims=True, initial=0.0)
    known = np.where(free, np.inf, singular)
    uncertainty = np.asarray(resolution)[..., None] * np.sqrt(np.sum((shares / known) ** 2, axis=-1))
    lost = np.any(free & (shares > 1e-6), axis=-1)
    return np.where(lost | (uncertainty > _FREE), np.inf, uncertainty)
