"""Determination of the lengths of a four-bar by a motion, from the singular values of the motion's derivatives.

The unknowns are the lengths and the mounting over the linkage's size, and the crank angle at the first sample, or at every
sample if the crank angles were found with the linkage. Lengths and pivots that the limits give are held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Floats
from synthesis.four_bar import close_loop
from synthesis.limits import LINKS, PIVOTS
from synthesis.linkage import Linkage
from synthesis.studies.sensitivity import weighted, without_drive
from synthesis.target import Target

_UNKNOWNS = (*LINKS, "start", "turn", "offset", "body point", "body point", "pivot", "pivot")
"""Lengths, crank angle at the first sample, directions of ground and body, x and y of the body point and of a fixed pivot."""
_ARE_LENGTHS = np.array([name not in ("start", "turn", "offset") for name in _UNKNOWNS])

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
    columns = [(each.links, each.branch, each.start, each.ground_angle, each.arm, each.reach) for each in linkages]
    links, branch, start, turn, arm, size = map(np.array, zip(*columns))
    loop, ground, arm = close_loop(links, start[:, None] + target.crank), np.exp(1j * turn)[:, None], arm[:, None]
    pin, body = (ground * np.exp(1j * angle) for angle in (loop.crank_angle, loop.coupler_angle(branch)))
    held_a, held_b = (name in held for name in PIVOTS)
    slopes = np.moveaxis(loop.coupler_angle_gradient(branch), -1, 0)
    moves = 1j * arm * body * slopes
    moves[0] += pin
    moves[3] -= held_b * ground  # the ground turns and grows about the pivot that is given
    moves[4] += 1j * links[:, :1] * pin
    around = links[:, :1] * pin + arm * body - held_b * links[:, 3:] * ground
    still, one = np.zeros(body.shape), np.ones(body.shape)
    turned = np.stack([*slopes, one, one, *[still] * 4])
    rows = weighted(target, turned, np.stack([*moves, 1j * around, still, body, 1j * body, one, 1j * one]))
    rows *= np.where(_ARE_LENGTHS[:, None], size, 1.0)[..., None, None]
    fixed = {*held}
    if target.found:
        rows = without_drive(rows, rows[4])
        fixed.add("start")
    if held_a or held_b:
        fixed.add("pivot")
    if held_a and held_b:
        fixed |= {"ground", "turn"}
    free = [name not in fixed for name in _UNKNOWNS]
    matrix = np.nan_to_num(rows[free]).reshape(sum(free), len(links), -1).transpose(1, 2, 0)
    lengths = np.eye(4, len(_UNKNOWNS)) * (size[:, None] / links)[..., None]
    if target.position is None:  # then the ground is the unit of length
        lengths = lengths - lengths[:, 3:]
    return [
        Determination(row, resolution)
        for row, resolution in zip(uncertainties(matrix, lengths[..., free], resolutions), resolutions)
    ]


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
