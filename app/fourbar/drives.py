"""What drives a linkage, over HTTP and on the command line: rotary drives, cylinders, motors that turn on, locks and springs."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

import linkage_atlas as la
from app.fourbar import QUESTIONS
from app.fourbar.answers import SHORT_MS, budget_of, motion_of
from app.fourbar.export import pointing
from app.fourbar.models import (
    DriveLoadRequest,
    DriveRequest,
    Drives,
    GivenLinkage,
    PlacePair,
    RockerRequest,
    Springs,
    SynthesizeRequest,
)
from app.query import AngleUnit, Count, LengthUnit, PositiveNumber, Query, RequestModel, Resources
from app.tables import DEGREES, Units, columns, number


class DrivesRequest(RequestModel):
    """What drives this linkage over its used interval, with this load?"""

    linkage: GivenLinkage | None = Field(
        None, description="One of the `solutions` of a reply, as it came or changed."
    )
    request: SynthesizeRequest | None = Field(None, description="The request that it came from: it says the way.")
    crank_angle: (
        Annotated[list[Annotated[float, Field(ge=-1e9, le=1e9)]], Field(min_length=2, max_length=1024)] | None
    ) = Field(None, description="In place of `request`: crank angles, or travel of its drive, from the start on.")
    rocker: RockerRequest | None = Field(None, description="In place of a linkage: a link on a hinge.")
    load: DriveLoadRequest | None = Field(None, description="Without it the largest least moment arm counts.")
    drives: Drives = Field(
        default_factory=lambda: [DriveRequest(kind=kind) for kind in ("rotary", "actuator", "dyad")],
        description="Kinds of drives that are wanted; default: rotary, actuator and dyad.",
    )
    springs: Springs = Field(default_factory=list, description="Springs that are to carry the load.")
    hand: PlacePair | None = Field(
        None, description="A place on the body at the first position: springs tell the force of a hand there."
    )
    top: Annotated[Count, Field(ge=1, le=50)] = Field(5, description="How many drives of each kind to return.")
    angle_unit: AngleUnit | None = Field(
        None, description="Unit of every angle; default: that of `request`, or degrees."
    )
    length_unit: LengthUnit = Field("mm", description="The unit of all lengths, for the bundled catalogues.")
    budget_ms: PositiveNumber | None = Field(None, description="Return the best found within this time.")


def find_drives(request: DrivesRequest, resources: Resources) -> la.Drives:
    """Drives of each kind, best first, and why there are none elsewhere."""
    if request.linkage is None and request.rocker is None:
        raise la.FieldError("/linkage", "needed, or `rocker`, a link on a hinge")
    unit = request.angle_unit or ("deg" if request.request is None else request.request.angle_unit)
    motion = None
    if request.request is not None:
        if request.request.angle_unit != unit:
            raise la.FieldError(
                "/angle_unit", f"the request that the linkage came from has {request.request.angle_unit!r}"
            )
        with pointing(lambda field: "/request" + field):
            motion = motion_of(request.request)
    linkage, crank = None, request.crank_angle
    if request.linkage is not None:
        with pointing(lambda field: "/linkage" + field):
            linkage = request.linkage.linkage(unit == "deg")
        crank = crank or request.linkage.crank_angle or request.linkage.travel
    return la.drives(
        linkage,
        **request.given("drives", "load", "springs", "rocker", "hand", "length_unit", "top"),
        motion=motion,
        crank_angle=crank,
        degrees=unit == "deg",
        budget=budget_of(request.budget_ms, resources),
        work=resources.work,
    )


def is_long(request: DrivesRequest) -> bool:
    if request.budget_ms is not None and request.budget_ms <= SHORT_MS:
        return False
    return bool(request.springs) or any(one.kind != "rotary" for one in request.drives)


def drives_table(reply: la.Drives, units: Units = DEGREES) -> str:
    """Drives by kind with their places, arm and force, the springs, and why there is nothing elsewhere."""
    lines = []
    if reply.drives:
        lines.append(
            columns(
                reply.drives,
                ("kind", "", "kind"),
                ("link", "", "link"),
                ("name", "", "name"),
                ("ground or motor", "", lambda one: _place(one.ground_point or one.motor)),
                ("pin", "", lambda one: _place(one.pin)),
                (units.head("length", units.length), "", _length),
                ("least arm", ".6g", "arm_min"),
                ("peak force", ".6g", "peak_force"),
                ("over bound", ".4g", "over_bound"),
                ("peak torque", ".6g", "peak_torque"),
                (units.head("transm.", units.angle), ".4g", _angle),
            )
        )
    for one in reply.drives:
        if one.six_bar is not None:
            bar = one.six_bar
            lines.append(
                f"motor on the {one.link}: crank {number(bar.crank)}, rod {number(bar.coupler)}, time ratio "
                f"{number(bar.time_ratio)} ({bar.kind})"
            )
        if one.lock is not None:
            lines.append(
                f"knee on the {one.link}: handle {number(one.lock.handle)}, strut {number(one.lock.strut)}; holds {one.holds}"
            )
    if reply.springs:
        lines.append(
            columns(
                reply.springs,
                ("spring", "", "kind"),
                ("set", "d", "set"),
                ("name", "", "name"),
                ("between", "", lambda one: "-".join(one.between)),
                ("ends", "", lambda one: f"{_place(one.points[0])} {_place(one.points[1])}"),
                ("stiffness", ".6g", "stiffness"),
                ("length", "", lambda one: f"{number(one.length[0])} to {number(one.length[1])}"),
                ("rms torque", "", lambda one: f"{one.torque.before.rms:.4g} -> {one.torque.after.rms:.3g}"),
                ("by itself", "", "stays"),
            )
        )
    for refusal in reply.refused:
        named = "" if refusal.name is None else f" ({refusal.name})"
        lines.append(f"no {refusal.kind} on the {refusal.link}{named}: {refusal.reason}")
    if not lines:
        lines.append("nothing was asked for")
    return "\n".join([*lines, *(f"note: {note}" for note in reply.notes)])


def _place(place: Any) -> str:
    return "-" if place is None else f"({place[0]:.5g}, {place[1]:.5g})"


def _length(one: Any) -> str:
    return "-" if one.length is None else f"{one.length[0]:.5g} to {one.length[1]:.5g}"


def _angle(one: Any) -> float | None:
    return one.transmission_angle_min if one.six_bar is None else one.six_bar.transmission_angle_min


QUERIES = (Query("drive", QUESTIONS["drive"], find_drives, drives_table, is_long=is_long, route="/v1/drives"),)
