"""Functions with travel: how the output of a linkage with a slider follows its input, with derivatives by its dimensions.

An input or an output is the angle of a crank or lever, or a travel: of a slider along its rail, or of a cylinder. With u the way
from the first sample on, every law is y(u) + offset, of five unknowns: three of the shape, the *zero*, where the input is first,
and the offset. Lengths are over one scale; those that must be above 0 are logarithms. Frames as in `slider.charts`: pivot of the
crank in the origin, the rail on y = e, fixed pin d on the x axis.

======================  ============================  ========================================================================
kind                    input to output               law
======================  ============================  ========================================================================
slider_crank            crank to slider               y = r cos t + b sqrt(l^2 - (e - r sin t)^2),   t = zero + u
slider_crank            slider to crank               |p + i e - r e^{iy}| = l,                      p = zero + u
swinging_block          crank to cylinder             y = |d - r e^{it}|,                            t = zero + u
swinging_block          cylinder to crank             |d - r e^{iy}| = s,                            s = zero + u
two_rails               slider to slider              y^2 + p^2 - 2 y p cos delta = l^2,             p = zero + u
rail_slot               slider to slotted lever       i e - p = e^{iy} (s + i h),                    p = zero + u
rail_slot               slider to cylinder            y^2 = p^2 + e^2,                               p = zero + u
rail_slot               cylinder to slider            y^2 = s^2 - e^2,                               s = zero + u
======================  ============================  ========================================================================

The branch b tells the two solutions apart; where there is but one it is +1. An offset of the swinging block's cylinder from its
pins would give no other functions: its length depends on two numbers alone. Nor would one of the cylinder on a slider: h^2 goes
with e^2. Derivatives of angles come from the closed loop
(design note on sliders, section 5).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.guided.linkage import Circle, Driver, Guide, GuidedLinkage, Kind, Rail, Slot, through

ANGLE, LENGTH = "angle", "length"
_TINY = 1e-12
"""Least square of what a slope is divided by: a dead position stops a step, no program."""


class Followed(NamedTuple):
    """The output of candidates over their input."""

    value: Floats
    """(n, M): without the offset; an angle up to whole turns; any number where a candidate is impossible."""
    slope: Floats
    """(n, 4, M): derivatives by the shape's unknowns and the zero; the last is that by the input too."""
    possible: Flags
    """(n, M): where it closes."""


class Law(NamedTuple):
    """How the output of a kind of linkage follows its input."""

    kind: Kind
    driver: Driver
    input: str
    output: str
    lengths: tuple[str, ...]
    """Names of the unknowns of the shape."""
    positive: tuple[bool, ...]
    """Which of them are lengths above 0, and stand as logarithms."""
    branches: tuple[int, ...]
    follow: Callable[[Floats, Floats, Floats, Floats], Followed]
    """``follow(lengths (n, 3, 1), branch (n, 1), place (n, M), zero)``: slopes by lengths, not logarithms."""
    sine: Callable[[Floats, Floats], Floats]
    """``sine(lengths (n, 3, 1), place (n, M))``: sine of the transmission angle; of complex numbers too."""
    mounted: Callable[[Floats, int, float], tuple[tuple[Guide, Guide], float, complex]]
    """``mounted(lengths, branch, place)``: guides, and rotation and place of the body where the input is there."""

    @property
    def size(self) -> int:
        """How many unknowns its shape has."""
        return len(self.lengths)

    def of(self, unknowns: Floats) -> Floats:
        """Lengths (n, 3) of unknowns (n, 5); 0 where there is none."""
        out = np.zeros((len(unknowns), 3), dtype=unknowns.dtype)
        for k, above in enumerate(self.positive):
            out[:, k] = np.exp(unknowns[:, k]) if above else unknowns[:, k]
        return out

    def at(self, unknowns: Floats, branch: Floats, travel: Floats) -> Followed:
        """The output at inputs (n, M) from the first sample on, and derivatives by the unknowns (n, 5), but the offset."""
        lengths = self.of(unknowns)
        with np.errstate(all="ignore"):
            found = self.follow(lengths[:, :, None], branch[:, None], unknowns[:, 3:4] + travel, unknowns[:, 3:4])
            slope = np.nan_to_num(found.slope)
            for k, above in enumerate(self.positive):
                if above:
                    slope[:, k] *= lengths[:, k, None]
        return Followed(np.nan_to_num(found.value), slope, found.possible & np.isfinite(found.value))

    def sines(self, unknowns: Floats, travel: Floats) -> Floats:
        """Sines of the transmission angle at inputs (n, M); 0 where it does not close."""
        with np.errstate(all="ignore"):
            found = self.sine(self.of(unknowns)[:, :, None], unknowns[:, 3:4] + travel)
        return np.where(np.isfinite(found), found, 0.0)

    def linkage(self, lengths: Floats, branch: int, zero: float) -> GuidedLinkage:
        """The linkage, its input at the zero."""
        guides, rotation, position = self.mounted(lengths, branch, zero)
        return through(guides, self.driver, rotation, position)


def _columns(lengths: Floats) -> tuple[Floats, Floats, Floats]:
    return lengths[:, 0], lengths[:, 1], lengths[:, 2]


def _safe(value: Floats) -> Floats:
    """A divisor that is not 0."""
    return np.where(np.abs(value) > _TINY, value, np.copysign(_TINY, value))


# -- slider-crank ------------------------------------------------------------------------------------------------------


def _crank_to_slider(lengths: Floats, branch: Floats, t: Floats, zero: Floats) -> Followed:
    r, rod, e = _columns(lengths)
    sine, cosine = np.sin(t), np.cos(t)
    across = e - r * sine
    square = (rod - across) * (rod + across)
    along = branch * np.sqrt(np.maximum(square, 0.0))
    lever = _safe(along)
    slope = np.stack(
        [
            cosine + across * sine / lever,
            rod / lever,
            -across / lever,
            -r * sine + across * r * cosine / lever,
        ],
        axis=1,
    )
    return Followed(r * cosine + along, slope, square > 0)


def _sine_at_rail(lengths: Floats, t: Floats) -> Floats:
    r, rod, e = _columns(lengths)
    across = e - r * np.sin(t)
    return np.sqrt((rod - across) * (rod + across)) / rod


def _rod_and_crank(lengths: Floats, branch: int, t: float, p: float) -> tuple[tuple[Circle, Rail], float, complex]:
    r, rod, e = lengths
    pin = complex(r * np.exp(1j * t))
    return (Circle(0j, r, 0j), Rail(1j * e, 0.0, complex(rod))), float(np.angle(p + 1j * e - pin)), pin


def _slider_crank(lengths: Floats, branch: int, t: float) -> tuple[tuple[Guide, Guide], float, complex]:
    r, rod, e = lengths
    across = e - r * np.sin(t)
    p = r * np.cos(t) + branch * np.sqrt((rod - across) * (rod + across))
    return _rod_and_crank(lengths, branch, t, p)


def _triangle(one: Floats, other: Floats, opposite: Floats) -> tuple[Floats, Floats]:
    """The angle between two sides of a triangle by all three, and 16 times its squared area; NaN where there is none."""
    outer = (one + other - opposite) * (one + other + opposite)
    inner = (opposite - (one - other)) * (opposite + (one - other))
    square = outer * inner
    return 2 * np.arctan2(np.sqrt(inner), np.sqrt(outer)), square


def _slider_to_crank(lengths: Floats, branch: Floats, p: Floats, zero: Floats) -> Followed:
    r, rod, e = _columns(lengths)
    distance = np.hypot(p, e)
    opening, square = _triangle(distance, r, rod)
    y = np.arctan2(e, p) + branch * opening
    across, along = e - r * np.sin(y), p - r * np.cos(y)
    lever = _safe(r * (across * np.cos(y) - along * np.sin(y)))
    # along dp + across de - (along cos y + across sin y) dr - r (across cos y - along sin y) dy = l dl
    rod = np.broadcast_to(rod, p.shape)
    slope = np.stack([-(along * np.cos(y) + across * np.sin(y)), -rod, across, along], axis=1)
    return Followed(y, slope / lever[:, None], square > 0)


def _sine_at_pin(lengths: Floats, p: Floats) -> Floats:
    r, rod, e = _columns(lengths)
    square = p * p + e * e
    distance = np.sqrt(square)
    area = (distance + r - rod) * (distance + r + rod) * (rod - distance + r) * (rod + distance - r)
    return np.sqrt(area) / (2 * r * rod)


def _driven_crank(lengths: Floats, branch: int, p: float) -> tuple[tuple[Guide, Guide], float, complex]:
    column = np.asarray(lengths, dtype=float).reshape(1, 3, 1)
    found = _slider_to_crank(column, np.full((1, 1), float(branch)), np.full((1, 1), p), np.zeros((1, 1)))
    guides, rotation, position = _rod_and_crank(lengths, branch, float(found.value[0, 0]), p)
    return guides[::-1], rotation, position


# -- swinging block: a cylinder between two pins ------------------------------------------------------------------------


def _crank_to_cylinder(lengths: Floats, branch: Floats, t: Floats, zero: Floats) -> Followed:
    r, d, _ = _columns(lengths)
    cosine = np.cos(t)
    square = (d - r) ** 2 + 4 * d * r * np.sin(t / 2) ** 2
    s = np.sqrt(square)
    lever = _safe(s)
    none = np.zeros_like(t)
    slope = np.stack([(r - d * cosine) / lever, (d - r * cosine) / lever, none, d * r * np.sin(t) / lever], axis=1)
    return Followed(s, slope, square > 0)


def _no_angle(lengths: Floats, place: Floats) -> Floats:
    return np.ones(np.broadcast_shapes(lengths[:, 0].shape, place.shape), dtype=place.dtype) + 0 * place


def _block(lengths: Floats, branch: int, t: float) -> tuple[tuple[Guide, Guide], float, complex]:
    r, d, _ = lengths
    pin = complex(r * np.exp(1j * t))
    return (Circle(0j, r, 0j), Slot(complex(d), 0j, 0.0)), float(np.angle(d - pin)), pin


def _cylinder_to_crank(lengths: Floats, branch: Floats, s: Floats, zero: Floats) -> Followed:
    r, d, _ = _columns(lengths)
    opening, square = _triangle(d, r, s)
    y = branch * opening
    lever = _safe(d * r * np.sin(y))
    none = np.zeros_like(s)
    slope = np.stack([-(r - d * np.cos(y)) / lever, -(d - r * np.cos(y)) / lever, none, s / lever], axis=1)
    return Followed(y, slope, (square > 0) & (s > 0))


def _sine_at_cylinder(lengths: Floats, s: Floats) -> Floats:
    r, d, _ = _columns(lengths)
    area = (s + r - d) * (s + r + d) * (d - s + r) * (d + s - r)
    return np.sqrt(area) / (2 * r * s)


def _driven_block(lengths: Floats, branch: int, s: float) -> tuple[tuple[Guide, Guide], float, complex]:
    column = np.asarray(lengths, dtype=float).reshape(1, 3, 1)
    found = _cylinder_to_crank(column, np.full((1, 1), float(branch)), np.full((1, 1), s), np.zeros((1, 1)))
    guides, rotation, position = _block(lengths, branch, float(found.value[0, 0]))
    return guides[::-1], rotation, position


# -- two sliders, and a slotted lever -----------------------------------------------------------------------------------


def _slider_to_slider(lengths: Floats, branch: Floats, p: Floats, zero: Floats) -> Followed:
    rod, delta, _ = _columns(lengths)
    cosine, sine = np.cos(delta), np.sin(delta)
    across = p * sine
    square = (rod - across) * (rod + across)
    along = branch * np.sqrt(np.maximum(square, 0.0))
    lever = _safe(along)
    none = np.zeros_like(p)
    by_delta = -p * sine - across * p * cosine / lever
    slope = np.stack([rod / lever, by_delta, none, cosine - across * sine / lever], axis=1)
    return Followed(p * cosine + along, slope, square > 0)


def _sine_at_second_rail(lengths: Floats, p: Floats) -> Floats:
    rod, delta, _ = _columns(lengths)
    across = p * np.sin(delta)
    return np.sqrt((rod - across) * (rod + across)) / rod


def _two_rails(lengths: Floats, branch: int, p: float) -> tuple[tuple[Guide, Guide], float, complex]:
    rod, delta, _ = lengths
    across = p * np.sin(delta)
    q = p * np.cos(delta) + branch * np.sqrt((rod - across) * (rod + across))
    guides = Rail(0j, 0.0, 0j), Rail(0j, float(delta), complex(rod))
    return guides, float(np.angle(q * np.exp(1j * delta) - p)), complex(p)


def _slider_to_lever(lengths: Floats, branch: Floats, p: Floats, zero: Floats) -> Followed:
    e, h, _ = _columns(lengths)
    square = p * p + (e - h) * (e + h)
    s = np.sqrt(square)
    lever = _safe(s)
    # continuous: the pin lies on one side of the rail
    y = np.sign(e) * (np.pi / 2 + np.arctan2(p, np.abs(e))) - np.arctan2(h, s)
    none = np.zeros_like(p)
    slope = np.stack([np.cos(y) / lever, -1 / lever, none, np.sin(y) / lever], axis=1)
    return Followed(y, slope, (square > 0) & (np.abs(e) > 0))


def _sine_at_slot(lengths: Floats, p: Floats) -> Floats:
    e, h, _ = _columns(lengths)
    square = p * p + e * e
    return np.sqrt((square - h * h) / square)


def _lever(lengths: Floats, branch: int, p: float) -> tuple[tuple[Guide, Guide], float, complex]:
    e, h, _ = lengths
    column = np.asarray(lengths, dtype=float).reshape(1, 3, 1)
    found = _slider_to_lever(column, np.ones((1, 1)), np.full((1, 1), p), np.zeros((1, 1)))
    return (Rail(0j, 0.0, 0j), Slot(1j * e, 1j * h, 0.0)), float(found.value[0, 0]), complex(p)


def _slider_to_cylinder(lengths: Floats, branch: Floats, p: Floats, zero: Floats) -> Followed:
    e, _, _ = _columns(lengths)
    y = branch * np.hypot(p, e)
    lever, none = _safe(y), np.zeros_like(p)
    return Followed(y, np.stack([e / lever, none, none, p / lever], axis=1), np.abs(y) > 0)


def _cylinder_on_rail(lengths: Floats, branch: int, p: float) -> tuple[tuple[Guide, Guide], float, complex]:
    e = float(lengths[0])
    guides = Rail(0j, 0.0, 0j), Slot(1j * e, 0j, 0.0)
    return guides, float(np.angle(branch * (1j * e - p))), complex(p)


def _cylinder_to_slider(lengths: Floats, branch: Floats, s: Floats, zero: Floats) -> Followed:
    e, _, _ = _columns(lengths)
    square = (s - e) * (s + e)
    y = branch * np.sqrt(np.maximum(square, 0.0))
    lever, none = _safe(y), np.zeros_like(s)
    return Followed(y, np.stack([-e / lever, none, none, s / lever], axis=1), (square > 0) & (s > 0))


def _sine_of_cylinder_and_rail(lengths: Floats, s: Floats) -> Floats:
    e, _, _ = _columns(lengths)
    return np.sqrt((s - e) * (s + e)) / s


def _driven_on_rail(lengths: Floats, branch: int, s: float) -> tuple[tuple[Guide, Guide], float, complex]:
    e = float(lengths[0])
    guides, rotation, position = _cylinder_on_rail(lengths, 1, branch * np.sqrt((s - e) * (s + e)))
    return guides[::-1], rotation, position


LAWS = (
    Law(
        Kind.SLIDER_CRANK,
        Driver.CRANK,
        ANGLE,
        LENGTH,
        ("crank", "rod", "offset"),
        (True, True, False),
        (1, -1),
        _crank_to_slider,
        _sine_at_rail,
        _slider_crank,
    ),
    Law(
        Kind.SWINGING_BLOCK,
        Driver.CRANK,
        ANGLE,
        LENGTH,
        ("crank", "ground"),
        (True, True),
        (1,),
        _crank_to_cylinder,
        _no_angle,
        _block,
    ),
    Law(
        Kind.SLIDER_CRANK,
        Driver.SLIDER,
        LENGTH,
        ANGLE,
        ("crank", "rod", "offset"),
        (True, True, False),
        (1, -1),
        _slider_to_crank,
        _sine_at_pin,
        _driven_crank,
    ),
    Law(
        Kind.SWINGING_BLOCK,
        Driver.CYLINDER,
        LENGTH,
        ANGLE,
        ("crank", "ground"),
        (True, True),
        (1, -1),
        _cylinder_to_crank,
        _sine_at_cylinder,
        _driven_block,
    ),
    Law(
        Kind.RAIL_SLOT,
        Driver.SLIDER,
        LENGTH,
        ANGLE,
        ("pin_distance", "slot_offset"),
        (False, False),
        (1,),
        _slider_to_lever,
        _sine_at_slot,
        _lever,
    ),
    Law(
        Kind.TWO_RAILS,
        Driver.SLIDER,
        LENGTH,
        LENGTH,
        ("rod", "angle"),
        (True, False),
        (1, -1),
        _slider_to_slider,
        _sine_at_second_rail,
        _two_rails,
    ),
    Law(
        Kind.RAIL_SLOT,
        Driver.SLIDER,
        LENGTH,
        LENGTH,
        ("pin_distance",),
        (True,),
        (1, -1),
        _slider_to_cylinder,
        _no_angle,
        _cylinder_on_rail,
    ),
    Law(
        Kind.RAIL_SLOT,
        Driver.CYLINDER,
        LENGTH,
        LENGTH,
        ("pin_distance",),
        (True,),
        (1, -1),
        _cylinder_to_slider,
        _sine_of_cylinder_and_rail,
        _driven_on_rail,
    ),
)
"""All there are, those that are built most often first."""
