"""Springs that carry a load, approximate a wanted torque or hold a linkage: ideal springs, and springs of a catalogue.

A search works with the difference between the torque of the drive and the wanted torque, at even positions of the motion.
Lengths, twists and forces are then checked over the whole motion; a position that violates a limit joins the search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from linkage_atlas.arguments import Fields, build
from linkage_atlas.drive_design.question import SpringRequest
from linkage_atlas.drive_design.records import (
    BeforeAfter,
    Holds,
    Spring,
    SpringCurve,
    TorqueSize,
    TorsionCurve,
    TorsionSpring,
)
from linkage_atlas.drive_design.task import DriveTask, both_ends
from linkage_atlas.records import plane, xy
from synthesis.arrays import Floats
from synthesis.drives.balance import springs_on_pendulums
from synthesis.drives.links import GROUND, LinkMotions, largest
from synthesis.drives.spring_search import SpringSearch
from synthesis.drives.springs import Behaviour, MountedSpring, SpringRegion, pairs_of, rms_of, torque_of
from synthesis.drives.springs import Spring as LinearSpring
from synthesis.drives.springs import TorsionSpring as MountedTorsion
from synthesis.drives.torsion import best_torsion_spring, joint_of

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


SpringSet = Sequence[MountedSpring]
"""Springs that work together."""


class Goal:
    """Purpose of the springs of an entry: a wanted torque, and limits on the torque of the drive."""

    def __init__(self, task: DriveTask, request: SpringRequest) -> None:
        self.task, self.request = task, request
        self.holds = request.holds if request.holds and (request.holds.closed or request.holds.open) else None
        self.is_limited = self.holds is not None or request.hand_force_max is not None
        self.peak = float(np.abs(task.torque).max())

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

    def torque(self, machine: LinkMotions, springs: SpringSet = ()) -> Floats:
        """Return the torque of the drive without springs or with them."""
        return machine.torque(self.task.question.load) + torque_of(springs, machine)

    def difference(self, machine: LinkMotions, springs: SpringSet = ()) -> Floats:
        """Return the torque of the drive less the wanted torque."""
        return self.torque(machine, springs) - self.target(machine)

    @cached_property
    def size(self) -> float:
        """Root mean square of the difference without springs."""
        return rms_of(self.difference(self.task.machine))

    def violation(self, machine: LinkMotions, springs: SpringSet) -> float:
        """Return the torque by which springs violate the limits; 0 up to rounding."""
        behaviour = self.behaviour(machine)
        if behaviour is None:
            return 0.0
        torque = float(behaviour.violation(self.difference(machine, springs)))
        return torque if torque > ROUNDING * max(self.peak, *behaviour.margins) else 0.0

    def rank(self, springs: SpringSet) -> tuple[float, float]:
        """Return the violation of limits, then the rms difference from the wanted torque; smaller is better."""
        machine = self.task.machine
        return self.violation(machine, springs), rms_of(self.difference(machine, springs))

    def suffices(self, springs: SpringSet, share: float) -> bool:
        """Check that springs satisfy the limits, or without limits leave at most a fraction of the difference."""
        violation, left = self.rank(springs)
        return violation == 0 if self.is_limited else left <= share * self.size

    def violated_at(self, springs: SpringSet) -> list[float]:
        """Return travels of the drive between the positions of a search at which a promise is violated."""
        fine = self.task.fine
        excess = np.max([spring.excess(fine) for spring in springs], axis=0)
        found = [float(fine.at[np.argmax(excess)])] if excess.max() > RANGE_ROUNDING else []
        behaviour = self.behaviour(fine)
        if behaviour is not None and behaviour.torque_max is not None and self.violation(fine, springs) > 0:
            found.append(float(fine.at[np.argmax(np.abs(self.torque(fine, springs)) - behaviour.torque_max)]))
        return found

    def reason(self, springs: SpringSet) -> str:
        """Explain what the best springs lack."""
        machine = self.task.machine
        behaviour = self.behaviour(machine)
        if behaviour is None:
            share = 100 * self.rank(springs)[1] / self.size
            left = f"the best ({_words(springs)}) leaves {share:.3g} % of the {self.quantity}"
            return f"{left}; only springs that remove at least half of it are returned"
        torque = self.torque(machine, springs)
        wrong, (first, last) = [], torque[[0, -1]] * machine.sense
        if behaviour.holds_first and first < behaviour.margins[0]:
            wrong.append("does not hold the first position (closed)")
        if behaviour.holds_last and -last < behaviour.margins[1]:
            wrong.append("does not hold the last position (open)")
        if behaviour.torque_max is not None and np.any(np.abs(torque) > behaviour.torque_max):
            wrong.append(f"needs a hand force of {np.abs(torque / self.hand_speed(machine)).max():.4g}")
        return f"no spring of the catalogue has this behaviour; the nearest ({_words(springs)}) {' and '.join(wrong)}"

    @property
    def quantity(self) -> str:
        """Name of the quantity that springs reduce."""
        return "rms torque" if self.request.target is None else "rms difference from the wanted curve"


def _words(springs: SpringSet) -> str:
    """Name springs and the links that they join."""
    parts = []
    for spring in springs:
        joins = "from {} to {}" if isinstance(spring, LinearSpring) else "between {} and {}"
        parts.append(f"{spring.name} {joins.format(*spring.between)}")
    return " and ".join(parts)


def find_springs(task: DriveTask, request: SpringRequest, set_number: int) -> None:
    """Find springs for one entry of a request."""
    links = "any two links" if request.between is None else "-".join(request.between)
    if not task.loaded and not request.has_goal:
        task.refuse(request.kind, links, "there is no load to balance")
        return
    goal = Goal(task, request)
    found: SpringSet | str
    if request.rows or request.torsion_rows:
        found = _over_whole_motion(goal)
        if not isinstance(found, str) and not goal.suffices(found, HELP_SHARE):
            found = goal.reason(found)
    else:
        found = _ideal(task, request)
    if isinstance(found, str):
        task.refuse(request.kind, links, found)
    else:
        _add(goal, set_number, found)


def _over_whole_motion(goal: Goal) -> SpringSet | str:
    """Search at more positions until lengths, twists and forces keep their limits over the whole motion."""
    task, machine = goal.task, goal.task.machine
    for _ in range(MAX_ROUNDS):
        found = _torsion(goal, machine) if goal.request.torsion_rows else _from_catalogue(goal, machine)
        if isinstance(found, str) or goal.violation(machine, found) > 0:
            return found
        violated = goal.violated_at(found)
        if not violated:
            return found
        reason = f"the best ({_words(found)}) leaves its limits between the positions of the search"
        if task.work.expired():
            break
        at = np.unique([*machine.at, *violated])
        machine = task.operation.poses(at if machine.sense > 0 else at[::-1])
    return reason


def _torsion(goal: Goal, machine: LinkMotions) -> SpringSet | str:
    count, between = goal.request.count, goal.request.between
    rows = [row._replace(rate=count * row.rate, preload=count * row.preload) for row in goal.request.torsion_rows]
    found = best_torsion_spring(machine, goal.difference(machine), between, rows, goal.behaviour(machine))
    return found if isinstance(found, str) else [found]


def _from_catalogue(goal: Goal, machine: LinkMotions) -> SpringSet | str:
    """Find a spring, or two on the links with fixed pivots if these are clearly better."""
    task, request, extent, count = goal.task, goal.request, machine.extent, goal.request.count
    room = SpringRegion(
        request.ground_box or task.box,
        float(request.reach_max or extent),
        float(request.pivot_distance_min or CLEAR_SHARE * extent),
    )
    rows = [row._replace(stiffness=count * row.stiffness, preload=count * row.preload) for row in request.rows]
    search = SpringSearch(machine, rows, room, goal.behaviour(machine), task.work)
    torque, between = goal.difference(machine), request.between
    best = search.best(torque, pairs_of(machine) if between is None else [between])
    found = best if isinstance(best, str) else [best]
    pivoted = [(GROUND, name) for name, link in machine.links.items() if link.pivot is not None]
    if between is not None or len(pivoted) < 2 or task.work.expired():
        return found
    if isinstance(found, str) or not goal.suffices(found, ENOUGH_SHARE):
        two = search.best_set(torque, pivoted[:2])
        if not isinstance(two, str) and (isinstance(found, str) or goal.rank(two) < goal.rank(found)):
            return two
    return found


def _ideal(task: DriveTask, request: SpringRequest) -> SpringSet | str:
    """Find springs of zero free length that balance every position, or return the reason why there are none."""
    plain, load, between = task.operation.plain, task.question.load, request.between
    if load.torque or load.speed:
        return "springs of zero free length cannot carry a torque or inertia; give a catalogue"
    stiffness = None if request.stiffness is None else request.count * request.stiffness
    springs = springs_on_pendulums(plain, task.machine, task.torque, stiffness)
    if springs is None:
        kind = "link on a hinge" if plain is None else plain.kind.value
        return f"no springs of zero free length on a {kind} balance this load in every position; give a catalogue"
    if not springs:
        return "the drive carries no load that springs could balance"
    if between is not None and (len(springs) > 1 or springs[0].between != between):
        where = " and ".join("-".join(spring.between) for spring in springs)
        return f"one spring between {between[0]} and {between[1]} does not balance this load; {where} do; remove `between`"
    return springs


# -- records ----------------------------------------------------------------------------------------------------------


def _add(goal: Goal, set_number: int, springs: SpringSet) -> None:
    task, request, machine = goal.task, goal.request, goal.task.machine
    torque, own = goal.torque(machine, springs), torque_of(springs, machine)
    before, after = _size(goal, goal.torque), _size(goal, lambda machine: goal.torque(machine, springs))
    left = rms_of(goal.difference(machine, springs))
    if left > HELP_SHARE * goal.size > 0:
        what = goal.quantity + (" of the drive" if request.target is None else "")
        task.notes.append(
            f"springs of set {set_number} show the requested behaviour, but leave {100 * left / goal.size:.3g} % of the {what}"
        )
    uses_hand = (
        request.hand_force_max is not None
        or (goal.holds is not None and goal.holds.force_min is not None)
        or (request.target is not None and request.target.quantity == "hand_force")
    )
    hand = hand_max = deviation = None
    if machine.body is not None and (task.question.hand_point is not None or uses_hand):
        hand = torque / goal.hand_speed(machine) * machine.sense
        hand_max = _largest(goal, lambda machine: np.abs(goal.torque(machine, springs) / goal.hand_speed(machine)))
    if request.target is not None:
        deviation = BeforeAfter(
            _size(goal, goal.difference), _size(goal, lambda machine: goal.difference(machine, springs))
        )
    holds, motion_at_ends = _at_ends(torque[[0, -1]] * machine.sense, max(before.peak, float(np.abs(own).max())))
    pulls = [pull for spring in springs for pull in spring.pulls(machine) if pull.link != GROUND]
    effect = {
        "set": set_number,
        "count": request.count,
        "torque": BeforeAfter(before, after),
        "pin_forces": task.pin_peaks(machine, pulls),
        "motion_at_ends": motion_at_ends,
        "holds": holds,
        "hand_force_max": hand_max,
        "deviation": deviation,
    }
    if request.kind == "compression" and BUCKLING not in task.notes:
        task.notes.append(BUCKLING)
    curve = {"crank_angle": task.operation.curve_at, "torque": torque, "hand_force": hand}
    fine = task.fine
    remaining = np.abs(goal.torque(fine, springs)).max()
    exact = not (request.rows or request.torsion_rows) and bool(remaining <= EXACT * np.abs(goal.torque(fine)).max())
    for spring in springs:
        own_fields = {"name": spring.name, "between": spring.between, **effect}
        if isinstance(spring, LinearSpring):
            task.springs.append(_linear_record(goal, spring, exact, curve, own_fields))
        else:
            task.springs.append(_torsion_record(goal, spring, curve, own_fields))


def _linear_record(goal: Goal, spring: LinearSpring, exact: bool, curve: Fields, effect: Fields) -> Spring:
    machine, count, row = goal.task.machine, goal.request.count, spring.row
    ends, length = plane(np.stack(spring.ends(machine), axis=1)), spring.length(machine)
    own = {
        "kind": goal.request.kind,
        "points": (both_ends(ends[0, 0]), both_ends(ends[0, 1])),
        "points_on_links": (xy(spring.points[0]), xy(spring.points[1])),
        "stiffness": row.stiffness / count,
        "free_length": row.free_length,
        "preload": row.preload / count,
        "length": (-_largest(goal, lambda machine: -spring.length(machine)), _largest(goal, spring.length)),
        "exact": exact,
        "curve": build(SpringCurve, {**curve, "length": length, "force": row.force(length) / count, "ends": ends}),
    }
    return build(Spring, {**own, **effect})


def _torsion_record(goal: Goal, spring: MountedTorsion, curve: Fields, effect: Fields) -> TorsionSpring:
    task, machine, count = goal.task, goal.task.machine, goal.request.count
    radian, twist, joint = task.operation.radian, spring.twist(machine), joint_of(machine, spring.between)
    assert joint is not None
    extremes = spring.twist(task.fine)
    own = {
        "point": xy(joint),
        "rate": spring.row.rate / count * radian,
        "preload": spring.row.preload / count,
        "direction": 1 if spring.direction > 0 else -1,
        "twist": (float(extremes.min()) / radian, float(extremes.max()) / radian),
        "curve": build(TorsionCurve, {**curve, "twist": twist / radian, "moment": spring.moment(twist) / count}),
    }
    return build(TorsionSpring, {**own, **effect})


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
    return TorqueSize(rms_of(of(goal.task.machine)), _largest(goal, lambda machine: np.abs(of(machine))))
