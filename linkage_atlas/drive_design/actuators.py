"""Actuators and cylinders: placements with the smallest peak force, of given or free sizes or from a catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, TypedDict

import numpy as np

from linkage_atlas.drive_design.operation import Operation
from linkage_atlas.drive_design.question import ActuatorRequest
from linkage_atlas.drive_design.records import ActuatorCurve, ActuatorDrive, Buckling
from linkage_atlas.drive_design.task import DriveTask, both_ends, envelope
from linkage_atlas.records import plane, xy
from synthesis.arrays import Complexes, Floats
from synthesis.drives.catalogue import CatalogueRow, UnfitRow, choose_rows
from synthesis.drives.links import LinkMotions, largest
from synthesis.drives.placement_search import COARSE_GRID, GRID, PlacementSearch
from synthesis.drives.placements import Actuator, Placement, PlacementLimits, Refusal, Sizes
from synthesis.studies.forces import Pull

STEEL = 210_000.0
"""Elastic modulus of a rod that buckles, in newtons per square millimetre."""
ARM_SHARE = 0.1
"""Default of the smallest moment arm, as a fraction of the largest that the stroke allows."""
USUAL_RATIO, LONG_RATIO = 1.4, 2.0
"""Retracted lengths over stroke that are tried if neither is given."""
FORCE_TOLERANCE = 1.05
"""Largest ratio of peak forces at which a shorter actuator replaces the best one."""
LENGTH_TOLERANCE = 1e-9
"""Fraction of its length by which the ends of an actuator may lie beyond its stroke."""
STROKE_TOLERANCE = 1e-6
"""Fraction by which a stroke may be longer than the part of it that is used, for its ends to be the stops."""
STROKE_SHARES = (1.0, 0.85, 0.7, 0.55)
"""Fractions of the best stroke that are tried for an actuator of usual length."""


class EndFields(TypedDict):
    """Fields of a drive between two ends; see `ActuatorDrive`."""

    link: str
    swing: float
    ground_point: tuple[float, float]
    pin: tuple[float, float]
    pin_on_link: tuple[float, float]
    length: tuple[float, float]
    extends: bool
    arm_min: float
    peak_force: float | None
    holding: tuple[float, float] | None


class Loads(NamedTuple):
    """Extreme values of a placement over the whole motion, also between the positions of the search."""

    arm_min: float
    push: float
    pull: float

    @property
    def peak(self) -> float:
        """Largest absolute force."""
        return max(self.push, self.pull)


class Mounted:
    """A placement between two links, evaluated anywhere in the motion."""

    def __init__(self, task: DriveTask, on: str, link: str, placement: Placement, count: int = 1) -> None:
        self.task, self.on, self.link, self.placement, self.count = task, on, link, placement, count

    def along(self, at: Floats) -> tuple[Floats, Floats, Floats]:
        """Return length, moment arm and the force of each actuator at travels of the drive."""
        # the frame of a link that carries the other end lies as the plane does at the first position
        machine = self.task.operation.poses(np.append(self.task.machine.at[0], at))
        found = self.placement
        length, arm = machine.seen(self.link, self.on).leverage(found.ground, found.pin)
        return length[1:], arm[1:], (machine.torque(self.task.question.load) / arm)[1:] / self.count

    def maximum(self, of: Callable[[Floats, Floats, Floats], Floats]) -> float:
        """Return the maximum over the motion of a function of length, arm and force."""
        return largest(lambda at: of(*self.along(at)), self.task.machine.at)

    def loads(self) -> Loads:
        """Return the smallest arm and the largest forces."""
        return Loads(
            -self.maximum(lambda length, arm, force: -np.abs(arm)),
            self.maximum(lambda length, arm, force: force),
            self.maximum(lambda length, arm, force: -force),
        )

    def ends(self, machine: LinkMotions) -> tuple[Complexes, Complexes]:
        """Return the positions of both ends, (n,) each."""
        found = self.placement
        return machine.end(self.on, machine.point_on(self.on, found.ground)), machine.end(self.link, found.pin)

    def fields(self, loads: Loads) -> EndFields:
        """Return the fields that the records of all drives between two ends share."""
        task, placement = self.task, self.placement
        _, pin = self.ends(task.machine)
        return {
            "link": self.link,
            "swing": task.swing(self.link),
            "ground_point": xy(placement.ground),
            "pin": xy(pin[0]),
            "pin_on_link": xy(placement.pin),
            "length": both_ends(placement.length),
            "extends": placement.extends,
            "arm_min": loads.arm_min,
            "peak_force": task.if_loaded(loads.peak),
            "holding": task.if_loaded(both_ends(placement.force)),
        }

    def pulls(self) -> list[Pull]:
        """Return the forces of all actuators on both links at the fine positions."""
        fine = self.task.fine
        ground, pin = self.ends(fine)
        length, _, force = self.along(fine.at)
        push = self.count * force * (pin - ground) / length
        return [Pull(self.link, pin, push), Pull(self.on, ground, -push)]

    def buckling(self, rod: float) -> Buckling:
        """Compare the compression with Euler's load of the whole length as a steel rod."""
        euler = np.pi**2 * STEEL * self.task.question.millimetres**2 * np.pi / 64 * rod**4
        worst = self.maximum(lambda length, arm, force: force * length**2)
        if worst <= 0:
            return Buckling(euler / float(self.placement.length.max()) ** 2, None)
        longest = self.maximum(lambda length, arm, force: np.where(force > 0, length, 0.0))
        return Buckling(euler / longest**2, euler / worst)

    def turns_back(self, kind: str) -> bool:
        """Check for a dead point between the positions of the search and refuse the placement if there is one."""
        task, found = self.task, self.placement
        _, arm = task.fine.seen(self.link, self.on).leverage(found.ground, found.pin)
        bad = arm * found.arm[0] <= 0
        if bad.any():
            at = task.operation.words(task.fine.at[int(np.argmax(bad))])
            reason = f"dead point at {at} of the best placement, between the positions of the search"
            task.findings.refuse(kind, self.link, reason)
        return bool(bad.any())


def find_actuators(task: DriveTask, request: ActuatorRequest) -> None:
    """Place an actuator on each requested link."""
    for name in request.links:
        if name == request.base_link:
            continue
        if task.work.expired():
            return
        if request.ground_point is not None:
            _of_given_ends(task, request, name, request.ground_point)
        elif request.rows:
            _from_catalogue(task, request, name)
        else:
            _of_sizes(task, request, name)


def _question(task: DriveTask, request: ActuatorRequest, name: str, grid: int) -> PlacementSearch:
    link, reach, arm_min = (
        task.machine.seen(name, request.base_link),
        task.reach(request.reach_max, name),
        request.arm_min,
    )
    if arm_min is None:
        stroke = min((row.actuator.stroke for row in request.rows), default=request.stroke)
        arm_min = ARM_SHARE * (stroke or link.largest_shift(reach)) / task.machine.span
    limits = PlacementLimits(request.ground_box or task.box, reach, arm_min, request.extends, request.pin_box)
    torque, amount = task.torque / request.count, task.torque_curve.amount / request.count
    return PlacementSearch(link, task.machine.at, torque, limits, grid, amount)


def _of_given_ends(task: DriveTask, request: ActuatorRequest, name: str, ground: complex) -> None:
    """Evaluate an actuator whose two ends are given, of given sizes or from a catalogue."""
    pin = task.given_pin(name, request.pin, request.pin_on_link)
    question = _question(task, request, name, 2)
    placement = question.evaluate(ground, pin)
    lengths, arms = task.fine.seen(name, request.base_link).leverage(ground, pin)
    is_dead = ~(arms * arms[0] > 0)
    if is_dead.any():
        k = int(np.argmax(is_dead))
        at = task.operation.words(task.fine.at[k])
        task.findings.refuse("actuator", name, f"its length reverses at a dead point at {at}, at {lengths[k]:.6g}")
        return
    low, high = sorted(both_ends(placement.length))
    used = Actuator(low, high - low)
    if request.rows:
        _rows_of_given_ends(task, request, name, question, placement, used)
        return
    retracted = low if request.retracted is None else request.retracted
    stroke = high - retracted if request.stroke is None else request.stroke
    if not _covers(Actuator(retracted, stroke), used):
        reach = f"the actuator reaches only {retracted:.6g} to {retracted + stroke:.6g}"
        words = f"its length ranges from {low:.6g} to {high:.6g}, but {reach}"
        task.findings.refuse("actuator", name, words)
        return
    _add(task, request, name, question, placement, Actuator(retracted, stroke), None, 0)


def _covers(sizes: Actuator, used: Actuator) -> bool:
    """Check that an actuator has all lengths that are used, up to rounding."""
    hair = LENGTH_TOLERANCE * (used.retracted + used.stroke)
    shorter = sizes.retracted <= used.retracted + hair
    return shorter and sizes.retracted + sizes.stroke >= used.retracted + used.stroke - hair


def _rows_of_given_ends(
    task: DriveTask,
    request: ActuatorRequest,
    name: str,
    question: PlacementSearch,
    placement: Placement,
    used: Actuator,
) -> None:
    """Add the rows of a catalogue whose lengths and forces suffice for given ends, the cheapest first."""
    fitting = [row for row in request.rows if _covers(row.actuator, used)]
    strong = [row for row in fitting if not task.loaded or row.can_carry(placement)]
    strong.sort(key=lambda row: (math.inf if row.price is None else row.price, max(row.push, row.pull)))
    for index, row in enumerate(strong[: task.max_results]):
        _add(task, request, name, question, placement, row.actuator, row, index)
    if not strong:
        words = f"lengths from {used.retracted:.6g} to {used.retracted + used.stroke:.6g}"
        if fitting:
            words += f" and a force of {placement.peak:.4g}"
        task.findings.refuse("actuator", name, f"no row of the catalogue has {words}")


def _from_catalogue(task: DriveTask, request: ActuatorRequest, name: str) -> None:
    question = _question(task, request, name, COARSE_GRID)
    bought, unfit = choose_rows(question, request.rows, task.max_results, task.work)
    for index, choice in enumerate(bought):
        _add(task, request, name, question, choice.placement, choice.row.actuator, choice.row, index)
    if not bought:
        _none_fits(task, name, question, unfit)
    elif unfit:
        task.findings.notes.append(f"actuator on the {name}: {_count_unfit(unfit)}")


def _of_sizes(task: DriveTask, request: ActuatorRequest, name: str) -> None:
    fine, question = (_question(task, request, name, grid) for grid in (GRID, COARSE_GRID))
    retracted, stroke, dead_length = request.retracted, request.stroke, request.dead_length or 0.0
    sizes = Actuator(retracted or question.size, stroke or question.size)
    if retracted and stroke:
        found = fine.best(sizes, task.work)
    else:
        found = question.best_of_sizes(Sizes(sizes, retracted is None, stroke is None, dead_length), task.work)
        if retracted is None and isinstance(found, Placement):
            found = _of_usual_length(task, fine, found, dead_length, stroke is None)
    if isinstance(found, Refusal):
        task.findings.refuse("actuator", name, reason_of(task.operation, found, question, sizes, stroke is None))
    else:
        low, high = float(found.length[[0, -1]].min()), float(found.length[[0, -1]].max())
        _add(task, request, name, question, found, Actuator(low, high - low), None, 0)


def _of_usual_length(
    task: DriveTask, question: PlacementSearch, best: Placement, dead_length: float, is_stroke_free: bool
) -> Placement:
    """Replace the best actuator of any length by one of usual length if this costs little force."""
    low, high = np.sort(best.length[[0, -1]]).tolist()
    full_stroke = high - low
    can_be_had = dead_length > 0 or low >= USUAL_RATIO * full_stroke * (1 - 1e-9)
    for share in STROKE_SHARES if is_stroke_free and not can_be_had else (1.0,):
        stroke = share * full_stroke
        for length in [stroke + dead_length] if dead_length else [USUAL_RATIO * stroke, LONG_RATIO * stroke]:
            if task.work.expired() or (can_be_had and length >= low):
                return best
            found = question.best(Actuator(length, stroke), task.work)
            if isinstance(found, Placement) and (not can_be_had or found.worst <= FORCE_TOLERANCE * best.worst):
                return found
    return best


def _add(
    task: DriveTask,
    request: ActuatorRequest,
    name: str,
    question: PlacementSearch,
    placement: Placement,
    sizes: Actuator,
    row: CatalogueRow | None,
    index: int,
) -> None:
    mounted = Mounted(task, request.base_link, name, placement, request.count)
    if mounted.turns_back("actuator"):
        return
    rod = request.rod if row is None else request.rods.get(row.name, request.rod)
    loads = mounted.loads()
    if row is not None and task.loaded and (loads.push > row.push or loads.pull > row.pull):
        reason = f"needs a force of {loads.peak:.4g} between the positions of the search"
        task.findings.refuse("actuator", name, reason, row.name)
        return
    ground, pin = mounted.ends(task.machine)
    used = abs(float(placement.length[-1] - placement.length[0]))
    bound = task.if_loaded(question.force_bound(used))
    is_whole = sizes.stroke <= used * (1 + STROKE_TOLERANCE)
    rank: tuple[float, ...] = (placement.worst,)
    if row is not None:
        rank = (math.inf if row.price is None else row.price, max(row.push, row.pull), placement.worst)
    drive = ActuatorDrive(
        **mounted.fields(loads),
        base_link=request.base_link,
        count=request.count,
        stops="none, because the ends of its stroke are the ends of the motion"
        if is_whole
        else "two stops, or position control, because its stroke is longer than the motion",
        holds="yes with a spindle, or with a cylinder whose valves are closed",
        name=None if row is None else row.name,
        price=None if row is None else row.price,
        retracted=sizes.retracted,
        stroke=sizes.stroke,
        peak_force_bound=bound,
        peak_force_ratio=None if bound is None else loads.peak / bound,
        buckling=None if rod is None or not task.loaded else mounted.buckling(rod),
        envelope=envelope(ground, pin),
        pin_forces=task.pin_peaks(task.fine, mounted.pulls()),
        curve=ActuatorCurve(
            task.operation.curve_at,
            placement.length,
            placement.arm,
            task.if_loaded(placement.force),
            plane(ground),
            plane(pin),
        ),
    )
    task.findings.ranked.append(((*rank, float(index)), drive))


# -- why there is none ------------------------------------------------------------------------------------------------


def reason_of(
    operation: Operation, refused: Refusal, question: PlacementSearch, sizes: Actuator, is_stroke_free: bool
) -> str:
    """Explain why an actuator finds no placement, with the number that binds."""
    limits, stroke = question.limits, sizes.stroke
    subject = "an actuator of free stroke" if is_stroke_free else f"stroke {stroke:.6g}"
    match refused.reason:
        case "reach":
            about = "the pivot" if question.link.pivot is not None else "the link's origin"
            return f"{subject} needs a pin at {refused.needed:.4g} from {about}; reach_max is {limits.reach:.6g}"
        case "pin_box":
            return f"{subject}: pins of pin_box need a ground point outside of ground_box, by at least {refused.needed:.4g}"
        case "dead":
            low, high = refused.between or (0, 1)
            where = operation.poses_around(*question.at[[low, high]])
            at = operation.words(refused.needed)
            return f"{subject}: even the best position has a dead point {where}at {at}"
        case "arm":
            return f"{subject}: the largest minimum moment arm is {refused.needed:.4g}; arm_min is {limits.arm:.4g}"
    if refused.needed > 0 and not is_stroke_free:
        longest = max(stroke - refused.needed, 0.0)
        return f"{subject} is longer than the travel of any pin of the link from a point of ground_box, at most {longest:.4g}"
    return f"{subject} from {sizes.retracted:.6g} fits no point of ground_box: no pin has this distance at both ends"


def _none_fits(task: DriveTask, name: str, question: PlacementSearch, unfit: list[UnfitRow]) -> None:
    """Refuse the row that comes nearest, and count the others."""
    findings = task.findings
    weak = [(why, max(row.push, row.pull), row.name) for row, why in unfit if isinstance(why, float)]
    if weak:
        force, available, row_name = min(weak, key=lambda refusal: refusal[0] / refusal[1])
        findings.refuse(
            "actuator", name, f"needs a force of {force:.4g}, but this actuator gives only {available:.4g}", row_name
        )
    placeless = [(row, why) for row, why in unfit if isinstance(why, Refusal)]
    if placeless:
        row, why = min(placeless, key=lambda refusal: refusal[0].actuator.stroke)
        findings.refuse("actuator", name, reason_of(task.operation, why, question, row.actuator, False), row.name)
    if len(unfit) > 2:
        findings.notes.append(f"actuator on the {name}: {_count_unfit(unfit)}")


def _count_unfit(unfit: list[UnfitRow]) -> str:
    weak = sum(isinstance(row.why, float) for row in unfit)
    return f"{weak} rows of the catalogue are too weak and {len(unfit) - weak} do not fit"
