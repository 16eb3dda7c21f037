"""Springs that carry a load, approximate a wanted torque or hold a linkage: ideal springs, and springs of a catalogue.

A search works with the difference between the torque of the drive and the wanted torque, at even positions of the motion.
Lengths, twists and forces are then checked over the whole motion; a position that violates a limit joins the search.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypedDict

import numpy as np

from linkage_atlas.drive_design.question import SpringRequest
from linkage_atlas.drive_design.records import (
    BeforeAfter,
    Holds,
    PinPeaks,
    Spring,
    SpringCurve,
    TorqueSize,
    TorsionCurve,
    TorsionSpring,
)
from linkage_atlas.drive_design.task import DriveTask, both_ends
from linkage_atlas.records import plane, xy
from synthesis.arrays import Complexes, Floats
from synthesis.drives.balance import one_spring, potential_of, springs_on_pendulums, two_springs
from synthesis.drives.links import GROUND, LinkMotions, largest
from synthesis.drives.spring_search import best_pair, best_spring
from synthesis.drives.springs import Behaviour, MountedSprings, SpringRegion, SpringRow, pairs_of, spring_torque
from synthesis.drives.springs import Spring as LinearSpring
from synthesis.drives.torsion import TorsionSpring as MountedTorsion
from synthesis.drives.torsion import best_torsion_spring, joint_of
from synthesis.studies.forces import Pull

HELP_SHARE = 0.5
"""Largest fraction of the rms torque, or of its difference from a wanted torque, that springs of a catalogue may leave."""
ENOUGH_SHARE = 0.1
"""Fraction of the rms torque up to which a single spring is preferred to two."""
HOLD_MARGIN = 0.02
"""Torque that presses the linkage onto its stop, as a fraction of the peak torque without springs."""
CLEAR_SHARE = 0.05
"""Default distance of the ends from pivots, as a fraction of the linkage's size."""
ROUNDING = 1e-5
"""Fraction of the torques up to which a violation of a limit counts as rounding."""
EXACT = 1e-7
"""Largest torque that ideal springs may leave anywhere in the motion, as a fraction of the peak torque."""
RANGE_ROUNDING = 1e-9
"""Fraction by which a length or a twist may leave its range because of rounding."""
BUCKLING = (
    "buckling of compression springs was not examined, since the catalogue has no coil diameters: guide a spring on a rod or "
    "in a tube if its free length is more than about 2.6 coil diameters"
)
MAX_ROUNDS = 4
"""Largest number of searches until limits hold over the whole motion."""


@dataclass(frozen=True)
class Mounted:
    """Springs in their places: linear springs that work together, or a torsion spring."""

    linear: tuple[LinearSpring, ...] = ()
    rows: tuple[SpringRow, ...] = ()
    """Rows of the catalogue; empty for ideal springs."""
    torsion: MountedTorsion | None = None

    @classmethod
    def of(cls, found: MountedSprings | str) -> Mounted | str:
        """Take over the springs of a search."""
        if isinstance(found, str):
            return found
        return cls(found.springs, tuple(row for row in found.kinds if row is not None))

    def torque(self, machine: LinkMotions) -> Floats:
        """Return the torque that the drive gives because of the springs, (n,)."""
        if self.torsion is not None:
            return self.torsion.torque(machine)
        return sum((spring_torque(machine, spring)[1] for spring in self.linear), np.zeros(machine.at.size))

    def beyond_range(self, machine: LinkMotions) -> Floats:
        """Return by which fraction lengths or twists leave their range, (n,); negative inside."""
        if self.torsion is not None:
            twist, max_angle = self.torsion.twist(machine), self.torsion.row.angle_max
            return np.maximum(-twist, twist - max_angle) / max_angle
        beyond = np.full(machine.at.size, -np.inf)
        for spring, row in zip(self.linear, self.rows):
            length, _ = spring_torque(machine, spring)
            beyond = np.maximum(beyond, np.maximum(row.shortest - length, length - row.longest) / row.longest)
        return beyond

    def pulls(self, machine: LinkMotions) -> list[Pull]:
        """Return forces and couples on the links."""
        found: list[Pull] = []
        if self.torsion is not None:
            couple = self.torsion.direction * self.torsion.moment(self.torsion.twist(machine))
            nowhere = np.zeros(machine.at.size, dtype=complex)
            for name, sign in zip(self.torsion.between, (1.0, -1.0)):
                found.append(Pull(name, nowhere, nowhere, sign * couple))
        for spring in self.linear:
            first, second = (machine.end(*end) for end in zip(spring.between, spring.points))
            length = np.abs(second - first)
            # over a length of 0 a spring of zero free length has no force either
            pull = spring.force(length) / np.maximum(length, 1e-300) * (second - first)
            found += [Pull(spring.between[0], first, pull), Pull(spring.between[1], second, -pull)]
        return [pull for pull in found if pull.link != GROUND]

    @property
    def words(self) -> str:
        """Name the springs and the links that they join."""
        if self.torsion is not None:
            return f"{self.torsion.row.name} between {' and '.join(self.torsion.between)}"
        names = [row.name for row in self.rows] or ["spring"] * len(self.linear)
        return " and ".join(
            f"{name} from {spring.between[0]} to {spring.between[1]}" for name, spring in zip(names, self.linear)
        )


class Goal:
    """Purpose of the springs of an entry: a wanted torque, and limits on the torque of the drive."""

    def __init__(self, task: DriveTask, request: SpringRequest) -> None:
        self.task, self.request = task, request
        self.holds = request.holds if request.holds and (request.holds.closed or request.holds.open) else None
        self.is_limited = self.holds is not None or request.hand_force_max is not None
        self.peak = float(np.abs(task.torque).max())

    def load_torque(self, machine: LinkMotions) -> Floats:
        """Return the torque without springs."""
        return machine.torque(self.task.question.load)

    def target(self, machine: LinkMotions) -> Floats:
        """Return the wanted torque of the drive; zero without a wish."""
        curve = self.request.target
        if curve is None:
            return np.zeros(machine.at.size)
        start, end = self.task.machine.at[[0, -1]]
        values = curve.at((machine.at - start) / (end - start))
        return values if curve.quantity == "torque" else values * self.hand_speed(machine) * machine.sense

    def hand_speed(self, machine: LinkMotions) -> Floats:
        """Return the speed of the hand, by default of the body point, per unit of the drive's coordinate."""
        body, first, hand = machine.body, self.task.machine.body, self.task.question.hand_point
        assert body is not None and first is not None
        return np.abs(body.speed(0j if hand is None else first.point_at(hand)))

    def behaviour(self, machine: LinkMotions) -> Behaviour | None:
        """Return the limits on the torque with springs; None without limits."""
        if not self.is_limited:
            return None
        force_max, margins = self.request.hand_force_max, (HOLD_MARGIN * self.peak,) * 2
        if self.holds is not None and self.holds.force_min is not None:
            first, last = self.holds.force_min * self.hand_speed(machine)[[0, -1]]
            margins = max(margins[0], float(first)), max(margins[1], float(last))
        return Behaviour(
            machine.sense,
            margins,
            self.holds is not None and self.holds.closed,
            self.holds is not None and self.holds.open,
            None if force_max is None else force_max * self.hand_speed(machine),
            self.target(machine),
        )

    def difference(self, machine: LinkMotions, mounted: Mounted | None = None) -> Floats:
        """Return the torque of the drive less the wanted torque, without springs or with them."""
        torque = self.load_torque(machine) - self.target(machine)
        return torque if mounted is None else torque + mounted.torque(machine)

    @cached_property
    def size(self) -> float:
        """Root mean square of the difference without springs."""
        return _rms(self.difference(self.task.machine))

    def violation(self, machine: LinkMotions, mounted: Mounted) -> float:
        """Return the torque by which springs violate the limits; 0 up to rounding."""
        behaviour = self.behaviour(machine)
        if behaviour is None:
            return 0.0
        torque = float(behaviour.violation(self.difference(machine, mounted)))
        return torque if torque > ROUNDING * max(self.peak, *behaviour.margins) else 0.0

    def rank(self, mounted: Mounted) -> tuple[float, float]:
        """Return the violation of limits, then the rms difference from the wanted torque; smaller is better."""
        machine = self.task.machine
        return self.violation(machine, mounted), _rms(self.difference(machine, mounted))

    def suffices(self, mounted: Mounted, share: float) -> bool:
        """Check that springs satisfy the limits, or without limits leave at most a fraction of the difference."""
        violation, left = self.rank(mounted)
        return violation == 0 if self.is_limited else left <= share * self.size

    def violated_at(self, mounted: Mounted) -> list[float]:
        """Return travels of the drive between the positions of a search at which a promise is violated."""
        fine, found = self.task.fine, []
        beyond = mounted.beyond_range(fine)
        if mounted.rows or mounted.torsion is not None:
            if beyond.max() > RANGE_ROUNDING:
                found.append(float(fine.at[int(np.argmax(beyond))]))
        behaviour = self.behaviour(fine)
        if behaviour is not None and behaviour.torque_max is not None and self.violation(fine, mounted) > 0:
            torque = self.difference(fine, mounted) + self.target(fine)
            found.append(float(fine.at[int(np.argmax(np.abs(torque) - behaviour.torque_max))]))
        return found

    def reason(self, mounted: Mounted) -> str:
        """Explain what the best springs lack."""
        machine = self.task.machine
        behaviour = self.behaviour(machine)
        if behaviour is None:
            what = "rms torque" if self.request.target is None else "rms difference from the wanted curve"
            share = 100 * self.rank(mounted)[1] / self.size
            left = f"the best ({mounted.words}) leaves {share:.3g} % of the {what}"
            return f"{left}; only springs that remove at least half of it are returned"
        torque = self.difference(machine, mounted) + self.target(machine)
        wrong, (first, last) = [], torque[[0, -1]] * machine.sense
        if behaviour.holds_first and first < behaviour.margins[0]:
            wrong.append("does not hold the first position (closed)")
        if behaviour.holds_last and -last < behaviour.margins[1]:
            wrong.append("does not hold the last position (open)")
        if behaviour.torque_max is not None and np.any(np.abs(torque) > behaviour.torque_max):
            wrong.append(f"needs a hand force of {np.abs(torque / self.hand_speed(machine)).max():.4g}")
        return f"no spring of the catalogue has this behaviour; the nearest ({mounted.words}) {' and '.join(wrong)}"


def find_springs(task: DriveTask, request: SpringRequest, set_number: int) -> None:
    """Find springs for one entry of a request."""
    links = "any two links" if request.between is None else "-".join(request.between)
    if not task.loaded and not request.has_goal:
        task.findings.refuse(request.kind, links, "there is no load to balance")
        return
    goal = Goal(task, request)
    if request.torsion_rows:
        found = _over_whole_motion(goal, lambda machine: _torsion(goal, machine))
    elif request.rows:
        found = _over_whole_motion(goal, lambda machine: _from_catalogue(goal, machine))
    else:
        found = _ideal(task, request)
    if not isinstance(found, str) and (request.rows or request.torsion_rows) and not goal.suffices(found, HELP_SHARE):
        found = goal.reason(found)
    if isinstance(found, str):
        task.findings.refuse(request.kind, links, found)
    else:
        _add(goal, set_number, found)


def _over_whole_motion(goal: Goal, search: Callable[[LinkMotions], Mounted | str]) -> Mounted | str:
    """Search at more positions until lengths, twists and forces keep their limits over the whole motion."""
    task, machine = goal.task, goal.task.machine
    for _ in range(MAX_ROUNDS):
        found = search(machine)
        if isinstance(found, str) or goal.violation(machine, found) > 0:
            return found
        violated = goal.violated_at(found)
        if not violated:
            return found
        reason = f"the best ({found.words}) leaves its limits between the positions of the search"
        if task.work.expired():
            break
        at = np.unique([*machine.at, *violated])
        machine = task.operation.poses(at if machine.sense > 0 else at[::-1])
    return reason


# -- springs of a catalogue -------------------------------------------------------------------------------------------


def _torsion(goal: Goal, machine: LinkMotions) -> Mounted | str:
    request = goal.request
    rows = [
        row._replace(rate=request.count * row.rate, preload=request.count * row.preload)
        for row in request.torsion_rows
    ]
    found = best_torsion_spring(machine, goal.difference(machine), request.between, rows, goal.behaviour(machine))
    return found if isinstance(found, str) else Mounted(torsion=found)


def _from_catalogue(goal: Goal, machine: LinkMotions) -> Mounted | str:
    """Find a spring, or two on the links with fixed pivots if these are clearly better."""
    task, request, extent = goal.task, goal.request, machine.extent
    room = SpringRegion(
        request.ground_box or task.box,
        float(request.reach_max or extent),
        float(request.pivot_distance_min or CLEAR_SHARE * extent),
    )
    rows = [
        row._replace(stiffness=request.count * row.stiffness, preload=request.count * row.preload)
        for row in request.rows
    ]
    torque, behaviour, between = goal.difference(machine), goal.behaviour(machine), request.between
    pairs = pairs_of(machine) if between is None else [between]
    found = Mounted.of(best_spring(machine, torque, pairs, rows, room, task.work, behaviour))
    pivoted = [(GROUND, name) for name, link in machine.links.items() if link.pivot is not None]
    if between is not None or len(pivoted) < 2 or task.work.expired():
        return found
    if isinstance(found, str) or not goal.suffices(found, ENOUGH_SHARE):
        two = Mounted.of(best_pair(machine, torque, pivoted[:2], rows, room, task.work, behaviour))
        if not isinstance(two, str) and (isinstance(found, str) or goal.rank(two) < goal.rank(found)):
            return two
    return found


# -- ideal springs ----------------------------------------------------------------------------------------------------


def _ideal(task: DriveTask, request: SpringRequest) -> Mounted | str:
    """Find springs of zero free length that balance every position, or return the reason why there are none."""
    between, stiffness = request.between, None if request.stiffness is None else request.count * request.stiffness
    linkage, load = task.operation.linkage, task.question.load
    if load.torque or load.speed:
        return "springs of zero free length cannot carry a torque or inertia; give a catalogue"
    if linkage is None:
        return _ideal_on_pendulums(task, between, stiffness)
    potential = potential_of(linkage, load)
    if between is None:
        return Mounted(tuple(two_springs(potential, stiffness)))
    found = one_spring(potential, between)
    if isinstance(found, LinearSpring):
        if stiffness is not None and abs(stiffness - found.stiffness) > 1e-9 * stiffness and between[0] != GROUND:
            needed = found.stiffness / request.count
            return f"the only spring between {between[0]} and {between[1]} has the stiffness {needed:.6g}"
        if stiffness is not None and between in ((GROUND, "crank"), (GROUND, "rocker")):
            found = next(spring for spring in two_springs(potential, stiffness) if spring.between == between)
        return Mounted((found,))
    if math.isinf(found):
        return f"one spring between {between[0]} and {between[1]} does not balance this load; two springs do; remove `between`"
    return f"one spring would need the stiffness {found:.6g}, below 0; two springs balance it; remove `between`"


def _ideal_on_pendulums(task: DriveTask, between: tuple[str, str] | None, stiffness: float | None) -> Mounted | str:
    """Find springs of zero free length on a body on guides, or on a link on a hinge."""
    guided = task.operation.plain
    springs = springs_on_pendulums(guided, task.machine, task.torque, stiffness)
    if springs is None:
        kind = "link on a hinge" if guided is None else guided.kind.value
        return f"no springs of zero free length on a {kind} balance this load in every position; give a catalogue"
    if not springs:
        return "the drive carries no load that springs could balance"
    if between is not None and (len(springs) > 1 or springs[0].between != between):
        where = " and ".join("-".join(spring.between) for spring in springs)
        return f"one spring between {between[0]} and {between[1]} does not balance this load; {where} do; remove `between`"
    return Mounted(tuple(springs))


class Effect(TypedDict):
    """Fields that the records of all springs of a set share; see `linkage_atlas.drive_design.records`."""

    set: int
    count: int
    torque: BeforeAfter
    deviation: BeforeAfter | None
    pin_forces: PinPeaks | None
    motion_at_ends: str
    holds: Holds
    hand_force_max: float | None


# -- records ----------------------------------------------------------------------------------------------------------


def _add(goal: Goal, set_number: int, mounted: Mounted) -> None:
    task, request, machine = goal.task, goal.request, goal.task.machine
    torque = task.torque + mounted.torque(machine)
    sizes = BeforeAfter(
        _size(goal, goal.load_torque),
        _size(goal, lambda machine: goal.load_torque(machine) + mounted.torque(machine)),
    )
    left = _rms(goal.difference(machine, mounted))
    if left > HELP_SHARE * goal.size > 0:
        what = "rms torque of the drive" if request.target is None else "rms difference from the wanted curve"
        task.findings.notes.append(
            f"springs of set {set_number} show the requested behaviour, but leave {100 * left / goal.size:.3g} % of the {what}"
        )
    uses_hand = (
        request.hand_force_max is not None
        or (goal.holds is not None and goal.holds.force_min is not None)
        or (request.target is not None and request.target.quantity == "hand_force")
    )
    hand = hand_max = None
    if machine.body is not None and (task.question.hand_point is not None or uses_hand):
        hand = torque / goal.hand_speed(machine) * machine.sense
        hand_max = _largest(
            goal,
            lambda machine: np.abs((goal.load_torque(machine) + mounted.torque(machine)) / goal.hand_speed(machine)),
        )
    scale = max(sizes.before.peak, float(np.abs(mounted.torque(machine)).max()))
    holds, motion_at_ends = _at_ends(torque[[0, -1]] * machine.sense, scale)
    deviation = None
    if request.target is not None:
        after = _size(goal, lambda machine: goal.difference(machine, mounted))
        deviation = BeforeAfter(_size(goal, goal.difference), after)
    effect: Effect = {
        "set": set_number,
        "count": request.count,
        "torque": sizes,
        "pin_forces": task.pin_peaks(machine, mounted.pulls(machine)),
        "motion_at_ends": motion_at_ends,
        "holds": holds,
        "hand_force_max": hand_max,
        "deviation": deviation,
    }
    if request.kind == "compression" and BUCKLING not in task.findings.notes:
        task.findings.notes.append(BUCKLING)
    if mounted.torsion is not None:
        task.findings.springs.append(_torsion_record(goal, mounted.torsion, torque, hand, effect))
    names: list[str | None] = [row.name for row in mounted.rows]
    names = names or [None] * len(mounted.linear)
    exact = not mounted.rows and _is_balanced(goal, mounted)
    for spring, name in zip(mounted.linear, names):
        task.findings.springs.append(_linear_record(goal, spring, name, exact, torque, hand, effect))


def _linear_record(
    goal: Goal,
    spring: LinearSpring,
    name: str | None,
    exact: bool,
    torque: Floats,
    hand: Floats | None,
    effect: Effect,
) -> Spring:
    task, machine, count = goal.task, goal.task.machine, goal.request.count
    ends: list[Complexes] = [machine.end(*end) for end in zip(spring.between, spring.points)]
    curve_ends = plane(np.stack(ends, axis=1))
    length, _ = spring_torque(machine, spring)

    shortest = -_largest(goal, lambda machine: -spring_torque(machine, spring)[0])
    longest = _largest(goal, lambda machine: spring_torque(machine, spring)[0])
    kind = goal.request.kind
    assert kind != "torsion"
    return Spring(
        kind=kind,
        name=name,
        between=spring.between,
        points=(both_ends(curve_ends[0, 0]), both_ends(curve_ends[0, 1])),
        points_on_links=(xy(spring.points[0]), xy(spring.points[1])),
        stiffness=spring.stiffness / count,
        free_length=spring.free_length,
        preload=spring.preload / count,
        length=(shortest, longest),
        exact=exact,
        curve=SpringCurve(task.operation.curve_at, length, spring.force(length) / count, torque, hand, curve_ends),
        **effect,
    )


def _torsion_record(
    goal: Goal, spring: MountedTorsion, torque: Floats, hand: Floats | None, effect: Effect
) -> TorsionSpring:
    task, machine, count = goal.task, goal.task.machine, goal.request.count
    radian, twist, joint = task.operation.radian, spring.twist(machine), joint_of(machine, spring.between)
    assert joint is not None
    extremes = spring.twist(task.fine)
    return TorsionSpring(
        name=spring.row.name,
        between=spring.between,
        point=xy(joint),
        rate=spring.row.rate / count * radian,
        preload=spring.row.preload / count,
        direction=1 if spring.direction > 0 else -1,
        twist=(float(extremes.min()) / radian, float(extremes.max()) / radian),
        curve=TorsionCurve(task.operation.curve_at, twist / radian, spring.moment(twist) / count, torque, hand),
        **effect,
    )


def _is_balanced(goal: Goal, mounted: Mounted) -> bool:
    """Check that ideal springs leave nothing at any of the fine positions."""
    fine = goal.task.fine
    left = goal.load_torque(fine) + mounted.torque(fine)
    return bool(np.abs(left).max() <= EXACT * np.abs(goal.load_torque(fine)).max())


def _at_ends(torques: Floats, peak: float) -> tuple[Holds, str]:
    """Return which ends hold, and what the linkage does there by itself; positive torques press onto the first stop."""
    quiet = 1e-9 * max(peak, 1e-300)
    first, last = torques
    words = [
        "stays" if abs(first) <= quiet else "is pressed onto its stop" if first > 0 else "opens by itself",
        "stays" if abs(last) <= quiet else "closes by itself" if last > 0 else "is held open",
    ]
    return Holds(bool(first >= -quiet), bool(last <= quiet)), f"first position: {words[0]}; last: {words[1]}"


def _largest(goal: Goal, of: Callable[[LinkMotions], Floats]) -> float:
    """Return the maximum of a quantity over the whole motion."""
    return largest(lambda at: of(goal.task.operation.poses(at)), goal.task.machine.at)


def _size(goal: Goal, of: Callable[[LinkMotions], Floats]) -> TorqueSize:
    """Return the rms of a torque at even positions, and its peak over the whole motion."""
    return TorqueSize(_rms(of(goal.task.machine)), _largest(goal, lambda machine: np.abs(of(machine))))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
