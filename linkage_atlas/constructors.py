"""Constructors of the best-known linkages from their lengths."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import number, pair, pointing, radians_in
from linkage_atlas.geometry import LARGEST, CircleGuide, CouplerPoint, Links, RailGuide, read_four_bar
from linkage_atlas.linkages import Linkage
from linkage_atlas.records import xy
from synthesis.errors import FieldError


class FourBar(Linkage):
    """Constructor of a four-bar linkage from its lengths, branch, pose and body point.

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
    coupler_point_polar : tuple of float, optional
        Radius and angle of the body point in the coupler's frame, from the crank pin.
    body_offset : float, optional
        Rotation of the body minus coupler angle and ground angle.
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
        coupler_point_polar: tuple[float, float] | None = None,
        body_offset: float | None = None,
        degrees: bool = True,
    ) -> None:
        point = None if coupler_point_polar is None else dict(zip(CouplerPoint._fields, coupler_point_polar))
        values = {
            "links": Links(crank, coupler, rocker, ground)._asdict(),
            "branch": branch,
            "start_angle": start_angle,
            "body_offset": body_offset,
            "mount": {"pivot_a": pivot_a, "ground_angle": ground_angle, "coupler_point_polar": point},
        }
        self._radian, self._motion = radians_in(degrees), None
        with pointing(lambda field: field.removeprefix("/links").removeprefix("/mount")):
            self._linkage = read_four_bar(values, self._radian)


class SliderCrank(Linkage):
    """Constructor of a crank that drives a slider on a straight rail by a rod, which is the body.

    Parameters
    ----------
    crank, rod : float
        Lengths in any unit.
    offset : float
        Distance of the rail from the crank's pivot, to the left of the rail's direction.
    branch : int
        +1: the slider lies ahead of the crank pin along the rail; -1: behind it.
    start_angle : float
        Angle of the crank from the rail at the first sample.
    pivot : array_like, shape (2,)
        Fixed pivot of the crank.
    rail_angle : float
        Direction of the rail.
    coupler_point_polar : tuple of float, optional
        Radius and angle of the body point from the crank pin, the angle from the rod; default: the slider's pin.
    degrees : bool
        Unit of every angle in and out.

    Raises
    ------
    FieldError
        Naming the argument.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> pump = la.SliderCrank(20, 70, offset=5)
    >>> pump.kind, pump.turns_fully
    ('slider_crank', True)
    >>> pump.joints([0, 180]).coupler_pin.round(6).tolist()
    [[89.8212, 5.0], [49.8212, 5.0]]
    """

    def __init__(
        self,
        crank: float,
        rod: float,
        offset: float = 0.0,
        branch: int = 1,
        *,
        start_angle: float = 0.0,
        pivot: ArrayLike = (0.0, 0.0),
        rail_angle: float = 0.0,
        coupler_point_polar: tuple[float, float] | None = None,
        degrees: bool = True,
    ) -> None:
        radian = radians_in(degrees)
        for name, length in {"crank": crank, "rod": rod}.items():
            if not 0 < number(name, length) <= LARGEST:
                raise FieldError(f"/{name}", f"must be a length above 0; it is {length}")
        if abs(number("offset", offset)) > (crank + rod) * (1 + 1e-12):
            raise FieldError(
                "/offset",
                f"the linkage cannot be assembled; crank and rod reach only {crank + rod:g}, but the offset is {offset:g}",
            )
        turn, at = rail_angle * radian, pair("pivot", pivot, LARGEST)
        radius, angle = (rod, 0.0) if coupler_point_polar is None else coupler_point_polar
        arm = number("coupler_point_polar", radius) * complex(np.exp(1j * angle * radian))
        rail = at + 1j * offset * complex(np.exp(1j * turn))
        super().__init__(
            [
                CircleGuide("circle", xy(at), float(crank), xy(-arm)),
                RailGuide("rail", xy(rail), rail_angle, xy(rod - arm), None),
            ],
            "crank",
            branch,
            start_angle + rail_angle,
            degrees=degrees,
        )
