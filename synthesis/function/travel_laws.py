"""Relations of output and input of linkages with a slider or a cylinder.

An input or an output is the angle of a crank or lever, or the travel of a slider along its rail or of a cylinder. Each
law is y(u) + offset, see `laws`. Frames as in `slider`: the pivot of the crank in the origin, the rail on y = e, the fixed
pin d on the x axis.

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
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from synthesis.arrays import Flags, Floats
from synthesis.function.laws import ANGLE, LENGTH, Conditions, Law, OutputCurve
from synthesis.function.target_function import TargetFunction
from synthesis.guides import Circle, Driver, Guide, Kind, Rail, Slot
from synthesis.limits import Limits
from synthesis.linkage import Linkage, through
from synthesis.one_variable import closer_looks
from synthesis.target import Interval


@dataclass(frozen=True)
class TravelOptions:
    """Options of the limits of linkages with travel."""

    sine_min: float = 1e-4
    """Smallest sine of the transmission angle: where the linkage locks, the output has no derivative."""
    margin: float = 1e-9
    """Margin by which descents satisfy limits."""
    rounding: float = 1e-9
    """Fraction by which rounding may violate a limit."""
    length_max: float = 1e3
    """Largest length over the scale if no limit is smaller."""
    inputs: int = 9
    """Number of inputs at which the transmission angle is evaluated, beside its minimum."""
    imaginary_step: float = 1e-30
    """Imaginary step of the derivatives of sines."""
    looks: tuple[int, ...] = (33, 33, 33, 33)
    """Numbers of nodes of closer looks at the smallest transmission angle."""


OPTIONS = TravelOptions()


@dataclass(frozen=True, eq=False)
class TravelLaw(Law):
    """Relation with the travel of a slider or a cylinder."""

    follow: Callable[[Floats, Floats, Floats], OutputCurve]
    """``follow(lengths (n, 3, 1), branch (n, 1), input (n, M))``: slopes by lengths, not by logarithms."""
    sine: Callable[[Floats, Floats], Floats]
    """``sine(lengths (n, 3, 1), input (n, M))``: sine of the transmission angle, also of complex numbers."""
    mounted: Callable[[Floats, float, float], tuple[tuple[Guide, Guide], float, complex]]
    """``mounted(lengths, first, second)``: guides, and rotation and position of the body at coordinates of both guides."""
    inverse: bool = False
    """True if the second of these guides is driven."""

    @property
    def wraps(self) -> bool:  # type: ignore[override]
        """True if the output is an angle."""
        return self.output == ANGLE

    def at(self, unknowns: Floats, branch: Floats, travel: Floats, derivatives: bool = True) -> OutputCurve:
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

    def linkage(self, lengths: Floats, branch: int, zero: float, scale: float = 1.0) -> Linkage:
        """Return the linkage with its input at the zero; ``scale``: length that is 1 in the search."""
        shape = np.zeros((1, 3, 1))
        shape[0, : self.size, 0] = lengths
        output = self.follow(shape, np.full((1, 1), float(branch)), np.full((1, 1), zero)).value.item()
        guides, rotation, position = self.mounted(
            shape[0, :, 0], *((output, zero) if self.inverse else (zero, output))
        )
        return through(guides[::-1] if self.inverse else guides, self.driver, rotation, position)

    def bounds(self, limits: Limits, largest: bool) -> tuple[float, float]:
        """Return the smallest and the largest length over the scale."""
        return limits.link_min or 1 / OPTIONS.length_max, limits.link_max or OPTIONS.length_max

    def conditions(self, target: TargetFunction, limits: Limits) -> Conditions:
        """Return the conditions of transmission angles, at some inputs and at the minimum, and of the ratio of lengths."""
        least_sine = max(np.sin(limits.transmission_angle_min), OPTIONS.sine_min) + OPTIONS.margin
        inputs = (1 - np.cos(np.linspace(0.0, np.pi, OPTIONS.inputs))) / 2 * target.crank[-1]
        above, ratio_max = np.flatnonzero(self.positive), limits.link_ratio_max

        def evaluate(unknowns: Floats) -> tuple[Floats, Floats]:
            travel = self._with_minimum(unknowns, inputs)
            sines = self.sines(unknowns, travel)
            slopes = np.zeros((*sines.shape, 5))
            for k in (*range(self.size), 3):
                aside: Any = unknowns + 0j
                aside[:, k] += 1j * OPTIONS.imaginary_step
                by = self.sines(aside, travel).imag / OPTIONS.imaginary_step
                slopes[:, :, k] = np.clip(np.nan_to_num(by), -1e6, 1e6)
            if ratio_max is None or above.size < 2:
                return sines - least_sine, slopes
            ratio = unknowns[:, above[:1]] - unknowns[:, above[1:]]
            by_ratio = np.zeros((len(unknowns), 2, 5))
            by_ratio[:, :, above] = [[-1.0, 1.0], [1.0, -1.0]]
            ratios = np.log(ratio_max) + ratio * [-1.0, 1.0]
            return np.concatenate([sines - least_sine, ratios], 1), np.concatenate([slopes, by_ratio], 1)

        return evaluate

    def _with_minimum(self, unknowns: Floats, inputs: Floats) -> Floats:
        """Return inputs (q,), and the input of the smallest transmission angle between them, (n, q + 1)."""
        fixed = np.broadcast_to(inputs, (len(unknowns), inputs.size))
        best = np.argmin(self.sines(unknowns, fixed), axis=1)
        ends = inputs[np.maximum(best - 1, 0)], inputs[np.minimum(best + 1, inputs.size - 1)]
        _, minima = closer_looks(partial(self.sines, unknowns), *ends, OPTIONS.looks)
        return np.concatenate([fixed, minima[:, None]], axis=1)

    def transmission(self, linkages: Sequence[Linkage], used: Interval) -> Floats:
        """Return the exact smallest transmission angles (n,) over travel of the input, NaN if a linkage does not close."""
        return np.array([linkage.transmission_angle_min(used) for linkage in linkages])

    def keeps(self, target: TargetFunction, limits: Limits, linkages: Sequence[Linkage], lengths: Floats) -> Flags:
        """Return which linkages of lengths (n, k) over the scale satisfy limits, except for rounding, (n,)."""
        slack = 1 + OPTIONS.rounding
        angle = self.transmission(linkages, target.interval) * slack
        sizes = lengths[:, [name not in ("offset", "slot_offset", "angle") for name in self.lengths]]
        shortest, longest = np.abs(sizes).min(axis=1), np.abs(sizes).max(axis=1)
        holds = (
            (angle > 0) & (angle >= limits.transmission_angle_min) & (shortest * slack >= (limits.link_min or 0.0))
        )
        holds &= longest <= (limits.link_max or np.inf) * slack
        return np.asarray(holds & (longest <= shortest * (limits.link_ratio_max or np.inf) * slack))

    def sample(self, random: np.random.Generator, low: Floats, high: Floats) -> Floats:
        """Spread unknowns (n, 3) over the useful range of shapes."""
        count, out = len(low), np.zeros_like(low)
        size = np.exp(random.uniform(-1.5, 4.5, (count, 1)) + random.uniform(-1.2, 1.2, (count, 3)))
        for k, (name, above) in enumerate(zip(self.lengths, self.positive)):
            out[:, k] = np.log(size[:, k]) if above else random.choice([-1.0, 1.0], count) * size[:, k]
            if name == "offset":
                reach = size[:, 0] + size[:, 1]
                out[:, k] = reach * np.where(random.random(count) < 0.2, 0.0, random.uniform(-0.8, 0.8, count))
            elif name == "angle":
                out[:, k] = random.uniform(0, np.pi, count)  # the mirror image makes the same function
            elif name == "slot_offset":
                out[:, k] = out[:, 0] * random.uniform(-1.2, 1.2, count) * (random.random(count) > 0.3)
        return out

    def zeros(self, random: np.random.Generator, lengths: Floats, last: float) -> Floats:
        """Spread zeros (n,) over the useful range of lengths (n, 3); ``last``: the input from the first sample to the last."""
        count = len(lengths)
        if self.input == ANGLE:
            return super().zeros(random, lengths, last)
        reach = np.abs(lengths[:, 0]) + np.abs(lengths[:, 1])
        if "angle" in self.lengths:
            reach = lengths[:, 0] / np.maximum(np.abs(np.sin(lengths[:, 1])), 0.1)
        zeros = 1.2 * reach * random.uniform(-1, 1, count) - random.uniform(0, 1, count) * last
        return np.abs(zeros) if self.driver is Driver.CYLINDER else zeros


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


_CRANK, _BLOCK, _LEVER, _BOTH = (
    ("crank", "rod", "offset"),
    ("crank", "ground"),
    ("pin_distance", "slot_offset"),
    (1, -1),
)
_TURNED_CRANK = _crank_to_slider, _sine_at_rail, _rod_and_crank
_PUSHED_CRANK = _slider_to_crank, _sine_at_pin, _rod_and_crank
_CYLINDER = _cylinder_to_crank, _sine_at_cylinder, _block
_SLIDER_BY_CYLINDER = _cylinder_to_slider, _sine_on_rail, _cylinder_on_rail
_RAILS = "rod", "angle"
LAWS = (
    TravelLaw(Kind.SLIDER_CRANK, Driver.CRANK, LENGTH, _CRANK, _BOTH, *_TURNED_CRANK),
    TravelLaw(Kind.SWINGING_BLOCK, Driver.CRANK, LENGTH, _BLOCK, (1,), _crank_to_cylinder, _no_angle, _block),
    TravelLaw(Kind.SLIDER_CRANK, Driver.SLIDER, ANGLE, _CRANK, _BOTH, *_PUSHED_CRANK, inverse=True),
    TravelLaw(Kind.SWINGING_BLOCK, Driver.CYLINDER, ANGLE, _BLOCK, _BOTH, *_CYLINDER, inverse=True),
    TravelLaw(Kind.RAIL_SLOT, Driver.SLIDER, ANGLE, _LEVER, (1,), _slider_to_lever, _sine_at_slot, _lever),
    TravelLaw(
        Kind.TWO_RAILS, Driver.SLIDER, LENGTH, _RAILS, _BOTH, _slider_to_slider, _sine_at_second_rail, _two_rails
    ),
    TravelLaw(
        Kind.RAIL_SLOT, Driver.SLIDER, LENGTH, _LEVER[:1], _BOTH, _slider_to_cylinder, _no_angle, _cylinder_on_rail
    ),
    TravelLaw(Kind.RAIL_SLOT, Driver.CYLINDER, LENGTH, _LEVER[:1], _BOTH, *_SLIDER_BY_CYLINDER, inverse=True),
)
"""Laws with travel; the linkages that are built most often come first."""


def laws_for(kinds: Sequence[str], input: str, output: str) -> list[TravelLaw]:
    """Return the laws with travel of some kinds from an input to an output, each "angle" or "length"."""
    return [law for law in LAWS if (law.input, law.output) == (input, output) and law.kind.value in kinds]
