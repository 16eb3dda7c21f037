"""A linkage, or a link on a hinge, over the interval of its drive that is used."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields, column, known_fields, number, pair, radians_in
from linkage_atlas.drive_design.question import SIZE_RATIO
from linkage_atlas.linkages import Linkage, given_linkage
from linkage_atlas.motions import Motion
from synthesis.arrays import Floats
from synthesis.drives.links import SAMPLES, LinkMotions, ends_of, hinged_at, motions_at, motions_of
from synthesis.errors import FieldError
from synthesis.linkage import Linkage as Plain
from synthesis.local_refinement import crank_angles_at
from synthesis.poses import Poses
from synthesis.target import MAX_LENGTH, TURN

FINE = 961
"""Positions of the fine evaluation of a motion; searches use `SAMPLES` of them."""


class Operation(NamedTuple):
    """A linkage over the used interval of its drive, and the travel of the drive at the samples of its motion."""

    poses: Callable[[Floats], LinkMotions]
    """The linkage at any travel of its drive."""
    machine: LinkMotions
    """At `SAMPLES` even steps, for searches."""
    fine: LinkMotions
    """At `FINE` even steps."""
    radian: float
    samples: Floats
    plain: Plain | None
    """The linkage; None for a link on a hinge."""

    @classmethod
    def of(cls, linkage: Plain, travel: Floats, radian: float) -> Operation:
        """Prepare a linkage between the smallest and the largest travel of its drive."""
        ends, four_bar = ends_of(travel), linkage.is_four_bar
        if not abs(ends.last - ends.first) > (1e-6 if four_bar else 0.0):
            field, words = ("crank_angle", "crank angle") if four_bar else ("travel", "position of the drive")
            raise FieldError(f"/{field}", f"has no range: its first and last {words} are the same")
        if not four_bar and not linkage.closes_over(ends.after(linkage.start)):
            raise FieldError("/linkage", "does not close over the whole motion; give a smaller range")
        coarse, fine = (motions_of(linkage, ends, count) for count in (SAMPLES, FINE))
        operation = cls(lambda at: motions_at(linkage, at), coarse, fine, radian, travel, linkage)
        operation.check()
        return operation

    @classmethod
    def of_given(
        cls, linkage: object, motion: Motion | None, crank_angle: ArrayLike | None, degrees: bool
    ) -> Operation:
        """Prepare the user's linkage over the interval that a motion, its own motion or crank angles define."""
        angles = None if crank_angle is None else np.atleast_1d(column("crank_angle", crank_angle))
        view, own = given_linkage(linkage, degrees if motion is None else motion.degrees)
        if angles is None and own is not None:
            name = "crank_angle" if view.plain.is_four_bar else "travel"
            angles = np.asarray(column(f"linkage/{name}", own))
        four_bar = view.plain.is_four_bar
        if motion is not None:
            if motion.free and angles is None and view.plain.driver.turns:
                angles = _crank_angles(view, motion)
            if motion.free and angles is None and motion.travel is None:
                raise FieldError(
                    "/linkage/travel",
                    "is required, because the timing of the motion is free; pass the solution of a reply, which has it",
                )
            travel = view.target_of(motion, angles).way
        elif angles is not None:
            if four_bar and (angles.size < 2 or not np.all(np.isfinite(angles))):
                raise FieldError("/crank_angle", "must have at least two finite crank angles")
            travel = angles * view._unit
        elif view.motion_travel is not None:
            travel = view.motion_travel
        else:
            raise FieldError("/crank_angle", "is required, because this linkage has no motion that defines its range")
        return cls.of(view.plain, travel, radians_in(view.degrees))

    @classmethod
    def of_rocker(cls, rocker: Fields, radian: float) -> Operation:
        """Prepare a link on a hinge."""
        values = {"pivot": (0, 0), "start": 0, "length": 1}
        values |= known_fields("rocker", rocker, ("pivot", "start", "swing", "length"))
        swing = number("rocker/swing", values.get("swing")) * radian
        if not 1e-3 <= abs(swing) < np.pi:
            raise FieldError("/rocker/swing", "must be an angle other than 0, of less than half a turn")
        length = number("rocker/length", values["length"])
        if not 0 < length <= MAX_LENGTH:
            raise FieldError("/rocker/length", "must be a length above 0")
        pivot = pair("rocker/pivot", values["pivot"], MAX_LENGTH)
        start = number("rocker/start", values["start"]) * radian

        def poses(at: Floats) -> LinkMotions:
            return hinged_at(pivot, start, length, at)

        machine, fine = (poses(np.linspace(0.0, swing, count)) for count in (SAMPLES, FINE))
        operation = cls(poses, machine, fine, radian, machine.at[[0, -1]], None)
        operation.check()
        return operation

    def check(self) -> None:
        """Raise FieldError if the linkage has a dead position in the interval, or lies too far from the origin."""
        distance = max(float(np.abs(link.origin).max()) for link in self.machine.links.values())
        if distance > SIZE_RATIO * self.machine.extent:
            raise FieldError(
                "/linkage", f"lies farther than {SIZE_RATIO:g} times its size from the origin; move the origin"
            )
        for link in self.fine.links.values():
            bad = ~np.isfinite(link.rate)
            if bad.any():
                at = self.words(self.fine.at[int(np.argmax(bad))])
                raise FieldError("/linkage", f"does not close, or has a dead point, at {at} of its drive's travel")

    @property
    def linkage(self) -> Plain | None:
        """The four-bar, from which ideal springs are computed."""
        return self.plain if self.plain is not None and self.plain.is_four_bar else None

    @property
    def unit(self) -> float:
        """Radians in the user's angle for a drive that turns, 1 for a drive that slides."""
        return self.radian if self.machine.turns else 1.0

    @property
    def curve_at(self) -> Floats:
        """Travel of the drive at the positions of `machine`, in the user's unit."""
        return self.machine.at / self.unit

    def words(self, at: float) -> str:
        """Write a travel of the drive with its unit."""
        angle = " radians" if self.radian == 1 else " degrees"
        return f"{at / self.unit:.6g}" + angle * self.machine.turns

    def poses_around(self, low: float, high: float) -> str:
        """Name the samples of the motion between which two travels of the drive lie."""
        middle, samples = (low + high) / 2, self.samples
        last = samples.size - 1
        for k in range(last):
            if (samples[k] - middle) * (samples[k + 1] - middle) <= 0:
                is_closed = k + 1 == last and abs(abs(samples[last] - samples[0]) - TURN) < 1e-9
                if is_closed and last == 1:
                    return ""
                return f"between poses {k + 1} and {1 if is_closed else k + 2}, "
        return ""

    def masses_of_parts(self, length_unit: str) -> list[dict[str, object]]:
        """Return the masses of the links as plates and pins of default sizes."""
        from linkage_atlas.solids import masses_of_parts

        if self.plain is None:
            raise FieldError("/load/parts", "a link on a hinge has no parts; give its masses")
        weights = masses_of_parts(self.plain, ends_of(self.samples), length_unit)
        return [weight._asdict() for weight in weights]


def _crank_angles(linkage: Linkage, motion: Motion) -> Floats:
    """Return the crank angles at which a linkage comes nearest to the poses of a motion whose timing is free.

    The angles are in the unit of the linkage.
    """
    poses, crank_angles = motion.samples, None
    if isinstance(poses, Poses) and poses.requested is None and linkage.plain.is_four_bar and linkage.plain.mounted:
        crank_angles = crank_angles_at(poses, linkage.plain)
    if crank_angles is None:
        raise FieldError(
            "/linkage/crank_angle",
            "is required, because the crank angles of the motion are free; pass the solution of a reply, which has them",
        )
    return crank_angles / linkage._unit
