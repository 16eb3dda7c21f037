"""Actuators and cylinders: placements with the smallest peak force, of given or free sizes or from a catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

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


def find_actuator(task: DriveTask, request: ActuatorRequest, name: str) -> None:
    """Place an actuator on a link."""
    search = ActuatorSearch(task, request, name)
    if request.ground_point is not None:
        search.evaluate_ends(request.ground_point)
    elif request.rows:
        search.choose_rows()
    else:
        search.find_sizes()


@dataclass(frozen=True)
class ActuatorSearch:
    """Search for an actuator on one link; it adds drives and refusals to the task."""

    task: DriveTask
    request: ActuatorRequest
    name: str
    """Link that carries the pin."""

    def evaluate_ends(self, ground: complex) -> None:
        """Evaluate an actuator whose two ends are given, of given sizes or from a catalogue."""
        task, request = self.task, self.request
        pin = task.given_pin(self.name, request.pin, request.pin_on_link)
        question = self._question(2)
        placement = question.evaluate(ground, pin)
        lengths, arms = task.fine.seen(self.name, request.base_link).leverage(ground, pin)
        is_dead = ~(arms * arms[0] > 0)
        if is_dead.any():
            k = int(np.argmax(is_dead))
            at = task.operation.words(task.fine.at[k])
            self._refuse(f"its length reverses at a dead point at {at}, at {lengths[k]:.6g}")
            return
        used = _used(placement)
        low, high = used.retracted, sum(used)
        if request.rows:
            self._choose_rows_of_ends(question, placement, used)
            return
        retracted = low if request.retracted is None else request.retracted
        sizes = Actuator(retracted, high - retracted if request.stroke is None else request.stroke)
        if _covers(sizes, used):
            self._add(question, placement, sizes)
        else:
            reach = f"the actuator reaches only {retracted:.6g} to {sum(sizes):.6g}"
            self._refuse(f"its length ranges from {low:.6g} to {high:.6g}, but {reach}")

    def choose_rows(self) -> None:
        """Place the cheapest rows of a catalogue that are strong enough."""
        question = self._question(COARSE_GRID)
        bought, unfit = choose_rows(question, self.request.rows, self.task.max_results, self.task.work)
        for index, choice in enumerate(bought):
            self._add(question, choice.placement, choice.row.actuator, choice.row, index)
        if not bought:
            self._refuse_rows(question, unfit)
        if len(unfit) > (0 if bought else 2):
            weak = sum(isinstance(row.why, float) for row in unfit)
            words = f"{weak} rows of the catalogue are too weak and {len(unfit) - weak} do not fit"
            self.task.notes.append(f"actuator on the {self.name}: {words}")

    def find_sizes(self) -> None:
        """Place an actuator of given or free sizes."""
        request, work = self.request, self.task.work
        fine, question = (self._question(grid) for grid in (GRID, COARSE_GRID))
        retracted, stroke, dead_length = request.retracted, request.stroke, request.dead_length or 0.0
        sizes = Actuator(retracted or question.size, stroke or question.size)
        if retracted and stroke:
            found = fine.best(sizes, work)
        else:
            found = question.best_of_sizes(Sizes(sizes, retracted is None, stroke is None, dead_length), work)
            if retracted is None and isinstance(found, Placement):
                found = self._of_usual_length(fine, found, dead_length)
        if isinstance(found, Refusal):
            self._refuse(self._reason(found, question, sizes, stroke is None))
        else:
            self._add(question, found, _used(found))

    def _question(self, grid: int) -> PlacementSearch:
        task, request = self.task, self.request
        link, reach = task.machine.seen(self.name, request.base_link), task.reach(request.reach_max, self.name)
        arm_min = request.arm_min
        if arm_min is None:
            stroke = min((row.actuator.stroke for row in request.rows), default=request.stroke)
            arm_min = ARM_SHARE * (stroke or link.largest_shift(reach)) / task.machine.span
        limits = PlacementLimits(request.ground_box or task.box, reach, arm_min, request.extends, request.pin_box)
        torque, amount = task.torque / request.count, task.torque_curve.amount / request.count
        return PlacementSearch(link, task.machine.at, torque, limits, grid, amount)

    def _choose_rows_of_ends(self, question: PlacementSearch, placement: Placement, used: Actuator) -> None:
        """Add the rows of a catalogue whose lengths and forces suffice for given ends, the cheapest first."""
        loaded, max_results = self.task.loaded, self.task.max_results
        fitting = [row for row in self.request.rows if _covers(row.actuator, used)]
        strong = [row for row in fitting if not loaded or row.can_carry(placement)]
        for index, row in enumerate(sorted(strong, key=_cost)[:max_results]):
            self._add(question, placement, row.actuator, row, index)
        if not strong:
            force = f" and a force of {placement.peak:.4g}" if fitting else ""
            lengths = f"lengths from {used.retracted:.6g} to {sum(used):.6g}"
            self._refuse(f"no row of the catalogue has {lengths}{force}")

    def _of_usual_length(self, question: PlacementSearch, best: Placement, dead_length: float) -> Placement:
        """Replace the best actuator of any length by one of usual length if this costs little force."""
        low, full_stroke = _used(best)
        can_be_had = dead_length > 0 or low >= USUAL_RATIO * full_stroke * (1 - 1e-9)
        for share in STROKE_SHARES if self.request.stroke is None and not can_be_had else (1.0,):
            stroke = share * full_stroke
            for length in [stroke + dead_length] if dead_length else [USUAL_RATIO * stroke, LONG_RATIO * stroke]:
                if self.task.work.expired() or (can_be_had and length >= low):
                    return best
                found = question.best(Actuator(length, stroke), self.task.work)
                if isinstance(found, Placement) and (not can_be_had or found.worst <= FORCE_TOLERANCE * best.worst):
                    return found
        return best

    # -- records of drives --------------------------------------------------------------------------------------------

    def _add(
        self,
        question: PlacementSearch,
        placement: Placement,
        sizes: Actuator,
        row: CatalogueRow | None = None,
        index: int = 0,
    ) -> None:
        task, request = self.task, self.request
        _, arm = task.fine.seen(self.name, request.base_link).leverage(placement.ground, placement.pin)
        is_dead = arm * placement.arm[0] <= 0
        if is_dead.any():
            at = task.operation.words(task.fine.at[int(np.argmax(is_dead))])
            self._refuse(f"dead point at {at} of the best placement, between the positions of the search")
            return
        arm_min = -self._maximum(placement, lambda length, arm, force: -np.abs(arm))
        push = self._maximum(placement, lambda length, arm, force: force)
        pull = self._maximum(placement, lambda length, arm, force: -force)
        peak = max(push, pull)
        if row is not None and task.loaded and (push > row.push or pull > row.pull):
            self._refuse(f"needs a force of {peak:.4g} between the positions of the search", row.name)
            return
        rod = request.rod if row is None or row.rod is None else row.rod
        ground, pin = self._ends(placement, task.machine)
        used = _used(placement).stroke
        bound = task.if_loaded(question.force_bound(used))
        drive = ActuatorDrive(
            link=self.name,
            swing=task.swing(self.name),
            ground_point=xy(placement.ground),
            pin=xy(pin[0]),
            pin_on_link=xy(placement.pin),
            length=both_ends(placement.length),
            extends=placement.extends,
            arm_min=arm_min,
            peak_force=task.if_loaded(peak),
            holding=task.if_loaded(both_ends(placement.force)),
            base_link=request.base_link,
            count=request.count,
            stops="none, because the ends of its stroke are the ends of the motion"
            if sizes.stroke <= used * (1 + STROKE_TOLERANCE)
            else "two stops, or position control, because its stroke is longer than the motion",
            holds="yes with a spindle, or with a cylinder whose valves are closed",
            name=None if row is None else row.name,
            price=None if row is None else row.price,
            retracted=sizes.retracted,
            stroke=sizes.stroke,
            peak_force_bound=bound,
            peak_force_ratio=None if bound is None else peak / bound,
            buckling=None if rod is None or not task.loaded else self._buckling(placement, rod),
            envelope=envelope(ground, pin),
            pin_forces=task.pin_peaks(task.fine, self._pulls(placement)),
            curve=ActuatorCurve(
                crank_angle=task.operation.curve_at,
                length=placement.length,
                arm=placement.arm,
                force=task.if_loaded(placement.force),
                ground=plane(ground),
                pin=plane(pin),
            ),
        )
        rank = (placement.worst,) if row is None else (*_cost(row), placement.worst)
        task.ranked.append(((*rank, float(index)), drive))

    def _along(self, placement: Placement, at: Floats) -> tuple[Floats, Floats, Floats]:
        """Return length, moment arm and the force of each actuator at travels of the drive."""
        task, request = self.task, self.request
        # the frame of a link that carries the other end lies as the plane does at the first position
        machine = task.operation.poses(np.append(task.machine.at[0], at))
        length, arm = machine.seen(self.name, request.base_link).leverage(placement.ground, placement.pin)
        return length[1:], arm[1:], (machine.torque(task.question.load) / arm)[1:] / request.count

    def _maximum(self, placement: Placement, of: Callable[[Floats, Floats, Floats], Floats]) -> float:
        """Return the maximum over the whole motion of a function of length, arm and force."""
        return largest(lambda at: of(*self._along(placement, at)), self.task.machine.at)

    def _ends(self, placement: Placement, machine: LinkMotions) -> tuple[Complexes, Complexes]:
        on = self.request.base_link
        return machine.end(on, machine.point_on(on, placement.ground)), machine.end(self.name, placement.pin)

    def _pulls(self, placement: Placement) -> list[Pull]:
        """Return the forces of all actuators on both links at the fine positions."""
        ground, pin = self._ends(placement, self.task.fine)
        length, _, force = self._along(placement, self.task.fine.at)
        push = self.request.count * force * (pin - ground) / length
        return [Pull(self.name, pin, push), Pull(self.request.base_link, ground, -push)]

    def _buckling(self, placement: Placement, rod: float) -> Buckling:
        """Compare the compression with Euler's load of the whole length as a steel rod."""
        euler = np.pi**2 * STEEL * self.task.question.millimetres**2 * np.pi / 64 * rod**4
        worst = self._maximum(placement, lambda length, arm, force: force * length**2)
        if worst <= 0:
            return Buckling(euler / float(placement.length.max()) ** 2, None)
        longest = self._maximum(placement, lambda length, arm, force: np.where(force > 0, length, 0.0))
        return Buckling(euler / longest**2, euler / worst)

    # -- why there is none --------------------------------------------------------------------------------------------

    def _refuse(self, reason: str, row_name: str | None = None) -> None:
        self.task.refuse("actuator", self.name, reason, row_name)

    def _refuse_rows(self, question: PlacementSearch, unfit: list[UnfitRow]) -> None:
        """Refuse the rows that come nearest."""
        weak = [(why, max(row.push, row.pull), row.name) for row, why in unfit if isinstance(why, float)]
        if weak:
            force, available, row_name = min(weak, key=lambda refusal: refusal[0] / refusal[1])
            self._refuse(f"needs a force of {force:.4g}, but this actuator gives only {available:.4g}", row_name)
        placeless = [(row, why) for row, why in unfit if isinstance(why, Refusal)]
        if placeless:
            row, why = min(placeless, key=lambda refusal: refusal[0].actuator.stroke)
            self._refuse(self._reason(why, question, row.actuator, False), row.name)

    def _reason(self, refused: Refusal, question: PlacementSearch, sizes: Actuator, is_stroke_free: bool) -> str:
        """Explain why an actuator finds no placement, with the number that binds."""
        limits, stroke, operation = question.limits, sizes.stroke, self.task.operation
        subject = "an actuator of free stroke" if is_stroke_free else f"stroke {stroke:.6g}"
        match refused.reason:
            case "reach":
                about = "the pivot" if question.link.pivot is not None else "the link's origin"
                return f"{subject} needs a pin at {refused.needed:.4g} from {about}; reach_max is {limits.reach:.6g}"
            case "pin_box":
                outside = f"a ground point outside of ground_box, by at least {refused.needed:.4g}"
                return f"{subject}: pins of pin_box need {outside}"
            case "dead":
                low, high = refused.between or (0, 1)
                where = operation.poses_around(*question.at[[low, high]])
                at = operation.words(refused.needed)
                return f"{subject}: even the best position has a dead point {where}at {at}"
            case "arm":
                return (
                    f"{subject}: the largest minimum moment arm is {refused.needed:.4g}; arm_min is {limits.arm:.4g}"
                )
        if refused.needed > 0 and not is_stroke_free:
            most = f"at most {max(stroke - refused.needed, 0.0):.4g}"
            return f"{subject} is longer than the travel of any pin of the link from a point of ground_box, {most}"
        return (
            f"{subject} from {sizes.retracted:.6g} fits no point of ground_box: no pin has this distance at both ends"
        )


def _used(placement: Placement) -> Actuator:
    """Return the actuator whose whole stroke a placement uses."""
    low, high = sorted(both_ends(placement.length))
    return Actuator(low, high - low)


def _covers(sizes: Actuator, used: Actuator) -> bool:
    """Check that an actuator has all lengths that are used, up to rounding."""
    slack = LENGTH_TOLERANCE * sum(used)
    return sizes.retracted <= used.retracted + slack and sum(sizes) >= sum(used) - slack


def _cost(row: CatalogueRow) -> tuple[float, float]:
    """Return the price of a row and its strength, the sort key of a catalogue."""
    return math.inf if row.price is None else row.price, max(row.push, row.pull)
