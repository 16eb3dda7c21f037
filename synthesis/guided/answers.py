"""Linkages of candidate pairs of guides, in the user's unit of length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.four_bar import wrap
from synthesis.free.dyads import in_any_order, in_order
from synthesis.guided.pairs import Guides
from synthesis.guides import Circle, Driver, Guide, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.poses import Poses
from synthesis.solution import Solution, assess
from synthesis.target import TURN


@dataclass(frozen=True)
class LinkageOptions:
    """Options that decide whether a pair of guides is a linkage."""

    sine_min: float = 1e-3
    """Smallest sine of the angle between two rails, or two slots: below it the body never turns."""
    travel_min: float = 0.02
    """Smallest travel of a drive, in radians or length scales."""
    stroke_min: float = 1e-3
    """Smallest travel along a rail or slot, in length scales: below it the slider is a pin."""
    noise: float = 0.05
    """Largest fraction of its range by which a drive may step back between noisy samples."""
    even: float = 1e-3
    """Fraction of the way to even steps by which steps are moved when they are put in order."""


OPTIONS = LinkageOptions()


def linkage_of(
    pair: Sequence[Guides], driver: Driver, poses: Poses, at: Floats, prescribed: Floats | None
) -> Solution | None:
    """Return a pair of guides as a linkage with its errors, or None if it does not pass the samples.

    Parameters
    ----------
    pair : sequence of Guides
        Two guides (1,), the driven guide first.
    driver : Driver
    poses : Poses
    at : ndarray, shape (N, 3)
        Rotation and position that the guides allow at the samples, over the length scale.
    prescribed : ndarray, shape (N,), optional
        Prescribed drive.
    """
    rotation: Floats = at[:, 0]
    scaled: Complexes = at[:, 1] + 1j * at[:, 2]
    position = poses.middle + poses.length_scale * scaled
    guides = [_guide(guide, poses, float(rotation[0]), complex(scaled[0])) for guide in pair]
    guides = [_referred(guide, partner) for guide, partner in zip(guides, guides[::-1])]
    if _parallel(guides):
        return None
    linkage = Linkage((guides[0], guides[1]), driver)
    drive, sine = linkage.configuration(rotation, position)
    if not (np.isfinite(drive).all() and np.isfinite(sine).all()) or np.any(sine * sine[0] <= 0):
        return None
    if not driver.turns:
        linkage = replace(linkage, local_guides=_directed(guides, drive, prescribed))
        drive, sine = linkage.configuration(rotation, position)
    in_turn = True
    if poses.ordered:
        drive, in_turn = _in_order(drive, driver.turns, poses.span_max)
    elif driver.turns:
        (drive,), (in_turn,) = in_any_order(drive[None], poses.span_max)
    linkage = replace(linkage, branch=1 if sine[0] > 0 else -1, start=float(drive[0]))
    travel = drive - drive[0]
    if not in_turn or np.ptp(travel) < OPTIONS.travel_min * (1.0 if driver.turns else poses.length_scale):
        return None
    straight = [index for index, guide in enumerate(guides) if guide.slides]
    stroke_min = OPTIONS.stroke_min * poses.length_scale
    if any(np.ptp(linkage.along(index, travel)) < stroke_min for index in straight):
        return None
    if poses.closed and not linkage.turns_fully:
        return None
    if not np.isfinite(linkage.body(drive).rotation).all():
        return None
    (found,) = assess(poses, [linkage], poses.whole(travel) if driver.turns else travel)
    return found if np.isfinite(found.errors.objective) else None


def _in_order(drive: Floats, turns: bool, span_max: float) -> tuple[Floats, bool]:
    """Return the drive (N,) in a single direction, and whether that exists: samples that noise puts out of order are moved."""
    if turns:
        straight, holds = in_order(drive[None], span_max)
        if holds[0]:
            return straight[0], True
        steps = np.diff(drive)
        steps -= TURN * np.round(steps / TURN)
        drive = drive[0] + np.concatenate([[0.0], np.cumsum(steps)])
    sign = 1.0 if drive[-1] >= drive[0] else -1.0
    along = sign * (drive - drive[0])
    if np.all(np.diff(along) > 0):
        return drive, not turns or along[-1] < span_max
    rising, falling = np.maximum.accumulate(along), np.minimum.accumulate(along[::-1])[::-1]
    middle = (rising + falling) / 2
    noise = float(np.max(np.abs(middle - along)))
    middle = middle + OPTIONS.even * (
        middle[0] + np.linspace(0.0, 1.0, along.size) * (middle[-1] - middle[0]) - middle
    )
    holds_now = noise < OPTIONS.noise * (middle[-1] - middle[0]) and bool(np.all(np.diff(middle) > 0))
    if turns:
        holds_now = holds_now and middle[-1] - middle[0] < span_max
    return drive[0] + sign * middle, holds_now


def _guide(own: Guides, poses: Poses, rotation: float, position: complex) -> Guide:
    """Return a guide in the user's unit; the point of a rail is its body point at the first sample, whose pose is given."""
    scale, middle = poses.length_scale, poses.middle
    point, foot, normal = complex(own.point[0]), complex(own.foot[0]), float(own.normal[0])
    inward, turned = np.exp(1j * normal), np.exp(1j * rotation)
    at = np.conj(turned) * (point - position) if own.inverse[0] else position + turned * point
    on_line = foot + complex(1j * inward * (np.conj(1j * inward) * (at - foot)).real)
    if own.inverse[0]:
        return Slot(middle + scale * point, scale * on_line, float(wrap(normal + np.pi / 2)))
    if own.straight[0]:
        return Rail(middle + scale * on_line, float(wrap(normal + np.pi / 2)), scale * point)
    return Circle(middle + scale * complex(own.centre[0]), scale / abs(float(own.curvature[0])), scale * point)


def as_guides(guide: Guide, poses: Poses) -> Guides:
    """Convert a guide to the unknowns of the search, scaled and relative to the middle of the poses."""
    scale, middle = poses.length_scale, poses.middle
    if isinstance(guide, Slot):
        numbers = (guide.pin - middle) / scale, guide.body_point / scale, guide.body_direction - np.pi / 2, 0.0, True
    elif isinstance(guide, Rail):
        numbers = guide.body_point / scale, (guide.point - middle) / scale, guide.direction - np.pi / 2, 0.0, False
    else:
        centre, point, radius = (guide.pivot - middle) / scale, guide.body_point / scale, guide.radius / scale
        first = poses.full[0]
        inward = np.angle(centre - poses.scaled[first] - poses.turned[first] * point)
        numbers = point, centre - radius * np.exp(1j * inward), inward, 1 / radius, False
    return Guides(*(np.array([number]) for number in numbers))


def _referred(guide: Guide, partner: Guide) -> Guide:
    """Return a slot measured from the foot of the other guide's body point on it, or from its intersection with another slot."""
    if not isinstance(guide, Slot):
        return guide
    along = np.exp(1j * guide.body_direction)
    to = partner.body_point - guide.body_point
    if isinstance(partner, Slot):
        across = np.exp(1j * partner.body_direction)
        below = (np.conj(along) * across).imag
        distance = (np.conj(to) * across).imag / below if abs(below) > 1e-12 else 0.0
    else:
        distance = (np.conj(along) * to).real
    return guide._replace(body_point=complex(guide.body_point + distance * along))


def _parallel(guides: Sequence[Guide]) -> bool:
    """Return whether two rails, or two slots, are parallel, so that the body never turns."""
    first, second = guides
    if isinstance(first, Rail) and isinstance(second, Rail):
        return bool(abs(np.sin(first.direction - second.direction)) < OPTIONS.sine_min)
    if isinstance(first, Slot) and isinstance(second, Slot):
        return bool(abs(np.sin(first.body_direction - second.body_direction)) < OPTIONS.sine_min)
    return False


def _directed(guides: Sequence[Guide], drive: Floats, prescribed: Floats | None) -> tuple[Guide, Guide]:
    """Return guides whose first is driven in the prescribed direction; the length of a cylinder is positive."""
    first, second = guides
    backwards = prescribed is not None and (drive[-1] - drive[0]) * prescribed[-1] < 0
    if isinstance(first, Rail):
        turned = first._replace(direction=float(wrap(first.direction + np.pi)))
        return (turned if backwards else first), second
    assert isinstance(first, Slot)
    if backwards or (prescribed is None and drive[0] < 0):
        first = first._replace(body_direction=float(wrap(first.body_direction + np.pi)))
        drive = -drive
    if drive[0] < 0:  # two slots: the rod is fastened as far on the other side of their intersection
        along = np.exp(1j * first.body_direction)
        first = first._replace(body_point=complex(first.body_point - (abs(drive[0]) + np.max(np.abs(drive))) * along))
    return first, second
