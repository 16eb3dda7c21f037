"""Pairs of guides, of any kinds, as functions of their dimensions: the poses that they allow, errors, limits, derivatives.

The first guide of a pair is the driven one. Its *drive* is the angle of a crank, the travel of a slider along its rail, the
extension of a cylinder (a slot whose pin is pushed along it), or the body's own angle (a slot that is turned about its pin).

The nearest pose to a given one that both guides allow is found by Newton's steps (Gauss-Helmert): with both distances e, their
derivatives B by (gamma, x, y) and the weights W of the pose ::

    S = B W^-1 B' = L L',   corrected = given - W^-1 B' S^-1 (e + B (given - corrected)),   rows L^-1 e of the least squares

so that the rows' square is that of the weighted correction. Neither branch nor drive enters: those are limits. The poses' own
derivatives by the dimensions, -W^-1 B' S^-1 de, leave out what is of the order of the correction times a curvature.

Ten unknowns: of each guide the running point m, the direction b and offset s of the curve's normal at a foot O that stays, and
the curvature k, which a rail or slot does not have. The distance of a place Y = X - O - s e^{i b} from the curve is ::

    F = k |Y|^2 / 2 - Re(e^{-ib} Y),   w = sqrt(1 + 2 k F),   distance = 2 F / (1 + w),   n = (k Y - e^{ib}) / w

A rail is the middle of this chart, k = 0, not its end: circles of 1e8 lengths have all their digits.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.free.poses import Poses
from synthesis.guided.dyads import Guides
from synthesis.least_squares import Evaluation
from synthesis.target import TURN

OWN = 5
"""Unknowns of a guide: m (2), b, s, k."""
_SWEEPS = 4
"""Newton's steps of the corrected pose."""
_LONGEST = 0.7
"""Longest correction of a pose, in radians and length scales."""
_LEAST = 1e-9
"""Floor of the second guide's part of S, where both guides have one force line."""
_CLOSES = 1e-7
"""Gap of a pose whose drive is given, in radians and length scales, below which it closes."""
_UNKNOWN = 1e10
"""Weight's reciprocal of a part of a sample that is missing; its correction starts anew at each step."""


class Pairs(NamedTuple):
    """Pairs of guides, the driven one first."""

    first: Guides
    second: Guides
    hinge: Flags
    """(n,): whether the first, a slot, is turned about its pin; otherwise its pin is pushed along it."""

    @property
    def guides(self) -> tuple[Guides, Guides]:
        """Both."""
        return self.first, self.second

    def take(self, places: Any) -> Pairs:
        """Some of them."""
        return Pairs(self.first.take(places), self.second.take(places), self.hinge[places])

    def joined(self, *others: Pairs) -> Pairs:
        """These and others after them."""
        return Pairs(
            self.first.joined(*(one.first for one in others)),
            self.second.joined(*(one.second for one in others)),
            np.concatenate([self.hinge, *(one.hinge for one in others)]),
        )

    @property
    def number(self) -> int:
        """How many."""
        return self.hinge.size


class Samples(NamedTuple):
    """Given poses (N,) and what their corrections cost."""

    angle: Floats
    position: Complexes
    rotation_variance: Floats
    """1 / weight of the rotation; as large as can be where it is missing."""
    position_variance: Floats
    rotation_missing: Flags
    position_missing: Flags
    drive: Floats
    """From the first sample on, where it is given: radians, or over the length scale."""

    @classmethod
    def of(cls, poses: Poses, drive: Floats | None = None) -> Samples:
        """Those of a request, over its length scale and from its mean position."""
        rotation = poses.rotation if poses.rotation is not None else np.zeros(poses.samples)
        assert poses.position is not None
        roots = [
            np.broadcast_to(mean.root, poses.samples) if part is not None else np.zeros(poses.samples)
            for mean, part in ((poses.rotation_mean, poses.rotation), (poses.position_mean, poses.position))
        ]
        missing = [root == 0 for root in roots]
        variances = [
            np.where(gone, _UNKNOWN, 1 / np.where(gone, 1.0, root) ** 2) for gone, root in zip(missing, roots)
        ]
        position = (poses.position - poses.middle) / poses.length_scale
        given = np.zeros(poses.samples) if drive is None else drive
        return cls(
            np.asarray(rotation, dtype=float), position, variances[0], variances[1], missing[0], missing[1], given
        )

    @property
    def number(self) -> int:
        """How many."""
        return self.angle.size


class Chart:
    """The unknowns (n, 10) of pairs, about the pairs that they begin at."""

    def __init__(self, pairs: Pairs) -> None:
        self.pairs = pairs
        self.bent = [np.maximum(1.0, np.abs(one.curvature)) for one in pairs[:2]]
        """Unit of each curvature."""

    @property
    def start(self) -> Floats:
        """The unknowns of the pairs themselves."""
        columns = []
        for one, unit in zip(self.pairs[:2], self.bent):
            columns += [one.point.real, one.point.imag, one.normal, np.zeros(one.normal.size), one.curvature / unit]
        return np.stack(columns, axis=1)

    @property
    def labels(self) -> Floats:
        """What belongs to each candidate beside its unknowns, (n, 11)."""
        columns: list[Any] = [self.pairs.hinge]
        for one, unit in zip(self.pairs[:2], self.bent):
            columns += [one.foot.real, one.foot.imag, unit, one.inverse, one.straight]
        return np.stack([np.asarray(column, dtype=float) for column in columns], axis=1)

    def pairs_at(self, unknowns: Floats) -> Pairs:
        """Pairs of unknowns."""
        guides = []
        for k, (one, unit) in enumerate(zip(self.pairs[:2], self.bent)):
            x = unknowns[:, OWN * k : OWN * (k + 1)]
            foot = one.foot + x[:, 3] * np.exp(1j * x[:, 2])
            curvature = np.where(one.straight, 0.0, x[:, 4] * unit)
            guides.append(Guides(x[:, 0] + 1j * x[:, 1], foot, x[:, 2], curvature, one.inverse))
        return Pairs(guides[0], guides[1], self.pairs.hinge)


class Curve:
    """One guide of each candidate: numbers (n, 1) that do not depend on the pose."""

    def __init__(self, unknowns: Floats, labels: Floats) -> None:
        self.point = (unknowns[:, 0] + 1j * unknowns[:, 1])[:, None]
        self.inward = np.exp(1j * unknowns[:, 2])[:, None]
        self.offset = unknowns[:, 3:4]
        self.unit = labels[:, 2:3]
        self.straight = labels[:, 4:5] > 0
        self.curvature = np.where(self.straight, 0.0, unknowns[:, 4:5] * self.unit)
        self.origin = (labels[:, 0] + 1j * labels[:, 1])[:, None]
        self.inverse = labels[:, 3:4] > 0

    @property
    def centre(self) -> Complexes:
        """Centre of the circle; meaningless of others."""
        bent = np.where(self.straight, 1.0, self.curvature)
        return self.origin + (self.offset + 1 / bent) * self.inward


class At:
    """A guide of each candidate at poses, (n, N); derivatives by the pose are complex numbers q: Re(conj(q) dP)."""

    def __init__(self, guide: Curve, angle: Floats, position: Complexes) -> None:
        self.guide = guide
        turned = np.exp(1j * angle)
        inverse, point = guide.inverse, guide.point
        self.turned, back = turned, np.conj(turned)
        # in the guide's own frame, which is the body's for a slot
        self.frame = np.where(inverse, back, turned)
        arm = self.frame * point
        self.place = np.where(inverse, -back * position, position) + arm
        self.from_foot = self.place - guide.origin - guide.offset * guide.inward
        bent, inward = guide.curvature, guide.inward
        rise = bent * np.abs(self.from_foot) ** 2 / 2 - (np.conj(inward) * self.from_foot).real
        self.w = np.sqrt(np.maximum(1 + 2 * bent * rise, 1e-24))
        self.rise = rise
        self.distance = 2 * rise / (1 + self.w)
        self.normal = (bent * self.from_foot - inward) / self.w
        # how the place moves in that frame: by gamma, and by the position times this
        self.by_angle = np.where(inverse, -1j * self.place, 1j * arm)
        self.by_position = np.where(inverse, -back, 1.0 + 0j)
        self.turn = (np.conj(self.normal) * self.by_angle).real
        self.shift = self.normal * np.conj(self.by_position)

    def columns(self) -> Floats:
        """Derivatives of the distance by the guide's unknowns, (n, 5, N)."""
        guide, normal, foot = self.guide, self.normal, self.from_foot
        along = np.conj(normal) * self.frame
        inward, bent = guide.inward, guide.curvature
        out = np.empty((len(normal), OWN, normal.shape[1]))
        out[:, 0], out[:, 1] = along.real, -along.imag
        out[:, 2] = -(1 + bent * guide.offset) * (np.conj(inward) * foot).imag / self.w
        out[:, 3] = -(np.conj(normal) * inward).real
        rest = np.abs(foot) ** 2 / (2 * self.w) - 2 * self.rise**2 / (self.w * (1 + self.w) ** 2)
        out[:, 4] = np.where(guide.straight, 0.0, rest * guide.unit)
        return out

    # -- what limits and drives are made of ------------------------------------------------------------------------

    def moved(self) -> Complexes:
        """Derivatives of the place in the guide's frame by its unknowns, (n, 2, N): those by m alone."""
        return np.stack([self.frame, 1j * self.frame], axis=1)

    def normal_turn(self) -> tuple[Floats, Complexes, Floats]:
        """Derivatives of the normal's direction in the guide's frame: by gamma, by the position, by the unknowns (n, 5, N)."""
        guide, bent, inward = self.guide, self.guide.curvature, self.guide.inward
        across = np.conj(self.normal) / self.w
        by_angle = bent * (across * self.by_angle).imag
        by_position = bent * np.conj(-1j * across * self.by_position)
        out = np.empty((len(self.normal), OWN, self.normal.shape[1]))
        moved = across * self.frame * bent
        out[:, 0], out[:, 1] = moved.imag, moved.real
        out[:, 2] = (across * (-1j * inward * (1 + bent * guide.offset))).imag
        out[:, 3] = -(bent * across * inward).imag
        out[:, 4] = np.where(guide.straight, 0.0, (across * self.from_foot).imag * guide.unit)
        return by_angle, by_position, out

    def travel(self) -> tuple[Floats, Floats, Complexes, Floats]:
        """The way of the place along a straight curve: itself, and its derivatives as of `normal_turn`."""
        guide = self.guide
        along = np.conj(1j * guide.inward)
        from_origin = self.place - guide.origin
        by_angle = (along * self.by_angle).real
        by_position = np.conj(along * self.by_position)
        out = np.zeros((len(self.normal), OWN, self.normal.shape[1]))
        moved = along * self.frame
        out[:, 0], out[:, 1] = moved.real, -moved.imag
        out[:, 2] = -(np.conj(guide.inward) * from_origin).real
        return (along * from_origin).real, by_angle, by_position, out

    def world(self) -> tuple[Complexes, Complexes, Complexes, Complexes]:
        """The point that both bodies share there, in the ground: itself, by gamma, by the position, and by m (n, N)."""
        inverse, point = self.guide.inverse, self.guide.point
        arm = self.turned * point
        place = np.where(inverse, point + 0 * arm, self.place)
        nothing = np.zeros_like(arm)
        return (
            place,
            np.where(inverse, nothing, 1j * arm),
            np.where(inverse, nothing, 1.0),
            np.where(inverse, 1.0, self.turned),
        )


class Corrected:
    """Candidates at the poses nearest to the given ones.

    Attributes
    ----------
    angle, position : ndarray, shape (n, N)
        The poses.
    at : tuple of At
        Both guides there.
    rows : ndarray, shape (n, 2 N)
        Whose square is J squared once the poses close.
    """

    def __init__(self, samples: Samples, unknowns: Floats, labels: Floats, sweeps: int = _SWEEPS) -> None:
        self.samples, count = samples, len(unknowns)
        self.guides = Curve(unknowns[:, :OWN], labels[:, 1:6]), Curve(unknowns[:, OWN:], labels[:, 6:11])
        self.hinge = labels[:, :1] > 0
        given_angle, given = np.tile(samples.angle, (count, 1)), np.tile(samples.position, (count, 1))
        angle, position = given_angle, given
        turn_gone, place_gone = samples.rotation_missing, samples.position_missing
        for sweep in range(sweeps):
            self._solve(angle, position, given_angle, given)
            if sweep < sweeps - 1:
                change, shift = self._correction()
                far = np.maximum(np.abs(change), np.abs(shift)) / _LONGEST
                part = 1 / np.maximum(1.0, far)
                angle, position = given_angle + part * change, given + part * shift
                if turn_gone.any():
                    given_angle = np.where(turn_gone, angle, given_angle)
                if place_gone.any():
                    given = np.where(place_gone, position, given)
        self.angle, self.position = angle, position
        self.rows = np.concatenate(self._rows, axis=1)
        self.closed = np.ones(count, dtype=bool)

    def _solve(self, angle: Floats, position: Complexes, given_angle: Floats, given: Complexes) -> None:
        one, other = self.at = tuple(At(guide, angle, position) for guide in self.guides)
        v, p = self.samples.rotation_variance, self.samples.position_variance
        s11 = v * one.turn**2 + p * np.abs(one.shift) ** 2
        s12 = v * one.turn * other.turn + p * (np.conj(one.shift) * other.shift).real
        s22 = v * other.turn**2 + p * np.abs(other.shift) ** 2
        # the determinant as a sum of squares (Cauchy-Binet)
        minors = v * p * np.abs(one.turn * other.shift - other.turn * one.shift) ** 2
        minors += p**2 * (np.conj(one.shift) * other.shift).imag ** 2
        self.l11 = np.sqrt(np.maximum(s11, 1e-300))
        self.l21 = s12 / self.l11
        self.l22 = np.maximum(np.sqrt(minors) / self.l11, _LEAST * np.sqrt(s22))
        back_angle, back = given_angle - angle, given - position
        gaps = [
            guide.distance + guide.turn * back_angle + (np.conj(guide.shift) * back).real for guide in (one, other)
        ]
        self._rows = self.lowered(*gaps)

    def lowered(self, first: Any, second: Any) -> tuple[Any, Any]:
        """L^-1 of what both guides have."""
        shape = (slice(None), None) if np.ndim(first) == 3 else (slice(None),)
        top = first / self.l11[shape]
        return top, (second - self.l21[shape] * top) / self.l22[shape]

    def _raised(self, first: Any, second: Any) -> tuple[Any, Any]:
        """L'^-1 of it."""
        shape = (slice(None), None) if np.ndim(first) == 3 else (slice(None),)
        low = second / self.l22[shape]
        return (first - self.l21[shape] * low) / self.l11[shape], low

    def _correction(self) -> tuple[Floats, Complexes]:
        one, other = self.at
        first, second = self._raised(*self._rows)
        samples = self.samples
        change = -samples.rotation_variance * (one.turn * first + other.turn * second)
        return change, -samples.position_variance * (one.shift * first + other.shift * second)

    def derivatives(self) -> tuple[Floats, Floats, Complexes]:
        """By the unknowns: of the rows (n, 10, 2 N), and of the poses (n, 10, N) and (n, 10, N)."""
        one, other = self.at
        count, samples = self.l11.shape
        own = np.zeros((2, count, 2 * OWN, samples))
        own[0, :, :OWN], own[1, :, OWN:] = one.columns(), other.columns()
        rows = self.lowered(own[0], own[1])
        first, second = self._raised(*rows)
        v, p = self.samples.rotation_variance, self.samples.position_variance
        turned = -v * (one.turn[:, None] * first + other.turn[:, None] * second)
        moved = -p * (one.shift[:, None] * first + other.shift[:, None] * second)
        return np.concatenate(rows, axis=2), turned, moved

    # -- drive and transmission ------------------------------------------------------------------------------------

    def drive(self) -> Floats:
        """Coordinate of the drive, (n, N): an angle modulo a turn, or a way over the length scale."""
        first = self.at[0]
        way = first.travel()[0]
        angle = np.where(self.hinge, self.angle, np.angle(first.normal))
        return np.where(first.guide.straight & ~self.hinge, way, angle)

    def drive_derivatives(self) -> tuple[Floats, Floats, Complexes]:
        """Of the drive: by the unknowns (n, 10, N), by gamma and by the position, (n, N)."""
        first = self.at[0]
        turn, shift, own = first.normal_turn()
        _, way_turn, way_shift, way_own = first.travel()
        slides = first.guide.straight & ~self.hinge
        out = np.zeros((len(own), 2 * OWN, own.shape[2]))
        out[:, :OWN] = np.where(slides[:, None], way_own, np.where(self.hinge[:, None], 0.0, own))
        by_angle = np.where(slides, way_turn, np.where(self.hinge, 1.0, turn))
        return out, by_angle, np.where(slides, way_shift, np.where(self.hinge, 0.0, shift))

    def transmission(self) -> Floats:
        """Sine of the angle between the follower's push and the way that its point would go, (n, N): the sign is the branch."""
        push, way = self._push_and_way()
        return (np.conj(way) * push).imag

    def _push_and_way(self) -> tuple[Complexes, Complexes]:
        one, other = self.at
        push = np.where(other.guide.inverse, self.turned * other.normal, other.normal)
        gap = other.world()[0] - one.world()[0]
        size = np.abs(gap)
        arm = gap / np.where(size > 0, size, 1.0)
        return push, np.where(self.hinge, self.turned * one.normal, arm)

    @property
    def turned(self) -> Complexes:
        """R at the poses."""
        return self.at[0].turned

    def transmission_derivatives(self) -> tuple[Floats, Floats, Complexes]:
        """Of the sine: as of `drive_derivatives`."""
        one, other = self.at
        push, way = self._push_and_way()
        cosine = (np.conj(way) * push).real
        # the angle of the push less that of the way
        turn, shift, own = other.normal_turn()
        turn = turn + np.where(other.guide.inverse, 1.0, 0.0)
        z, z_turn, z_shift, z_own = one.world()
        x, x_turn, x_shift, x_own = other.world()
        size = np.maximum(np.abs(x - z), 1e-12)
        across = np.conj(way) / size
        first = np.zeros_like(own)
        first[:, 0], first[:, 1] = -(across * z_own).imag, -(across * z_own).real
        second = np.zeros_like(own)
        second[:, 0], second[:, 1] = (across * x_own).imag, (across * x_own).real
        line_turn, line_shift, line_own = one.normal_turn()
        hinge = self.hinge
        first = np.where(hinge[:, None], line_own, first)
        second = own - np.where(hinge[:, None], 0.0, second)
        turn = turn - np.where(hinge, 1.0 + line_turn, (across * (x_turn - z_turn)).imag)
        shift = shift - np.where(hinge, line_shift, np.conj(-1j * across * (x_shift - z_shift)))
        out = np.concatenate([-first, second], axis=1)
        return cosine[:, None] * out, cosine * turn, cosine * shift


class Driven(Corrected):
    """Candidates at the poses that they have where their drive is given: three equations fix each.

    An eleventh unknown is the drive at the first sample. ``rows`` are the weighted differences to the given poses.
    """

    def __init__(self, samples: Samples, unknowns: Floats, labels: Floats, sign: Floats, sweeps: int = 8) -> None:
        """``sign`` (n, 1): along which of its coordinate's ways a candidate counts the drive."""
        self.samples, count = samples, len(unknowns)
        self.guides = Curve(unknowns[:, :OWN], labels[:, 1:6]), Curve(unknowns[:, OWN : 2 * OWN], labels[:, 6:11])
        self.hinge = labels[:, :1] > 0
        wanted = unknowns[:, 2 * OWN :] + sign * samples.drive
        angle, position = np.tile(samples.angle, (count, 1)), np.tile(samples.position, (count, 1))
        self._turns = ~self.guides[0].straight | self.hinge
        for sweep in range(sweeps):
            self.at = tuple(At(guide, angle, position) for guide in self.guides)
            self.angle, self.position = angle, position
            gaps = self._gaps(wanted)
            self._factor()
            if sweep < sweeps - 1:
                step = self._solved(gaps)
                far = np.maximum(np.abs(step[0]), np.hypot(step[1], step[2])) / _LONGEST
                part = 1 / np.maximum(1.0, far)
                angle, position = angle - part * step[0], position - part * (step[1] + 1j * step[2])
        self.open = np.max(np.abs(np.stack(gaps)), axis=0) > _CLOSES
        self.closed = ~self.open.any(axis=1)
        if not self.closed.all():
            # where the drive does not reach so far the nearest pose that the guides allow, and what the drive lacks there
            near = Corrected(samples, unknowns[:, : 2 * OWN], labels)
            angle, position = np.where(self.open, near.angle, angle), np.where(self.open, near.position, position)
            self.at = tuple(At(guide, angle, position) for guide in self.guides)
            self.angle, self.position = angle, position
            gaps = self._gaps(wanted)
            self._factor()
        off = samples.angle - angle
        off -= TURN * np.round(off / TURN)
        away = samples.position - position
        self._roots = [
            np.where(missing, 0.0, 1 / np.sqrt(variance))
            for missing, variance in (
                (samples.rotation_missing, samples.rotation_variance),
                (samples.position_missing, samples.position_variance),
            )
        ]
        turn, place = self._roots
        lacking = np.where(self.open, gaps[2], 0.0)
        self.rows = np.concatenate([off * turn, away.real * place, away.imag * place, lacking], axis=1)

    def _gaps(self, wanted: Floats) -> list[Floats]:
        off = self.drive() - wanted
        return [
            self.at[0].distance,
            self.at[1].distance,
            np.where(self._turns, off - TURN * np.round(off / TURN), off),
        ]

    def _factor(self) -> None:
        """The inverse of the three equations' derivatives by the pose, (n, N, 3, 3)."""
        one, other = self.at
        self._own, by_angle, by_position = self.drive_derivatives()
        rows = [(one.turn, one.shift), (other.turn, other.shift), (by_angle, by_position)]
        matrix = np.stack([np.stack([turn, shift.real, shift.imag], axis=2) for turn, shift in rows], axis=2)
        a, b, c = (matrix[:, :, k] for k in range(3))
        cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=3)
        determinant = np.einsum("nik,nik->ni", a, cofactors[..., 0])
        self._inverse = cofactors / np.where(np.abs(determinant) > 1e-300, determinant, 1e-300)[:, :, None, None]

    def _solved(self, gaps: Any) -> Any:
        """Steps of (gamma, x, y) that close gaps, three arrays each; gaps are (n, N) or (n, m, N)."""
        inverse = self._inverse if np.ndim(gaps[0]) == 2 else self._inverse[:, None]
        return [sum(inverse[..., row, k] * gaps[k] for k in range(3)) for row in range(3)]

    def derivatives(self) -> tuple[Floats, Floats, Complexes]:
        """As of `Corrected`, by eleven unknowns."""
        one, other = self.at
        count, samples = self.angle.shape
        own = np.zeros((3, count, 2 * OWN + 1, samples))
        own[0, :, :OWN], own[1, :, OWN : 2 * OWN] = one.columns(), other.columns()
        own[2, :, : 2 * OWN], own[2, :, 2 * OWN] = self._own, -1.0
        gone = self.open[:, None]
        turned, across, up = (np.where(gone, 0.0, -part) for part in self._solved(list(own)))
        turn, place = self._roots
        lacking = np.where(gone, own[2], 0.0)
        rows = np.concatenate([-turned * turn, -across * place, -up * place, lacking], axis=2)
        return rows, turned, across + 1j * up


def evaluate(samples: Samples, unknowns: Floats, labels: Floats) -> Evaluation:
    """J squared of candidates, and the rows that it is the square of, with their derivatives, for `least_squares.minimise`."""
    with np.errstate(all="ignore"):
        found = Corrected(samples, unknowns, labels)
        rows, _, _ = found.derivatives()
        stack = np.concatenate([rows, found.rows[:, None]], axis=1)
        cost = np.einsum("nk,nk->n", found.rows, found.rows)
    bad = ~(np.isfinite(cost) & np.isfinite(stack).all(axis=(1, 2)))
    stack[bad] = 0.0
    return Evaluation(np.where(bad, np.inf, cost), stack)
