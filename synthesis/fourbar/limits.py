"""What a solution must keep to: family, transmission angle over the used interval, link lengths, a box for the pivots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from synthesis.errors import FieldError
from synthesis.fourbar.kinematics import grashof_excesses, transmission_angle_over
from synthesis.fourbar.solution import Solution
from synthesis.target import Samples, Target

Floats = NDArray[np.float64]

FAMILIES = ("full_crank", "crank_rocker", "double_crank", "any")


def in_family(family: str, lengths: Floats) -> NDArray[np.bool_]:
    """Which linkages (n, 4) are of one of `FAMILIES`, whatever their interval, shape (n,)."""
    a, b, c = grashof_excesses(lengths)
    crank_rocker = (a > 0) & (b > 0) & (c > 0)
    double_crank = (a < 0) & (b < 0) & (c > 0)
    return {
        "full_crank": crank_rocker | double_crank,
        "crank_rocker": crank_rocker,
        "double_crank": double_crank,
        "any": np.ones(len(lengths), dtype=bool),
    }[family]


@dataclass(frozen=True)
class Limits:
    """Limits of a request; angles in radians, lengths in the user's unit (without positions: the ground is 1).

    Attributes
    ----------
    family : str
        One of `FAMILIES`; ``any`` closes over the used interval and stays on its branch there.
    transmission_angle_min : float
        Over the whole used interval, 0 to pi/2.
    pivot_box : tuple of float, optional
        xmin, ymin, xmax, ymax for both fixed pivots.
    link_min, link_max : float, optional
        For each of the four lengths.
    """

    family: str = "full_crank"
    transmission_angle_min: float = 0.0
    pivot_box: tuple[float, float, float, float] | None = None
    link_min: float | None = None
    link_max: float | None = None

    def __post_init__(self) -> None:
        if self.family not in FAMILIES:
            raise FieldError("/limits/family", f"wanted one of {', '.join(FAMILIES)}")
        if not 0 <= self.transmission_angle_min < np.pi / 2:
            raise FieldError("/limits/transmission_angle_min", "wanted 0 to less than 90 degrees")
        box = self.pivot_box
        if box is not None and not (box[0] <= box[2] and box[1] <= box[3]):
            raise FieldError(
                "/limits/pivot_box", "wanted [xmin, ymin, xmax, ymax] with xmin <= xmax and ymin <= ymax"
            )
        for name in ("link_min", "link_max"):
            value = getattr(self, name)
            if value is not None and not value > 0:
                raise FieldError(f"/limits/{name}", "wanted a length above 0")
        if self.link_min is not None and self.link_max is not None and self.link_min > self.link_max:
            raise FieldError("/limits/link_min", "is above link_max")

    def check_against(self, samples: Samples) -> None:
        """FieldError for limits that have no meaning for these samples."""
        if samples.position is None and self.pivot_box is not None:
            raise FieldError("/limits/pivot_box", "needs `position`: without it nothing is mounted")

    def mirrored(self) -> Limits:
        """The same limits for a target mirrored in the x axis."""
        if self.pivot_box is None:
            return self
        xmin, ymin, xmax, ymax = self.pivot_box
        return replace(self, pivot_box=(xmin, -ymax, xmax, -ymin))

    @property
    def only_family(self) -> bool:
        """Whether nothing but the family is limited."""
        return not (self.transmission_angle_min or self.pivot_box or self.link_min or self.link_max)

    def slacks(
        self, target: Target, lengths: Floats, start: Floats, pivots: Sequence[NDArray[np.complex128]]
    ) -> Floats:
        """How far inside each limit linkages are: one column a limit, negative outside, NaN where it does not close.

        Parameters
        ----------
        target : Target
        lengths : ndarray, shape (n, 4)
            Actual lengths.
        start : ndarray, shape (n,)
            theta1 at the first sample.
        pivots : sequence of ndarray of complex, shape (n,)
            Fixed pivots A and B; none where nothing is mounted.

        Returns
        -------
        ndarray, shape (n, columns)
            Angles in radians; lengths as logarithms of ratios; pivots over the length scale. All of order one, smooth inside.
        """
        columns: list[Floats] = []
        if self.transmission_angle_min:
            least = transmission_angle_over(lengths, target.interval.after(start))
            columns.append(least - self.transmission_angle_min)
        if self.link_min is not None:
            columns += list(np.log(lengths / self.link_min).T)
        if self.link_max is not None:
            columns += list(np.log(self.link_max / lengths).T)
        if self.pivot_box is not None:
            xmin, ymin, xmax, ymax = self.pivot_box
            for pivot in pivots:
                edges = (pivot.real - xmin, xmax - pivot.real, pivot.imag - ymin, ymax - pivot.imag)
                columns += [edge / target.length_scale for edge in edges]
        return np.stack(columns, axis=-1) if columns else np.empty((len(lengths), 0))

    def family_holds(self, target: Target, lengths: Floats, start: Floats) -> NDArray[np.bool_]:
        """Whether linkages are of the family that is asked for, and close over the whole used interval, shape (n,)."""
        if self.family == "any":
            return transmission_angle_over(lengths, target.interval.after(start)) > 0
        return in_family(self.family, lengths)

    def kept_by(
        self, target: Target, lengths: Floats, start: Floats, pivots: Sequence[NDArray[np.complex128]]
    ) -> NDArray[np.bool_]:
        """Which linkages keep all limits, the family included; arguments as of `slacks`, shape (n,)."""
        holds = self.family_holds(target, lengths, start)
        return holds & np.all(self.slacks(target, lengths, start, pivots) >= 0, axis=-1)

    def within(self, target: Target, solutions: list[Solution]) -> list[Solution]:
        """The solutions that keep the limits, checked on their own numbers."""
        if not solutions:
            return []
        linkages = [s.linkage for s in solutions]
        links, start = np.array([one.links for one in linkages]), np.array([one.start for one in linkages])
        pivots: list[NDArray[np.complex128]] = []
        if target.position is not None:
            pivots = [np.array([one.pivot_a for one in linkages]), np.array([one.pivot_b for one in linkages])]
        keeps = self.kept_by(target, links, start, pivots) & np.isfinite([s.errors.objective for s in solutions])
        return [s for s, keep in zip(solutions, keeps) if keep]
