"""Linkages that a search begins with: read from `Linkage`, solutions or plain values, and checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np

from linkage_atlas.arguments import Fields, column, flag, number, pointing, radians_in
from linkage_atlas.linkages import Linkage
from linkage_atlas.mechanism_types import Kinds
from linkage_atlas.motions import Motion
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.four_bar import wrap
from synthesis.guides import Driver
from synthesis.limits import LINKS
from synthesis.linkage import Linkage as Plain
from synthesis.target import TURN, Target

MAX_STARTS = 10
"""Maximum number of linkages in `start_from`."""
FOR_STARTS = 0.6
"""Fraction of the budget for the refinement of a linkage of `start_from` before a search."""
MAX_RATIO = 1e6
"""Largest ratio of a given linkage's lengths and distances to one another and to the motion's extent."""


class WithLinkage(Protocol):
    """A solution: it has a linkage."""

    @property
    def linkage(self) -> object:
        """The linkage of the solution."""
        ...


StartingLinkage: TypeAlias = Linkage | WithLinkage | Fields
"""A `Linkage`, a `Solution` or `FunctionSolution`, or its plain values."""


class Start(NamedTuple):
    """A linkage to begin with, in radians."""

    linkage: Plain
    crank: Floats | None = None
    """(N,): crank angles of a four-bar at the samples, relative to the first sample."""
    offset: float | None = None
    """For a function generator: the output minus the rocker angle."""
    field: str = "start_from"
    """The argument that holds the linkage."""


def check_refine_only(refine_only: object, start_from: object) -> bool:
    """Return the flag ``refine_only`` after a check; it needs linkages to start from."""
    checked = flag("refine_only", refine_only)
    if checked and start_from is None:
        raise FieldError("/refine_only", "has no effect without `start_from`: give the linkages to refine")
    return checked


def read_starts(starts: Sequence[StartingLinkage] | None, degrees: bool) -> list[Start]:
    """Read the linkages of ``start_from``, if the request has any.

    Each is a `Linkage`, a solution, or the plain values of either in the request's unit of angle.

    Raises
    ------
    FieldError
        If a linkage is wrong; the error names its field.
    """
    if starts is None:
        return []
    if not isinstance(starts, Sequence) or isinstance(starts, str):
        raise FieldError("/start_from", "must be a list of linkages")
    if not 1 <= len(starts) <= MAX_STARTS:
        raise FieldError("/start_from", f"must have 1 to {MAX_STARTS} linkages; it has {len(starts)}")
    return [_read(start, degrees, f"start_from/{k}") for k, start in enumerate(starts)]


def starts_for(starts: Sequence[Start], motion: Motion, kinds: Kinds) -> list[Start]:
    """Return linkages after a check against the request, without crank angles for another number of samples."""
    checked, samples = [], motion.requested.samples
    for start in starts:
        _check_kind(start, motion, kinds)
        if start.crank is not None and start.crank.shape != (samples,):  # some were added or removed
            start = start._replace(crank=None)
        _check_start(start, motion)
        checked.append(start)
    return checked


def _read(start: StartingLinkage, degrees: bool, field: str) -> Start:
    linkage: object = start if isinstance(start, Linkage) else getattr(start, "linkage", None)
    if isinstance(start, Mapping):
        with pointing(lambda name: f"/{field}{name}"):
            linkage = Linkage.from_dict(start, degrees)
        crank, offset = start.get("crank_angle"), start.get("output_offset")
    else:
        crank, offset = getattr(start, "crank_angle", None), getattr(start, "output_offset", None)
    if not isinstance(linkage, Linkage):
        raise FieldError(f"/{field}", "must be a linkage, a solution, or the plain values of either")
    radian = radians_in(linkage.degrees)
    angles = None
    if crank is not None and linkage.plain.is_four_bar:
        angles = column(f"{field}/crank_angle", crank) * radian
    if angles is not None and not np.isfinite(angles).all():
        raise FieldError(f"/{field}/crank_angle", "must have finite numbers")
    own = None if offset is None else number(f"{field}/output_offset", offset) * radian
    return _checked(linkage, field)._replace(crank=angles, offset=own)


def _check_kind(start: Start, motion: Motion, kinds: Kinds) -> None:
    """Raise FieldError for a linkage whose kind or drive the request excludes."""
    kind, driver = start.linkage.kind, start.linkage.driver
    if kind not in kinds.kinds:
        raise FieldError(f"/{start.field}", f"is a {kind}, which is not among the `mechanisms` of the request")
    if kinds.driver not in (None, driver):
        raise FieldError(f"/{start.field}", f"is driven by a {driver}, but the request allows only a {kinds.driver}")
    if motion.travel is not None and driver.turns:
        raise FieldError(f"/{start.field}", f"is driven by a {driver}, but the motion gives the travel of a slide")
    if isinstance(motion.samples, Target) and driver is not Driver.CRANK:
        raise FieldError(f"/{start.field}", f"is driven by a {driver}, but the motion gives crank angles")


def _check_start(start: Start, motion: Motion) -> None:
    """Raise FieldError for a linkage that no search for this motion can begin with."""
    linkage, samples = start.linkage, motion.requested
    if not linkage.is_four_bar and samples.position is None:
        raise FieldError(f"/{start.field}", "has a rail or slot, so that the motion needs `position`")
    if motion.free and not linkage.mounted:
        raise FieldError(
            f"/{start.field}/mount", "is required, with its coupler point, because the crank angles are free"
        )
    if samples.position is None or not linkage.mounted:
        return
    scale, middle = samples.length_scale, complex(samples.position_mean(samples.position))
    for index, guide in enumerate(linkage.guides):
        distance, size = abs(guide[0] - middle), max(abs(guide.body_point), linkage.reach)
        if max(distance, size) > MAX_RATIO * scale or linkage.reach * MAX_RATIO < scale:
            field = f"guides/{index}"
            if linkage.is_four_bar:
                field = "mount/pivot_a" if distance > size else "links"
            message = f"differs in size, or lies farther away, by more than {MAX_RATIO:g} times the motion's extent"
            raise FieldError(f"/{start.field}/{field}", message)


def _checked(view: Linkage, field: str) -> Start:
    """Return a linkage; the lengths of a four-bar are in proportion and its angles within a turn."""
    linkage = view.plain
    if not linkage.is_four_bar:
        return Start(linkage, field=field)
    for name, length in zip(LINKS, linkage.links):
        if length * MAX_RATIO < max(linkage.links):
            message = f"must have links of which none is more than {MAX_RATIO:g} times as long as another"
            raise FieldError(f"/{field}/links/{name}", message)
    turned = replace(linkage, start=linkage.start % TURN, ground_angle=wrap(linkage.ground_angle))
    return Start(turned, field=field)
