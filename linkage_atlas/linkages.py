"""A four-bar as a user handles it: angles in degrees (or radians), plain arrays, drawings and files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.any_linkage import AnyLinkage
from linkage_atlas.arguments import column, number, pair, radians_in
from linkage_atlas.assemblies import Assembly
from linkage_atlas.guided import GuidedLinkage
from linkage_atlas.motions import Motion
from linkage_atlas.records import plain, plane
from linkage_atlas.studies import Analysis, read_analysis
from synthesis.arrays import Floats
from synthesis.errors import FieldError
from synthesis.fourbar.linkage import Linkage, are_cognates
from synthesis.target import TURN, Interval, Target


class Joints(NamedTuple):
    """Where a linkage's joints are at n crank angles; NaN where the loop does not close. Angles in the linkage's unit.

    Directions are against the x axis. ``body_point`` is None where the linkage guides none.
    """

    pivot_a: Floats
    """(2,): fixed pivot of the crank."""
    pivot_b: Floats
    """(2,): fixed pivot of the rocker."""
    crank_pin: Floats
    """(n, 2)"""
    coupler_pin: Floats
    """(n, 2)"""
    body_point: Floats | None
    """(n, 2)"""
    crank_direction: Floats
    coupler_direction: Floats
    rocker_direction: Floats
    rotation: Floats
    """(n,): of the body."""
    transmission_angle: Floats


class Links(NamedTuple):
    """Lengths of a four-bar; the ground is the distance of its fixed pivots."""

    crank: float
    coupler: float
    rocker: float
    ground: float


class CouplerPoint(NamedTuple):
    """The body point in the coupler's frame, from the crank pin."""

    radius: float
    angle: float


class Mount(NamedTuple):
    """Where a linkage stands, and which point it guides."""

    ground_angle: float
    """Angle of the line from pivot A to pivot B."""
    pivot_a: tuple[float, float]
    """Fixed pivot of the crank."""
    pivot_b: tuple[float, float]
    """Fixed pivot of the rocker."""
    coupler_point: Annotated[CouplerPoint | None, CouplerPoint]
    """P = D + radius e^(i (angle + coupler angle + ground angle)), D the crank pin."""
    L_B: float
    """Distance of pivot A from the origin."""
    beta: float
    """Angle of pivot A as seen from the origin."""


class Dimensions(NamedTuple):
    """A linkage as a reply holds it."""

    links: Links
    branch: Any
    start_angle: float
    body_offset: float | None
    mount: Mount | None


class FourBar(AnyLinkage):
    """A four-bar linkage: four lengths, a branch, a place, and the body point that it guides.

    Parameters
    ----------
    crank, coupler, rocker, ground : float
        Lengths in any unit.
    branch : int
        +1: the coupler pin C lies to the left of the line from the crank pin D to pivot B; -1: to the right.
    start_angle : float
        Angle of the crank from the ground line at the first sample: where `joints` begins.
    pivot_a : array_like, shape (2,)
        Fixed pivot of the crank.
    ground_angle : float
        Angle of the line from pivot A to pivot B.
    coupler_point : tuple of float, optional
        Radius and angle of the body point in the coupler's frame, from the crank pin.
    body_offset : float, optional
        rotation of the body = coupler angle + ground angle + this.
    degrees : bool
        Unit of every angle in and out.

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> linkage = la.FourBar(19, 72, 144, 165, branch=1)
    >>> linkage.family
    'crank_rocker'
    >>> linkage.joints([0, 90]).crank_pin.round(6).tolist()
    [[19.0, 0.0], [0.0, 19.0]]
    """

    _linkage: Linkage
    _drive = "crank"

    def __init__(
        self,
        crank: float,
        coupler: float,
        rocker: float,
        ground: float,
        branch: int = 1,
        *,
        start_angle: float = 0.0,
        pivot_a: ArrayLike = (0.0, 0.0),
        ground_angle: float = 0.0,
        coupler_point: tuple[float, float] | None = None,
        body_offset: float | None = None,
        degrees: bool = True,
    ) -> None:
        radian = radians_in(degrees)
        lengths = {"crank": crank, "coupler": coupler, "rocker": rocker, "ground": ground}
        for name, length in lengths.items():
            if not number(name, length) > 0:
                raise FieldError(f"/{name}", f"wanted a length above 0, found {length}")
        if branch not in (-1, 1):
            raise FieldError("/branch", f"wanted 1 or -1, found {branch}")
        point = None if coupler_point is None else (float(coupler_point[0]), float(coupler_point[1]) * radian)
        self._linkage = Linkage(
            (float(crank), float(coupler), float(rocker), float(ground)),
            int(branch),
            float(start_angle) * radian,
            pair("pivot_a", pivot_a, np.inf),
            float(ground_angle) * radian,
            point,
            None if body_offset is None else float(body_offset) * radian,
        )
        self._radian = radian
        self._motion: Target | None = None

    @property
    def plain(self) -> Linkage:
        """The same in radians, as the numerics have it."""
        return self._linkage

    # -- what it is ---------------------------------------------------------------------------------------------------

    @property
    def crank(self) -> float:
        """Length of the crank."""
        return self._linkage.links[0]

    @property
    def coupler(self) -> float:
        """Length of the coupler."""
        return self._linkage.links[1]

    @property
    def rocker(self) -> float:
        """Length of the rocker."""
        return self._linkage.links[2]

    @property
    def ground(self) -> float:
        """Distance of the fixed pivots."""
        return self._linkage.links[3]

    @property
    def links(self) -> Floats:
        """Crank, coupler, rocker, ground, shape (4,)."""
        return np.array(self._linkage.links)

    @property
    def start_angle(self) -> float:
        """Angle of the crank from the ground line at the first sample."""
        return self._linkage.start / self._radian

    @property
    def ground_angle(self) -> float:
        """Angle of the line from pivot A to pivot B."""
        return self._linkage.ground_angle / self._radian

    @property
    def pivot_a(self) -> Floats:
        """Fixed pivot of the crank, shape (2,)."""
        return plane(self._linkage.pivot_a)

    @property
    def pivot_b(self) -> Floats:
        """Fixed pivot of the rocker, shape (2,)."""
        return plane(self._linkage.pivot_b)

    @property
    def coupler_point(self) -> tuple[float, float] | None:
        """Radius and angle of the body point in the coupler's frame."""
        point = self._linkage.coupler_point
        return None if point is None else (point[0], point[1] / self._radian)

    @property
    def body_offset(self) -> float | None:
        """Rotation of the body less coupler angle and ground angle."""
        offset = self._linkage.body_offset
        return None if offset is None else offset / self._radian

    @property
    def family(self) -> str:
        """How it can turn: crank_rocker, double_crank, ..."""
        return self._linkage.family.value

    def is_cognate_of(self, other: FourBar) -> bool:
        """Whether both are Roberts cognates: different linkages whose body points draw the same curve."""
        both = self._linkage, other._linkage
        return all(one.mounted for one in both) and are_cognates(*both)

    # -- how it moves -------------------------------------------------------------------------------------------------

    def joints(self, crank: ArrayLike) -> Joints:
        """Where the joints are.

        Parameters
        ----------
        crank : array_like, shape (n,) or a number
            Crank angles from the start angle on.

        Returns
        -------
        Joints
        """
        found = self._linkage.joints(np.asarray(crank, dtype=float) * self._radian)
        point = found.body_point
        angles = (
            found.crank_angle,
            found.coupler_angle,
            found.rocker_angle,
            found.rotation,
            found.transmission_angle,
        )
        return Joints(
            plane(found.pivot_a),
            plane(found.pivot_b),
            plane(found.crank_pin),
            plane(found.coupler_pin),
            None if point is None else plane(point),
            *(angle / self._radian for angle in angles),
        )

    def transmission_angle_min(self, first: float | None = None, last: float | None = None) -> float:
        """The smallest transmission angle between two crank angles (default: a whole turn), exactly; NaN where it opens."""
        ends = [0.0 if first is None else first * self._radian, TURN if last is None else last * self._radian]
        return self._linkage.transmission_angle_min(Interval(*ends)) / self._radian

    def analysis(
        self,
        crank_speed: float,
        load: Mapping[str, Any] | None = None,
        crank: ArrayLike | None = None,
        *,
        length_unit: str = "mm",
    ) -> Analysis:
        """Velocities, accelerations and, with a load, the torque of the drive and the forces in the pins.

        Parameters
        ----------
        crank_speed : float
            Of the crank, constant, counter-clockwise: in the linkage's unit of angle a second.
        load : mapping, optional
            ``force`` [fx, fy] at the body point and ``torque`` on the body, in directions that do not turn with it; ``masses``, a
            list of ``link`` (crank, coupler, rocker or body), ``mass`` in kg, centre ``at`` [x, y] and ``inertia`` in the link's
            frame; ``parts``, true for also what `solids` weigh by default; ``gravity`` [gx, gy] in m/s^2 ([0, -9.81]). With
            masses forces are in newtons.
        crank : array_like, shape (n,), optional
            Crank angles from the start angle on. Default: the samples of the motion that it answers (or a whole turn), with the
            `curve` over their interval.
        length_unit : {"mm", "cm", "m", "in"}
            The unit of its lengths, which tells the forces of inertia.
        """
        given = {"crank_speed": crank_speed, "load": load, "length_unit": length_unit}
        asked = read_analysis(given, self._linkage.mounted)
        found: Analysis = self._analysed_at(asked, "crank", crank)
        return found

    # -- what it becomes ----------------------------------------------------------------------------------------------

    @property
    def dimensions(self) -> Dimensions:
        """Lengths, branch, start and mount under the names of the HTTP contract."""
        one, mount = self._linkage, None
        if one.mounted or one.pivot_a or one.ground_angle:
            mount = Mount(
                ground_angle=one.ground_angle / self._radian,
                pivot_a=(one.pivot_a.real, one.pivot_a.imag),
                pivot_b=(one.pivot_b.real, one.pivot_b.imag),
                coupler_point=None if self.coupler_point is None else CouplerPoint(*self.coupler_point),
                L_B=abs(one.pivot_a),
                beta=float(np.angle(one.pivot_a)) / self._radian,
            )
        return Dimensions(
            Links(*map(float, one.links)), one.branch, one.start / self._radian, self.body_offset, mount
        )

    def to_dict(self) -> dict[str, Any]:
        """Plain values under the names of the HTTP contract; `from_dict` takes them back."""
        return dict(plain(self.dimensions))

    @classmethod
    def from_dict(cls, values: Mapping[str, Any], degrees: bool = True) -> FourBar:
        """A linkage from what `to_dict` gives, or from a solution of a reply over HTTP."""
        mount = values.get("mount") or {}
        point = mount.get("coupler_point")
        return cls(
            **{name: values["links"][name] for name in ("crank", "coupler", "rocker", "ground")},
            branch=values["branch"],
            start_angle=values.get("start_angle", 0.0),
            pivot_a=mount.get("pivot_a", (0.0, 0.0)),
            ground_angle=mount.get("ground_angle", 0.0),
            coupler_point=None if point is None else (point["radius"], point["angle"]),
            body_offset=values.get("body_offset"),
            degrees=degrees,
        )

    def target_of(self, motion: Motion | None, travel: ArrayLike | None) -> Target:
        """A motion with the crank angles of this solution where its own are free; without one the default."""
        if motion is not None and motion.free:
            if travel is None:
                raise FieldError("/crank_angle", "needed: the motion's crank angles are free")
            motion = motion.of_solution(self._linkage, column("crank_angle", travel) * self._radian)
        return motion.target if motion is not None else self._default_motion()

    def __repr__(self) -> str:
        lengths = ", ".join(f"{name}={getattr(self, name):.6g}" for name in ("crank", "coupler", "rocker", "ground"))
        return f"FourBar({lengths}, branch={self.branch:+d}: {self.family})"


def assembly(linkage: Any, motion: Motion | None = None, **asked: Any) -> Assembly:
    """Layers of a linkage's plates in which nothing collides; see `FourBar.assembly` for what may be asked.

    Parameters
    ----------
    linkage : FourBar, GuidedLinkage, Solution or mapping
        The linkage, or its plain values as ``to_dict`` or a reply gives them, in the motion's unit of angle (degrees
        without a motion).
    motion : Motion, optional
        Over whose interval; default: the motion that the linkage answers, or else a whole turn.
    **asked
        As of `FourBar.assembly`.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> la.assembly(la.FourBar(19, 72, 144, 165)).status
    'free'
    """
    one, travel = given_linkage(linkage, motion is None or motion.degrees)
    for name in ("crank_angle", "travel") if one is not linkage else ():
        travel = getattr(linkage, name, None) if travel is None else travel
    crank = asked.pop("crank_angle", None)
    return one.assembly(motion, travel if crank is None else crank, **asked)


def given_linkage(given: Any, degrees: bool) -> tuple[AnyLinkage, Any]:
    """A linkage that is given as such, as a solution, or as plain values; and of those the travel of its drive, if it is there.

    Raises `FieldError`: ``/linkage``, or the field within that is amiss.
    """
    if not isinstance(given, Mapping):
        one = given if isinstance(given, AnyLinkage) else getattr(given, "linkage", given)
        if not isinstance(one, AnyLinkage):
            raise FieldError(
                "/linkage", "wanted a linkage, a four-bar or on two guides, a solution, or its plain values"
            )
        return one, None
    travel = given.get("travel") if given.get("crank_angle") is None else given["crank_angle"]
    if given.get("guides") is not None and given.get("links") is None:
        return GuidedLinkage.from_dict(given, degrees), travel
    try:
        return FourBar.from_dict(given, degrees), travel
    except (KeyError, TypeError):
        raise FieldError("/linkage", "wanted links (crank, coupler, rocker, ground), branch, start_angle") from None
