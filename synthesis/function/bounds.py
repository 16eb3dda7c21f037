"""The limits of a function generator as smooth conditions on length ratios and start, with their derivatives.

Unknowns are those of `charts.AnyChart` and the start: x = (ln L1/L4, ln L2/L4, ln L3/L4, theta1'). Every condition is at least
0 where it is kept. The transmission angle tau at a diagonal r has cos tau = |u|, u = (L2^2 + L3^2 - r^2) / (2 L2 L3), and r
grows with sin^2(theta1 / 2); so over an interval two values of u decide, and no minimum over crank angles is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import transmission_angle_over
from synthesis.fourbar.limits import FAMILIES, in_family
from synthesis.target import TURN, Interval

Floats = NDArray[np.float64]

RATIO = 20.0
"""Lengths over the ground that are sought, and one over it, where no limit says otherwise."""
_CLOSES = 1e-4
"""Least transmission angle in radians: where the linkage locks, the rocker's angle has no derivative."""
_MARGIN = 1e-9
_GROUND = 3
_EXCESSES = np.array([[-1.0, 1.0, -1.0, 1.0], [-1.0, -1.0, 1.0, 1.0], [-1.0, 1.0, 1.0, -1.0]])
"""Coefficients of the Grashof excesses a, b, c by the lengths, see `kinematics.grashof_excesses`."""


@dataclass(frozen=True)
class FunctionLimits:
    """Limits of a function generator; angles in radians, lengths in the unit of the ground's.

    Attributes
    ----------
    family : str
        One of `limits.FAMILIES`; ``any`` closes over the used interval and stays on its branch there.
    transmission_angle_min : float
        Over the used interval.
    transmission_angle_min_turn : float
        Over the whole turn, of linkages whose crank turns fully.
    link_ratio_max : float, optional
        Of the longest link over the shortest.
    link_min, link_max : float, optional
        Of each of the four lengths.
    links : tuple of float or None
        Crank, coupler, rocker, ground: lengths that are given. A ground that is not given is 1.
    one_way : bool
        The rocker does not turn back within the interval; see `problem.Problem` and `answers.turns_back`.
    """

    family: str = "any"
    transmission_angle_min: float = 0.0
    transmission_angle_min_turn: float = 0.0
    link_ratio_max: float | None = None
    link_min: float | None = None
    link_max: float | None = None
    links: tuple[float | None, float | None, float | None, float | None] = (None, None, None, None)
    one_way: bool = False

    @property
    def ground(self) -> float:
        """Length of the ground."""
        return self.links[_GROUND] or 1.0

    @property
    def only_family(self) -> bool:
        """Whether nothing but the family is limited."""
        numbers = (self.transmission_angle_min, self.transmission_angle_min_turn, self.link_min, self.link_max)
        return not (any(numbers) or self.link_ratio_max or any(self.links[:_GROUND]) or self.one_way)

    @property
    def given(self) -> Floats:
        """ln of the ratios that are given, NaN of the others, (3,)."""
        lengths = [np.nan if one is None else one / self.ground for one in self.links[:_GROUND]]
        return np.log(lengths)

    def box(self, otherwise: float) -> tuple[Floats, Floats]:
        """Least and largest ln of the ratios that are sought, (3,) each; ``otherwise`` is the ratio where nothing is limited."""
        ratio = self.link_ratio_max or otherwise
        low = 1 / ratio if self.link_min is None else self.link_min / self.ground
        high = ratio if self.link_max is None else self.link_max / self.ground
        return np.full(3, np.log(low)), np.full(3, np.log(high))

    def exchanged(self) -> FunctionLimits:
        """The same limits for the linkage with coupler and rocker exchanged."""
        crank, coupler, rocker, ground = self.links
        return FunctionLimits(**{**vars(self), "links": (crank, rocker, coupler, ground)})

    def kept_by(self, lengths: Floats, start: Floats, interval: Interval) -> NDArray[np.bool_]:
        """Which linkages (n, 4), the ground as asked for, keep all limits, (n,); checked on the kinematics themselves."""
        used = np.nan_to_num(transmission_angle_over(lengths, interval.after(start)))
        kept = (used > 0) & (used >= self.transmission_angle_min) & in_family(self.family, lengths)
        if self.transmission_angle_min_turn:
            turn = transmission_angle_over(lengths, Interval(np.zeros(len(start)), np.full(len(start), np.pi)))
            kept &= ~in_family("full_crank", lengths) | (np.nan_to_num(turn) >= self.transmission_angle_min_turn)
        shortest, longest = lengths.min(axis=1), lengths.max(axis=1)
        if self.link_ratio_max is not None:
            kept &= longest <= self.link_ratio_max * shortest * (1 + 1e-12)
        if self.link_min is not None:
            kept &= shortest >= self.link_min * (1 - 1e-12)
        if self.link_max is not None:
            kept &= longest <= self.link_max * (1 + 1e-12)
        return kept

    def conditions(self, unknowns: Floats, interval: Interval) -> tuple[Floats, Floats]:
        """Conditions (n, m) at unknowns (n, 4), and their derivatives (n, m, 4)."""
        with np.errstate(over="ignore"):
            lengths = np.concatenate([np.exp(unknowns[:, :3]), np.ones((len(unknowns), 1))], axis=1)
        least = max(self.transmission_angle_min, _CLOSES)
        inner, outer = (_nearest(centre, unknowns[:, 3], interval) for centre in (0.0, np.pi))
        rows = [
            _transmission(lengths, least, angle, moves, side) for (angle, moves), side in ((inner, -1), (outer, 1))
        ]
        excess = lengths @ _EXCESSES.T
        longer = lengths[:, 0] > lengths[:, 3]
        # the signs of a, b, c that are asked for
        side = np.where(longer, -1.0, 1.0)
        if self.family in ("crank_rocker", "double_crank"):
            side = np.full(len(lengths), 1.0 if self.family == "crank_rocker" else -1.0)
        signs = np.stack([side, side, np.ones_like(side)], axis=1)
        if self.family != "any":
            total = lengths.sum(axis=1)[:, None]
            value = signs * excess / total
            slope = (signs[:, :, None] * _EXCESSES - value[:, :, None]) / total[:, :, None] * lengths[:, None, :]
            for k in range(3):
                rows.append(
                    (value[:, k] - _MARGIN, np.concatenate([slope[:, k, :3], np.zeros((len(lengths), 1))], 1))
                )
        if self.transmission_angle_min_turn:
            full = np.all(signs * excess > 0, axis=1) | (self.family != "any")
            still = np.zeros(len(lengths))
            for angle, way in ((0.0, -1), (np.pi, 1)):
                value, slope = _transmission(
                    lengths, self.transmission_angle_min_turn, np.full(len(lengths), angle), still, way
                )
                rows.append((np.where(full, value, 1.0), np.where(full[:, None], slope, 0.0)))
        if self.link_ratio_max is not None:
            logs = np.concatenate([unknowns[:, :3], np.zeros((len(unknowns), 1))], axis=1)
            for i in range(4):
                for k in range(4):
                    if i != k:
                        slope = np.zeros((len(logs), 4))
                        slope[:, [i, k]] = np.array([-1.0, 1.0])
                        slope[:, 3] = 0.0
                        rows.append((np.log(self.link_ratio_max) - logs[:, i] + logs[:, k], slope))
        return np.stack([value for value, _ in rows], axis=1), np.stack([slope for _, slope in rows], axis=1)

    def check(self) -> None:
        """FieldError for limits that contradict each other or have no meaning."""
        if self.family not in FAMILIES:
            raise FieldError("/limits/family", f"wanted one of {', '.join(FAMILIES)}")
        for name in ("transmission_angle_min", "transmission_angle_min_turn"):
            if not 0 <= getattr(self, name) < np.pi / 2:
                raise FieldError(f"/limits/{name}", "wanted 0 to less than 90 degrees")
        for name in ("link_min", "link_max"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise FieldError(f"/limits/{name}", "wanted a length above 0")
        if self.link_min is not None and self.link_max is not None and self.link_min > self.link_max:
            raise FieldError("/limits/link_min", "is above link_max")
        if self.link_ratio_max is not None and not self.link_ratio_max >= 1:
            raise FieldError("/limits/link_ratio_max", "wanted a ratio of at least 1")


def _nearest(centre: float, start: Floats, interval: Interval) -> tuple[Floats, Floats]:
    """The crank angles of intervals nearest to ``centre`` (modulo a turn), and their derivatives by the start, (n,) each."""
    low, high = np.sort(interval)
    low, high = start + low, start + high
    wanted = centre + TURN * np.rint(((low + high) / 2 - centre) / TURN)
    angle = np.clip(wanted, low, high)
    return angle, (angle != wanted).astype(float)


def _transmission(lengths: Floats, least: float, angle: Floats, moves: Floats, side: int) -> tuple[Floats, Floats]:
    """cos(least) + side u at crank angles (n,), and its derivatives (n, 4)."""
    l1, l2, l3, _ = lengths.T
    sine2 = np.sin(angle / 2) ** 2
    r2 = (1 - l1) ** 2 + 4 * l1 * sine2
    product = 2 * l2 * l3
    u = (l2 * l2 + l3 * l3 - r2) / product
    slope = np.stack(
        [
            -l1 * (4 * sine2 - 2 * (1 - l1)) / product,
            (l2 * l2 - l3 * l3 + r2) / product,
            (l3 * l3 - l2 * l2 + r2) / product,
            -2 * l1 * np.sin(angle) / product * moves,
        ],
        axis=1,
    )
    return np.cos(least) - _MARGIN + side * u, side * slope
