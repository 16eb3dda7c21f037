"""Relations of output and input of linkages with a slider or a cylinder.

An input or an output is the angle of a crank or lever, or the travel of a slider along its rail or of a cylinder. Each
law is y(u) + offset, with the input u from the first sample and five unknowns: three of the shape, the *zero*, which is
the input at the first sample, and the offset. Lengths that must be positive are represented by their logarithms. Frames
as in `slider`: the pivot of the crank in the origin, the rail on y = e, the fixed pin d on the x axis.

======================  ============================  ===============================================================
kind                    input to output               law
======================  ============================  ===============================================================
slider_crank            crank to slider               y = r cos t + b sqrt(l^2 - (e - r sin t)^2),   t = zero + u
slider_crank            slider to crank               |p + i e - r e^{iy}| = l,                      p = zero + u
swinging_block          crank to cylinder             y = |d - r e^{it}|,                            t = zero + u
swinging_block          cylinder to crank             |d - r e^{iy}| = s,                            s = zero + u
two_rails               slider to slider              y^2 + p^2 - 2 y p cos delta = l^2,             p = zero + u
rail_slot               slider to slotted lever       i e - p = e^{iy} (s + i h),                    p = zero + u
rail_slot               slider to cylinder            y^2 = p^2 + e^2,                               p = zero + u
rail_slot               cylinder to slider            y^2 = s^2 - e^2,                               s = zero + u
======================  ============================  ===============================================================

The branch b distinguishes two solutions; it is +1 if there is a single solution. An offset of the swinging block's
cylinder from its pins would add no functions, because the length of the cylinder only depends on two numbers; the same
holds for the cylinder on a slider, because h^2 and e^2 only occur as a sum. Derivatives of angles come from the closed
loop.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Floats
from synthesis.function.problem import OutputCurve
from synthesis.guides import Circle, Driver, Guide, Kind, Rail, Slot
from synthesis.linkage import Linkage, through

ANGLE, LENGTH = "angle", "length"


class Law(NamedTuple):
    """Relation of output and input for a kind of linkage."""

    kind: Kind
    driver: Driver
    output: str
    lengths: tuple[str, ...]
    """Names of the unknowns of the shape."""
    branches: tuple[int, ...]
    follow: Callable[[Floats, Floats, Floats], OutputCurve]
    """``follow(lengths (n, 3, 1), branch (n, 1), input (n, M))``: slopes by lengths, not by logarithms."""
    sine: Callable[[Floats, Floats], Floats]
    """``sine(lengths (n, 3, 1), input (n, M))``: sine of the transmission angle, also of complex numbers."""
    mounted: Callable[[Floats, float, float], tuple[tuple[Guide, Guide], float, complex]]
    """``mounted(lengths, first, second)``: guides, and rotation and position of the body at coordinates of both guides."""
    inverse: bool = False
    """True if the second of these guides is driven."""

    @property
    def input(self) -> str:
        """Kind of the input."""
        return ANGLE if self.driver.turns else LENGTH

    @property
    def positive(self) -> tuple[bool, ...]:
        """Unknowns of the shape that are positive lengths, represented by their logarithms."""
        lengths = {"crank", "rod", "ground"} | ({"pin_distance"} if self.output == LENGTH else set())
        return tuple(name in lengths for name in self.lengths)

    @property
    def size(self) -> int:
        """Number of unknowns of the shape."""
        return len(self.lengths)

    def of(self, unknowns: Floats) -> Floats:
        """Return the lengths (n, 3) of unknowns (n, 5); 0 if the shape has fewer."""
        out = np.zeros((len(unknowns), 3), dtype=unknowns.dtype)
        for k, above in enumerate(self.positive):
            out[:, k] = np.exp(unknowns[:, k]) if above else unknowns[:, k]
        return out

    def at(self, unknowns: Floats, branch: Floats, travel: Floats) -> OutputCurve:
        """Return the output at inputs (n, M) from the first sample, and derivatives by the unknowns (n, 5) except the offset."""
        lengths = self.of(unknowns)
        with np.errstate(all="ignore"):
            found = self.follow(lengths[:, :, None], branch[:, None], unknowns[:, 3:4] + travel)
            slope = np.nan_to_num(found.slope)
            for k, above in enumerate(self.positive):
                if above:
                    slope[:, k] *= lengths[:, k, None]
        return OutputCurve(np.nan_to_num(found.value), slope, found.possible & np.isfinite(found.value))

    def sines(self, unknowns: Floats, travel: Floats) -> Floats:
        """Return sines of the transmission angle at inputs (n, M); 0 if the linkage does not close."""
        with np.errstate(all="ignore"):
            found = self.sine(self.of(unknowns)[:, :, None], unknowns[:, 3:4] + travel)
        return np.where(np.isfinite(found), found, 0.0)

    def linkage(self, lengths: Floats, branch: int, zero: float) -> Linkage:
        """Return the linkage with its input at the zero."""
        shape = np.array(lengths, dtype=float).reshape(1, 3, 1)
        output = self.follow(shape, np.full((1, 1), float(branch)), np.full((1, 1), zero)).value.item()
        guides, rotation, position = self.mounted(lengths, *((output, zero) if self.inverse else (zero, output)))
        return through(guides[::-1] if self.inverse else guides, self.driver, rotation, position)


def _columns(lengths: Floats) -> tuple[Floats, Floats, Floats]:
    return lengths[:, 0], lengths[:, 1], lengths[:, 2]


def _safe(value: Floats, divisor_min: float = 1e-12) -> Floats:
    """Replace small divisors: a dead position stops a step."""
    return np.where(np.abs(value) > divisor_min, value, np.copysign(divisor_min, value))


# -- slider-crank ------------------------------------------------------------------------------------------------------


def _crank_to_slider(lengths: Floats, branch: Floats, t: Floats) -> OutputCurve:
    r, rod, e = _columns(lengths)
    sine, cosine = np.sin(t), np.cos(t)
    across = e - r * sine
    square = (rod - across) * (rod + across)
    along = branch * np.sqrt(np.maximum(square, 0.0))
    lever = _safe(along)
    by_angle = -r * sine + across * r * cosine / lever
    slope = np.stack([cosine + across * sine / lever, rod / lever, -across / lever, by_angle], axis=1)
    return OutputCurve(r * cosine + along, slope, square > 0)


def _sine_at_rail(lengths: Floats, t: Floats) -> Floats:
    r, rod, e = _columns(lengths)
    across = e - r * np.sin(t)
    return np.sqrt((rod - across) * (rod + across)) / rod


def _rod_and_crank(lengths: Floats, t: float, p: float) -> tuple[tuple[Guide, Guide], float, complex]:
    r, rod, e = lengths
    pin = complex(r * np.exp(1j * t))
    return (Circle(0j, r, 0j), Rail(1j * e, 0.0, complex(rod))), float(np.angle(p + 1j * e - pin)), pin


def _triangle(first: Floats, second: Floats, opposite: Floats) -> tuple[Floats, Floats]:
    """Return the angle between two sides of a triangle and 16 times its squared area; NaN if there is no triangle."""
    outer = (first + second - opposite) * (first + second + opposite)
    inner = (opposite - (first - second)) * (opposite + (first - second))
    square = outer * inner
    return 2 * np.arctan2(np.sqrt(inner), np.sqrt(outer)), square


def _slider_to_crank(lengths: Floats, branch: Floats, p: Floats) -> OutputCurve:
    r, rod, e = _columns(lengths)
    distance = np.hypot(p, e)
    opening, square = _triangle(distance, r, rod)
    y = np.arctan2(e, p) + branch * opening
    across, along = e - r * np.sin(y), p - r * np.cos(y)
    lever = _safe(r * (across * np.cos(y) - along * np.sin(y)))
    # along dp + across de - (along cos y + across sin y) dr - r (across cos y - along sin y) dy = l dl
    rod = np.broadcast_to(rod, p.shape)
    slope = np.stack([-(along * np.cos(y) + across * np.sin(y)), -rod, across, along], axis=1)
    return OutputCurve(y, slope / lever[:, None], square > 0)


def _sine_at_pin(lengths: Floats, p: Floats) -> Floats:
    r, rod, e = _columns(lengths)
    square = p * p + e * e
    distance = np.sqrt(square)
    area = (distance + r - rod) * (distance + r + rod) * (rod - distance + r) * (rod + distance - r)
    return np.sqrt(area) / (2 * r * rod)


# -- swinging block: a cylinder between two pins ------------------------------------------------------------------------


def _crank_to_cylinder(lengths: Floats, branch: Floats, t: Floats) -> OutputCurve:
    r, d, _ = _columns(lengths)
    cosine = np.cos(t)
    square = (d - r) ** 2 + 4 * d * r * np.sin(t / 2) ** 2
    s = np.sqrt(square)
    lever = _safe(s)
    none = np.zeros_like(t)
    slope = np.stack([(r - d * cosine) / lever, (d - r * cosine) / lever, none, d * r * np.sin(t) / lever], axis=1)
    return OutputCurve(s, slope, square > 0)


def _no_angle(lengths: Floats, inputs: Floats) -> Floats:
    return np.ones(np.broadcast_shapes(lengths[:, 0].shape, inputs.shape), dtype=inputs.dtype) + 0 * inputs


def _block(lengths: Floats, t: float, s: float) -> tuple[tuple[Guide, Guide], float, complex]:
    r, d, _ = lengths
    pin = complex(r * np.exp(1j * t))
    return (Circle(0j, r, 0j), Slot(complex(d), 0j, 0.0)), float(np.angle(d - pin)), pin


def _cylinder_to_crank(lengths: Floats, branch: Floats, s: Floats) -> OutputCurve:
    r, d, _ = _columns(lengths)
    opening, square = _triangle(d, r, s)
    y = branch * opening
    lever = _safe(d * r * np.sin(y))
    none = np.zeros_like(s)
    slope = np.stack([-(r - d * np.cos(y)) / lever, -(d - r * np.cos(y)) / lever, none, s / lever], axis=1)
    return OutputCurve(y, slope, (square > 0) & (s > 0))


def _sine_at_cylinder(lengths: Floats, s: Floats) -> Floats:
    r, d, _ = _columns(lengths)
    area = (s + r - d) * (s + r + d) * (d - s + r) * (d + s - r)
    return np.sqrt(area) / (2 * r * s)


# -- two sliders, and a slotted lever -----------------------------------------------------------------------------------


def _slider_to_slider(lengths: Floats, branch: Floats, p: Floats) -> OutputCurve:
    rod, delta, _ = _columns(lengths)
    cosine, sine = np.cos(delta), np.sin(delta)
    across = p * sine
    square = (rod - across) * (rod + across)
    along = branch * np.sqrt(np.maximum(square, 0.0))
    lever = _safe(along)
    none = np.zeros_like(p)
    by_delta = -p * sine - across * p * cosine / lever
    slope = np.stack([rod / lever, by_delta, none, cosine - across * sine / lever], axis=1)
    return OutputCurve(p * cosine + along, slope, square > 0)


def _sine_at_second_rail(lengths: Floats, p: Floats) -> Floats:
    rod, delta, _ = _columns(lengths)
    across = p * np.sin(delta)
    return np.sqrt((rod - across) * (rod + across)) / rod


def _two_rails(lengths: Floats, p: float, q: float) -> tuple[tuple[Guide, Guide], float, complex]:
    rod, delta, _ = lengths
    guides = Rail(0j, 0.0, 0j), Rail(0j, float(delta), complex(rod))
    return guides, float(np.angle(q * np.exp(1j * delta) - p)), complex(p)


def _slider_to_lever(lengths: Floats, branch: Floats, p: Floats) -> OutputCurve:
    e, h, _ = _columns(lengths)
    square = p * p + (e - h) * (e + h)
    s = np.sqrt(square)
    lever = _safe(s)
    # continuous: the pin lies on the same side of the rail throughout
    y = np.sign(e) * (np.pi / 2 + np.arctan2(p, np.abs(e))) - np.arctan2(h, s)
    none = np.zeros_like(p)
    slope = np.stack([np.cos(y) / lever, -1 / lever, none, np.sin(y) / lever], axis=1)
    return OutputCurve(y, slope, (square > 0) & (np.abs(e) > 0))


def _sine_at_slot(lengths: Floats, p: Floats) -> Floats:
    e, h, _ = _columns(lengths)
    square = p * p + e * e
    return np.sqrt((square - h * h) / square)


def _lever(lengths: Floats, p: float, y: float) -> tuple[tuple[Guide, Guide], float, complex]:
    e, h, _ = lengths
    return (Rail(0j, 0.0, 0j), Slot(1j * e, 1j * h, 0.0)), y, complex(p)


def _slider_to_cylinder(lengths: Floats, branch: Floats, p: Floats) -> OutputCurve:
    e, _, _ = _columns(lengths)
    y = branch * np.hypot(p, e)
    lever, none = _safe(y), np.zeros_like(p)
    return OutputCurve(y, np.stack([e / lever, none, none, p / lever], axis=1), np.abs(y) > 0)


def _cylinder_on_rail(lengths: Floats, p: float, s: float) -> tuple[tuple[Guide, Guide], float, complex]:
    guides = Rail(0j, 0.0, 0j), Slot(1j * float(lengths[0]), 0j, 0.0)
    return guides, float(np.angle(np.sign(s) * (guides[1].pin - p))), complex(p)


def _cylinder_to_slider(lengths: Floats, branch: Floats, s: Floats) -> OutputCurve:
    e, _, _ = _columns(lengths)
    square = (s - e) * (s + e)
    y = branch * np.sqrt(np.maximum(square, 0.0))
    lever, none = _safe(y), np.zeros_like(s)
    return OutputCurve(y, np.stack([-e / lever, none, none, s / lever], axis=1), (square > 0) & (s > 0))


def _sine_on_rail(lengths: Floats, s: Floats) -> Floats:
    e, _, _ = _columns(lengths)
    return np.sqrt((s - e) * (s + e)) / s


_CRANK, _BLOCK, _BOTH = ("crank", "rod", "offset"), ("crank", "ground"), (1, -1)
_CYLINDER, _LEVER, _RAILS = ("pin_distance",), ("pin_distance", "slot_offset"), ("rod", "angle")
LAWS = (
    Law(Kind.SLIDER_CRANK, Driver.CRANK, LENGTH, _CRANK, _BOTH, _crank_to_slider, _sine_at_rail, _rod_and_crank),
    Law(Kind.SWINGING_BLOCK, Driver.CRANK, LENGTH, _BLOCK, (1,), _crank_to_cylinder, _no_angle, _block),
    Law(Kind.SLIDER_CRANK, Driver.SLIDER, ANGLE, _CRANK, _BOTH, _slider_to_crank, _sine_at_pin, _rod_and_crank, True),
    Law(
        Kind.SWINGING_BLOCK,
        Driver.CYLINDER,
        ANGLE,
        _BLOCK,
        _BOTH,
        _cylinder_to_crank,
        _sine_at_cylinder,
        _block,
        True,
    ),
    Law(Kind.RAIL_SLOT, Driver.SLIDER, ANGLE, _LEVER, (1,), _slider_to_lever, _sine_at_slot, _lever),
    Law(Kind.TWO_RAILS, Driver.SLIDER, LENGTH, _RAILS, _BOTH, _slider_to_slider, _sine_at_second_rail, _two_rails),
    Law(Kind.RAIL_SLOT, Driver.SLIDER, LENGTH, _CYLINDER, _BOTH, _slider_to_cylinder, _no_angle, _cylinder_on_rail),
    Law(
        Kind.RAIL_SLOT,
        Driver.CYLINDER,
        LENGTH,
        _CYLINDER,
        _BOTH,
        _cylinder_to_slider,
        _sine_on_rail,
        _cylinder_on_rail,
        True,
    ),
)
"""All laws; those of linkages that are built most often come first."""


def laws_for(kinds: Sequence[str], input: str, output: str) -> list[Law]:
    """Return the laws of some kinds from an input to an output, each "angle" or "length"."""
    return [law for law in LAWS if law.kind in kinds and (law.input, law.output) == (input, output)]
