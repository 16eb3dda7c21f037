"""Errors of a linkage that makes a motion, as optimisers take them: `residuals` and `objective`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.linkages import Linkage
from linkage_atlas.motions import Motion
from linkage_atlas.solutions import Solution
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.target import TURN


def residuals(linkage: Linkage | Solution, motion: Motion, travel: ArrayLike | None = None) -> Floats:
    """Return the weighted errors of a linkage at the samples of a motion, for example for `scipy.optimize.least_squares`.

    Parameters
    ----------
    linkage : Linkage or Solution
        Its own start, position and body offset count: nothing is fitted. A solution stands for its linkage.
    motion : Motion
        The requested motion.
    travel : array_like, shape (N,), optional
        Crank angles, or the travel of a drive that slides, at the samples of a motion with free crank angles. Default: those
        with which the linkage was found.

    Returns
    -------
    ndarray, shape (N,), (2 N,) or (3 N,)
        Requested minus reached values: rotation in radians, then x and y over the length scale of the motion. Each is
        multiplied by the root of its weight in the mean, so that the sum of squares is the square of `objective`. NaN at
        samples at which the linkage does not close.

    Raises
    ------
    FieldError
        If the travel is needed and missing.

    Examples
    --------
    >>> import numpy as np, linkage_atlas as la
    >>> crank_angle = [0, 20, 40, 60]
    >>> made = la.FourBar(19, 72, 144, 165).joints(crank_angle)
    >>> motion = la.Motion(made.rotation, crank_angle=crank_angle)
    >>> la.residuals(la.FourBar(19, 72, 144, 165), motion).round(9)
    array([0., 0., 0., 0.])
    """
    if isinstance(linkage, Solution):
        linkage = linkage.linkage
    plain = linkage.plain
    if motion.free and travel is None and motion.travel is None:
        travel = linkage.sample_travel(motion)
        if travel is None:
            raise FieldError(
                "/travel", "is required, because the crank angles are free: the travel of the drive at each sample"
            )
    target = linkage.target_of(motion, travel)
    body = plain.body(plain.start + target.crank)
    parts = []
    if target.rotation is not None:
        error = target.rotation - body.rotation
        turns = error if target.found else target.rotation_mean(error)
        parts.append(target.rotation_mean.root * (error - TURN * np.round(turns / TURN)))
    if target.position is not None:
        gap = target.position_mean.root * (target.position - body.position) / target.length_scale
        parts += [gap.real, gap.imag]
    return np.concatenate(parts)


def objective(linkage: Linkage | Solution, motion: Motion, travel: ArrayLike | None = None) -> float:
    """Return the error of a linkage that makes a motion, which a search for the smallest error minimises.

    Parameters
    ----------
    linkage : Linkage or Solution
        See `residuals`.
    motion : Motion
        The requested motion.
    travel : array_like, shape (N,), optional
        See `residuals`.

    Returns
    -------
    float
        Root of the mean square rotation error in radians plus the mean square position error over the squared length scale.
        NaN if the linkage does not close at a sample.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> motion = la.Motion(position=[[0, 0], [40, 8], [75, 30], [90, 60], [95, 90]])
    >>> best = la.synthesize(motion, top=1).best
    >>> abs(la.objective(best, motion) - best.errors.objective) < 1e-9
    True
    """
    return float(np.linalg.norm(residuals(linkage, motion, travel)))
