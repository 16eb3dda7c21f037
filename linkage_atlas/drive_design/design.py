"""Drives and springs of a linkage: request, linkage over its motion, searches, reply.

`drives` answers a user; `driven_solution` answers for one solution of a search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from linkage_atlas.arguments import Fields, check_above_zero, check_top, millimetres_in, radians_in, sequence
from linkage_atlas.drive_design.actuators import find_actuator
from linkage_atlas.drive_design.motors import find_motor
from linkage_atlas.drive_design.operation import Operation
from linkage_atlas.drive_design.question import ActuatorRequest, DriveQuestion, DriveRequest, Reader, RotaryRequest
from linkage_atlas.drive_design.records import Drives, Refusal
from linkage_atlas.drive_design.rotary import find_rotary
from linkage_atlas.drive_design.springs import find_springs
from linkage_atlas.drive_design.task import DriveTask
from linkage_atlas.motions import Motion
from synthesis.arrays import Floats
from synthesis.drives.links import motions_of
from synthesis.errors import FieldError
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage, four_bar
from synthesis.target import Interval
from synthesis.work import Work

REPLY_ORDER = ("rotary", "actuator", "dyad")
"""Order of the kinds of drives in a reply."""


def drives(
    linkage: object = None,
    drives: Sequence[Fields] = ({"kind": "rotary"}, {"kind": "actuator"}, {"kind": "dyad"}),
    *,
    load: Fields | None = None,
    springs: Sequence[Fields] = (),
    motion: Motion | None = None,
    crank_angle: ArrayLike | None = None,
    rocker: Fields | None = None,
    hand_point: ArrayLike | None = None,
    length_unit: str | None = None,
    top: int = 5,
    degrees: bool = True,
    budget: float | None = None,
    work: Callable[[float | None], Work] = Work,
) -> Drives:
    """Find the best drives of each kind for a linkage over its motion, and springs that carry its load.

    Parameters
    ----------
    linkage : Linkage, Solution or mapping, optional
        Any kind of linkage, driven by a crank, slider, cylinder or hinge: a solution of a reply, as it came or changed. Or None
        with ``rocker``.
    drives : sequence of mapping
        Kinds of drives to search, each with its ``kind``, "rotary", "actuator" (or "cylinder") or "dyad", and its
        settings by name, see docs/drives.md. Default: rotary, actuator and dyad.
    load : mapping, optional
        ``force`` [fx, fy] at the body point and ``torque`` on the body, in directions that do not turn with it; ``forces``
        on any links: [{"link", "point": [x, y], "force": [fx, fy]}]; ``masses``:
        [{"link", "mass", "centre": [x, y], "inertia"}], with ``centre`` in the frame of the link (default: the middle of the
        link, or the body point); ``gravity`` [gx, gy] (default [0, -9.81]); ``speed`` of the crank, which is constant, so that
        masses resist their acceleration. Without a load the drive with the largest minimum moment arm is best.
    springs : sequence of mapping
        Springs that balance the load, each with its ``kind``, "tension", "compression", "gas" or "torsion", and its settings by
        name, see docs/drives.md: ``between``, two links or the ground (default: the best of all pairs); ``holds``,
        {"open": True, "closed": True}; ``hand_force_max``; ``target``, a torque or force at even steps; ``count`` of equal
        springs side by side.
    motion : Motion, optional
        Motion that the linkage makes; it defines the used interval. Default: the motion of the linkage.
    crank_angle : array_like, shape (n,), optional
        Crank angles, or travel of the driver, measured from the start, in place of a motion: the first and the last are the ends
        of the used interval.
    rocker : mapping, optional
        Link on a hinge, in place of a linkage: ``pivot`` [x, y], ``start`` and ``swing`` (angles), ``length``.
    hand_point : array_like, shape (2,), optional
        Point of the body, at the first position, at which the hand force with springs is computed.
    length_unit : {"um", "mm", "cm", "m", "in", "ft"}, optional
        Unit of all lengths, for the bundled catalogues; forces are then in newtons. Default: the unit of the motion, or
        millimetres.
    top : int
        Number of drives of each kind to return.
    degrees : bool
        Unit of angles if the linkage does not define it.
    budget : float, optional
        Time limit in seconds; the best drives found by then are returned.
    work : callable
        Makes the object that watches time and cancellation from a budget in seconds.

    Returns
    -------
    Drives
        Drives and springs, best first, with reasons for missing ones.

    Raises
    ------
    FieldError
        If an argument is wrong; the error names it.

    Examples
    --------
    >>> import linkage_atlas as la
    >>> flap = {"pivot": [0, 0], "start": 0, "swing": 60, "length": 400}
    >>> drives = [{"kind": "actuator", "retracted": 255, "stroke": 150, "ground_box": [-300, -400, 300, 0], "reach_max": 300}]
    >>> found = la.drives(rocker=flap, drives=drives, load={"force": [0, -100]})
    >>> round(found.best("actuator").peak_force, 1)
    238.6
    """
    check_top(top)
    check_above_zero(budget=budget)
    watch = work(budget)
    if length_unit is None:
        length_unit = next((unit for source in (motion, linkage) if (unit := _unit_of(source))), "mm")
    if rocker is not None:
        if any(source is not None for source in (linkage, motion, crank_angle)):
            raise FieldError(
                "/rocker", "replaces a linkage and its motion; give either `rocker`, or `linkage` with its motion"
            )
        operation = Operation.of_rocker(rocker, radians_in(degrees))
    else:
        operation = Operation.of_given(linkage, motion, crank_angle, degrees)
    own = sequence((load or {}).get("masses"))
    if load is not None and load.get("parts"):
        load = {**load, "parts": False, "masses": [*own, *operation.masses_of_parts(length_unit)]}
    reader = Reader(operation.machine, operation.radian, millimetres_in(length_unit))
    question = reader.question(load, drives, springs, hand_point)
    found = _answer(operation, question, top, watch)
    if not question.load.speed and any(isinstance(mass, Mapping) and mass.get("inertia") for mass in own):
        found.notes.append("load.masses: inertia has an effect only at a speed; set load.speed")
    return found


def _unit_of(value: object) -> str | None:
    """Return the unit of lengths of a motion, a linkage or a solution; None if it is unknown."""
    unit: str | None = getattr(getattr(value, "linkage", value), "length_unit", None)
    return unit


def _answer(operation: Operation, question: DriveQuestion, max_results: int, work: Work) -> Drives:
    """Search for the drives and springs of a question."""
    task = DriveTask(operation, question, max_results, work)
    task.note_missing_load(question.drives)
    with np.errstate(all="ignore"):
        for request in question.drives:
            _find(task, request)
        for set_number, spring in enumerate(question.springs, 1):
            if work.expired():
                break
            find_springs(task, spring, set_number)
    ranked = [drive for _, drive in sorted(task.ranked, key=lambda row: row[0])]
    best = [
        drive for kind in REPLY_ORDER for drive in [drive for drive in ranked if drive.kind == kind][:max_results]
    ]
    if work.expired():
        task.notes.append("the time was up before every position was examined")
    return Drives(best, task.refused, task.springs, task.torque_curve, task.notes, operation.machine)


def _find(task: DriveTask, request: DriveRequest) -> None:
    """Search for a drive on each requested link; rotary drives take no time worth mentioning."""
    for name in request.links:
        match request:
            case RotaryRequest():
                find_rotary(task, request, name)
            case _ if task.work.expired():
                return
            case ActuatorRequest():
                if name != request.base_link:
                    find_actuator(task, request, name)
            case _:
                find_motor(task, request, name)


# -- drives of the solutions of a search ------------------------------------------------------------------------------


def check_request(request: Fields, radian: float) -> None:
    """Raise FieldError for a request that no linkage can answer, before a linkage is known; see `driven_solution`."""
    interval = Interval(0.0, 0.2)
    circle, slot = Circle(0j, 1.0, 0j), Slot(3.0 + 0.5j, 1.0 + 0.2j, 0.1)
    rail = Rail(2.0 + 0.3j, 0.0, 2.0 + 0j)
    machines = [motions_of(four_bar((2.0, 3.0, 4.0, 3.5), 1, 1.0, coupler_point_polar=(1.0, 0.0)), interval, 3)]
    machines += [motions_of(Linkage((circle, guide), Driver.CRANK, 1, 0.5), interval, 3) for guide in (slot, rail)]
    errors = []
    for machine in machines:
        try:
            _read(Reader(machine, radian, is_example=True), request)
            return
        except FieldError as error:
            errors.append(error)
    raise errors[0]


def _read(reader: Reader, request: Fields) -> tuple[DriveQuestion, DriveRequest | None]:
    """Check the fields of a search, and the drive that decides which solutions come first."""
    question = reader.question(request.get("load"), request.get("drives"), request.get("springs"))
    deciding = request.get("drive")
    return question, None if deciding is None else reader.drive("drive", deciding)


def driven_solution(
    linkage: Linkage, travel: Floats, request: Fields, radian: float, work: Work
) -> dict[str, object]:
    """Return the fields of a solution that `load`, `drives`, `springs` and `drive` request: the best of each kind.

    ``travel`` (n,): of its drive at the samples, radians or lengths. ``given``: in the user's units.
    """
    try:
        operation = Operation.of(linkage, travel, radian)
        question, deciding = _read(Reader(operation.machine, radian), request)
    except FieldError as error:
        refused = [Refusal("any", "linkage", None, error.message)]
        has_drive = False if "drive" in request else None
        return {"drives": [], "refused": refused, "springs": [], "has_drive": has_drive}
    found = _answer(operation, question, 1, work)
    answer: dict[str, object] = {"drives": found.drives, "refused": found.refused, "springs": found.springs}
    if deciding is None:
        return answer
    first = _answer(operation, question._replace(drives=(deciding,), springs=()), 1, work)
    more = {"drives": [*first.drives, *found.drives], "refused": [*first.refused, *found.refused]}
    return answer | more | {"has_drive": bool(first.drives)}
