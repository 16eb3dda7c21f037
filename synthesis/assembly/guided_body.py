"""Movement of a body on two guides over a cell of the drive's coordinate.

Let Z be the driven guide's pin, X the point that the other guide holds, and e the largest displacement of Z over a cell (half its
width for a slider; for a crank the radius times that). The body turns by at most

=================  ======================================================================================================
other guide        largest rotation
=================  ======================================================================================================
circle             asin(e / D) + |phi(D +- e) - phi(D)|, D = |C - Z|, phi the angle at Z
rail               |asin((o +- e) / L) - asin(o / L)|, o the distance of Z from the rail, L = |X - Z|
slot               asin(e / D) + |asin(h / (D +- e)) - asin(h / D)|, D = |pin - Z|, h the distance of Z from the slot
=================  ======================================================================================================

The angle phi is monotone in D except at one length, so its bound also holds next to dead positions, where no bound of the
derivative does. A cylinder changes the body point that lies on Z instead, so D and L change places. A hinge prescribes the
rotation of the body; there the displacement of the body along its slot is bounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Floats
from synthesis.assembly.movement import Bodies
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage


@dataclass(frozen=True)
class GuidedBody:
    """Body of a linkage; its frame is parallel to the body's and has its origin at the driven guide's body point."""

    linkage: Linkage
    body: int = 1

    def enclose(self, bodies: Bodies, travel: Floats, half: Floats) -> None:
        """Compute the poses by `Linkage.body` and bound the movement."""
        linkage = self.linkage
        driven = linkage.guides[0]
        q = linkage.start + travel
        pose = linkage.body(q)
        direction = np.exp(1j * pose.rotation)
        bodies.direction[self.body] = direction
        bodies.origin[self.body] = pose.position + direction * driven.body_point
        if linkage.driver is Driver.HINGE:
            turn, shift = half, self._slides(q, half)
        else:
            turn = self._turns(q, half)
            if isinstance(driven, Circle):
                shift = driven.radius * np.minimum(2.0, half)
            elif isinstance(driven, Rail):
                shift = half
            else:
                shift = half + (np.abs(q) + half) * np.minimum(2.0, turn)
        bodies.shift[self.body], bodies.turn[self.body] = shift, turn

    def _turns(self, q: Floats, half: Floats) -> Floats:
        """Return the largest rotation over a cell, if the position of the drive's pin Z is known."""
        driven, second = self.linkage.local_guides
        slides = not driven.holds_point
        e = half if not isinstance(driven, Circle) else driven.radius * np.minimum(2.0, half)
        z, arm = driven.ground_at(q), second.body_point - driven.body_at(q)
        # what varies over the cell, by at most e, and what does not
        if isinstance(second, Circle):
            spread = np.abs(second.pivot - z)
            varies, constant = (np.abs(arm), spread) if slides else (spread, np.abs(arm))
            return _turn_over(float(constant.flat[0]), second.radius, varies, e)
        if isinstance(second, Rail):
            beside = np.imag((z - second.point) * np.exp(-1j * second.direction))
            length = np.abs(arm)
            return _by_length(beside, length, e) if slides else _by_offset(beside, length, e)
        offset = np.imag(arm * np.exp(-1j * second.body_direction))
        length = np.abs(second.pin - z)
        return _by_offset(offset, length, e) if slides else _by_length(offset, length, e)

    def _slides(self, q: Floats, half: Floats) -> Floats:
        """Return the largest displacement of the driven guide's body point over a cell, for a hinge."""
        linkage = self.linkage
        driven, second = linkage.guides
        assert isinstance(driven, Slot)
        pose = linkage.body(q)
        at = pose.position + np.exp(1j * pose.rotation) * driven.body_point
        arm = (second.body_point - driven.body_point) * np.exp(-1j * driven.body_direction)
        turn = np.minimum(2.0, half)
        if isinstance(second, Circle):
            offset = driven.pin - second.pivot
            moves = abs(offset) * turn
            beside = np.abs(np.imag(np.conj(np.exp(1j * q)) * offset + arm))
            lower, upper = np.maximum(beside - moves, 0.0), beside + moves
            root = _root(second.radius, beside)
            span = np.maximum(np.abs(_root(second.radius, lower) - root), np.abs(_root(second.radius, upper) - root))
            slide = moves + span
        elif isinstance(second, Rail):
            low, high = q - half - second.direction, q + half - second.direction
            # the sine over the cell: between its ends, or its extreme
            sines = np.abs(np.stack([np.sin(low), np.sin(high)]))
            has_zero = (np.floor(low / np.pi) != np.floor(high / np.pi)) | (half >= np.pi)
            sine_min = np.where(has_zero, 0.0, sines.min(axis=0))
            middle = np.abs(np.sin(q - second.direction))
            offset = driven.pin - second.point
            top = np.abs(np.imag((offset + arm * np.exp(1j * q)) * np.exp(-1j * second.direction)))
            known = sine_min > 0
            safe = np.where(known, sine_min, 1.0)
            slide = np.where(
                known, abs(arm) * turn / safe + top * turn / (safe * np.where(known, middle, 1.0)), np.inf
            )
        else:
            tilt = abs(np.sin(second.body_direction - driven.body_direction))
            slide = abs(driven.pin - second.pin) * turn / tilt
        return np.asarray(slide + (np.abs(at - driven.pin) + slide) * turn)


def _turn_over(own: float, opposite: float, r: Floats, e: Floats) -> Floats:
    """Return the largest rotation of a side of a triangle, with the length ``opposite`` opposite to the corner at which it turns.

    The third side has the length r; its length and the distance of its ends change by at most e.
    """
    low, high = np.maximum(r - e, abs(own - opposite)), np.minimum(r + e, own + opposite)
    known = (e < r) & (low <= high)
    middle = _corner_angle(own, opposite, r)
    span = np.maximum(
        np.abs(_corner_angle(own, opposite, low) - middle), np.abs(_corner_angle(own, opposite, high) - middle)
    )
    if own > opposite:
        turning = np.sqrt((own - opposite) * (own + opposite))
        extreme = np.abs(_corner_angle(own, opposite, np.full(1, turning)) - middle)
        span = np.where((low < turning) & (turning < high), np.maximum(span, extreme), span)
    return np.where(known, np.arcsin(np.where(known, e / r, 0.0)) + span, np.inf)


def _corner_angle(own: float, opposite: float, r: Floats) -> Floats:
    """Return the angle between the sides ``own`` and ``r`` of a triangle, from 0 to pi.

    Differences come before sums, so that neither loses digits next to a dead position.
    """
    below = np.maximum((opposite - (own - r)) * ((own + opposite) - r), 0.0)
    above = np.maximum(((own - opposite) + r) * (own + opposite + r), 0.0)
    return np.asarray(2 * np.arctan2(np.sqrt(below), np.sqrt(above)))


def _root(radius: float, beside: Floats) -> Floats:
    return np.asarray(np.sqrt(np.maximum((radius - beside) * (radius + beside), 0.0)))


def _by_offset(offset: Floats, length: Floats, e: Floats) -> Floats:
    """Return the change of asin(offset / length) if the offset varies by at most e."""
    middle = _asin(offset / length)
    ends = _asin((offset - e) / length), _asin((offset + e) / length)
    return np.asarray(np.maximum(np.abs(ends[0] - middle), np.abs(ends[1] - middle)))


def _by_length(offset: Floats, length: Floats, e: Floats) -> Floats:
    """Return the change of asin(offset / length), and of the direction of the length, if the length varies by at most e."""
    low, high = np.maximum(length - e, np.abs(offset)), length + e
    known = (e < length) & (low > 0)
    safe = np.where(known, low, 1.0)
    middle = _asin(offset / length)
    span = np.maximum(np.abs(_asin(offset / safe) - middle), np.abs(_asin(offset / high) - middle))
    return np.where(known, np.arcsin(np.where(known, e / length, 0.0)) + span, np.inf)


def _asin(sine: Floats) -> Floats:
    """Return asin, accurate near 1, of a sine that may exceed 1 by rounding or at the end of a cell."""
    inside = np.clip(sine, -1.0, 1.0)
    return np.asarray(np.arctan2(inside, np.sqrt((1.0 - inside) * (1.0 + inside))))
