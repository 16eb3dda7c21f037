"""A linkage that a request is refined from: read as a user gives it, and led to the nearest optimum from just there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from linkage_atlas.answers import Solution
from linkage_atlas.generators import FunctionSolution
from linkage_atlas.linkages import FourBar
from linkage_atlas.motions import Motion, column, number
from synthesis.errors import FieldError
from synthesis.fourbar import solution as answers
from synthesis.fourbar.kinematics import wrap
from synthesis.fourbar.limits import Limits
from synthesis.fourbar.linkage import Linkage
from synthesis.free.poses import Poses
from synthesis.local.motion import refine_motion
from synthesis.local.poses import refine_poses
from synthesis.search.search import SearchReport
from synthesis.target import MAX_LENGTH, MIN_LENGTH, TURN, Samples
from synthesis.work import Work

Floats = NDArray[np.float64]

FAR = 1e6
"""Largest ratio of a given linkage's lengths and distances to one another and to the motion's extent."""
LOCAL = (
    "refined from the given linkage to the nearest optimum that the descent came to: linkages elsewhere were not looked at, "
    "and may be better"
)
NOWHERE = "no descent from the given linkage led within the limits; that proves nothing about other linkages"


class Beginning(NamedTuple):
    """A linkage to refine, in radians."""

    linkage: Linkage
    crank: Floats | None = None
    """(N,): its crank angles at the samples, from the first."""
    offset: float | None = None
    """Of a function generator: the output less the rocker's angle."""


Given = FourBar | Solution | FunctionSolution | Mapping[str, Any]


@contextmanager
def named() -> Iterator[None]:
    """Errors of the linkage's fields point into ``refine_from``."""
    try:
        yield
    except FieldError as error:
        link = error.field.lstrip("/") in ("crank", "coupler", "rocker", "ground")
        place = f"/refine_from{'/links' if link else ''}{error.field}"
        raise FieldError(place, error.message, **error.details) from error


def read_beginning(given: Given, degrees: bool) -> Beginning:
    """The linkage of a request: a `FourBar`, a solution, or what either gives as plain values in the request's unit of angle.

    Raises
    ------
    FieldError
        Naming the field within ``refine_from``.
    """
    if isinstance(given, FourBar):
        return _checked(given)
    if isinstance(given, (Solution, FunctionSolution)):
        linkage = given.linkage
        crank, offset = getattr(given, "crank_angle", None), getattr(given, "output_offset", None)
    elif isinstance(given, Mapping):
        with named():
            try:
                linkage = FourBar.from_dict(given, degrees)
            except (KeyError, TypeError, ValueError) as error:
                if isinstance(error, FieldError):
                    raise
                raise FieldError("", "wanted links (crank, coupler, rocker, ground), branch, start_angle") from None
        crank, offset = given.get("crank_angle"), given.get("output_offset")
    else:
        raise FieldError("/refine_from", "wanted a FourBar, a solution, or its plain values")
    radian = np.pi / 180 if linkage.degrees else 1.0
    angles = None if crank is None else column("refine_from/crank_angle", crank) * radian
    if angles is not None and not np.isfinite(angles).all():
        raise FieldError("/refine_from/crank_angle", "wanted finite numbers")
    own = None if offset is None else number("refine_from/output_offset", offset) * radian
    return _checked(linkage)._replace(crank=angles, offset=own)


def _checked(given: FourBar) -> Beginning:
    """A linkage whose numbers can be computed with, its angles within a turn."""
    one = given.plain
    for name, length in zip(("crank", "coupler", "rocker", "ground"), one.links):
        if not MIN_LENGTH <= length <= MAX_LENGTH:
            field = f"/refine_from/links/{name}"
            raise FieldError(field, f"wanted a length from {MIN_LENGTH:g} to {MAX_LENGTH:g}, found {length:g}")
        if length * FAR < max(one.links):
            raise FieldError(f"/refine_from/links/{name}", f"wanted no link more than {FAR:g} times another")
    point = one.coupler_point
    for name, angles in (("start_angle", one.start), ("mount/ground_angle", one.ground_angle)):
        number(f"refine_from/{name}", angles)
    if point is not None and not (np.isfinite(point).all() and point[0] >= 0):
        raise FieldError("/refine_from/mount/coupler_point", "wanted a radius of at least 0 and an angle")
    return Beginning(replace(one, start=one.start % TURN, ground_angle=wrap(one.ground_angle)))


def check_against(begin: Beginning, motion: Motion) -> None:
    """FieldError for a linkage that this motion cannot be refined from."""
    one, asked = begin.linkage, motion.asked
    if motion.free:
        if not one.mounted:
            raise FieldError("/refine_from/mount", "needed, with its coupler point: the crank angles are free")
        if begin.crank is not None and begin.crank.shape != (asked.samples,):
            found = begin.crank.size
            raise FieldError("/refine_from/crank_angle", f"wanted {asked.samples} crank angles, found {found}")
    if asked.position is not None and one.mounted:
        _check_place(one, asked)


def _check_place(one: Linkage, samples: Samples) -> None:
    """FieldError for a linkage that is too far from the positions, too large or too small beside them."""
    assert samples.position is not None and one.coupler_point is not None
    scale = samples.length_scale
    if abs(one.pivot_a - complex(samples.position_mean(samples.position))) > FAR * scale:
        raise FieldError("/refine_from/mount/pivot_a", f"lies farther than {FAR:g} times the motion's extent from it")
    if max(one.coupler_point[0], *one.links) > FAR * scale or min(one.links) * FAR < scale:
        raise FieldError("/refine_from/links", f"wanted lengths within {FAR:g} times the motion's extent, either way")


def refined(
    motion: Motion, limits: Limits, begin: Beginning, tolerance: float, work: Work
) -> tuple[list[answers.Solution], SearchReport]:
    """What descents from a linkage lead to: one solution within the limits, or none."""
    with named():
        if isinstance(motion.samples, Poses):
            return refine_poses(motion.samples, limits, begin.linkage, begin.crank, tolerance, work)
        return refine_motion(motion.target, limits, begin.linkage, tolerance, work)
