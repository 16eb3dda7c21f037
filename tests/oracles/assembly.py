"""Compute gaps and layers as plainly as possible: shapely in each position, and every arrangement without pruning."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import shapely

from synthesis.assembly.driven_machine import motor_driven
from synthesis.assembly.linkage_machine import as_plates
from synthesis.assembly.machine import Machine, Sizes
from synthesis.assembly.parts import Heights, parts_of
from synthesis.assembly.stacks import Arrangement, StackSearch
from synthesis.drives.crank_rocker import place_motor_about_pivot, proportions
from synthesis.drives.links import motions_of
from synthesis.drives.motor_search import place_motor
from synthesis.drives.six_bar import Motor
from synthesis.guides import DRIVERS, Circle, Rail, Slot
from synthesis.linkage import four_bar, on_guides
from synthesis.target import TURN, Interval
from tests.oracles.four_bar_joints import joints_at

POSITIONS = 721
"""Positions of each motion, its ends included."""
CLOSE = 1e-9
"""Fraction of the size: gaps between this and its negative are not compared."""
SEED = 7


def shapely_gap(first, second) -> float:
    """Distance of two cores: points, lines or polygons, as complex corners."""
    return shapely.distance(_geometry(first), _geometry(second))


def _geometry(core):
    points = [(z.real, z.imag) for z in np.asarray(core, dtype=complex)]
    if len(points) == 1:
        return shapely.Point(points[0])
    return shapely.LineString(points) if len(points) == 2 else shapely.Polygon(points)


def free_stacks(machine, boards, hits, largest):
    """Return the fewest layers of free stacks, and all such stacks as (layers, mounts); ``hits(a, b)`` is true if
    two parts ever collide.

    Without heads, and every plate in every layer: constraints 1 to 4 of `synthesis.assembly.stacks` word by
    word.
    """
    names = [plate.name for plate in machine.plates]
    grounded = [pin.name for pin in machine.pins if pin.grounded] if boards != "bar" else []
    mounts = {"below": ["below"], "above": ["above"], "both": ["below", "above", "below+above"], "bar": []}[boards]
    for count in range(1, largest + 1):
        found = []
        for chosen in itertools.product(range(1, count + 1), repeat=len(names)):
            layers = dict(zip(names, chosen))
            if set(chosen) != set(range(1, count + 1)):
                continue
            if any(layers[a] == layers[b] for pin in machine.pins for a, b in itertools.combinations(pin.joins, 2)):
                continue
            for held in itertools.product(mounts, repeat=len(grounded)):
                directions = dict(zip(grounded, held))
                if not _collides(machine, layers, directions, count, hits):
                    found.append((layers, directions))
        if found:
            return count, found
    return None, []


def _collides(machine, layers, directions, count, hits) -> bool:
    filled = {}
    for pin in machine.pins:
        own = [layers[name] for name in pin.joins]
        low = 1 if "below" in directions.get(pin.name, "") else min(own)
        high = count if "above" in directions.get(pin.name, "") else max(own)
        filled[pin.name] = set(range(low, high + 1)), set(own), set(pin.joins)
    for a, b in itertools.combinations(layers, 2):
        if layers[a] == layers[b] and hits(a, b):
            return True
    for pin, (own, _, joins) in filled.items():
        if any(layer in own and plate not in joins and hits(plate, pin) for plate, layer in layers.items()):
            return True
    for (a, (first, mine, _)), (b, (second, its, _)) in itertools.combinations(filled.items(), 2):
        if (first & second) - mine - its and hits(a, b):
            return True
    return False


# -- random machines, and their results by shapely ---------------------------------------------------------------------


def _star(random: np.random.Generator) -> tuple[complex, ...]:
    """The outline of a body, mostly not convex; of seven in ten machines none."""
    angle = np.sort(random.uniform(0, TURN, 9))
    star = tuple(random.uniform(0.05, 0.3, 9) * np.exp(1j * angle))
    return star if random.random() < 0.3 and np.all(np.diff(angle) > 1e-3) else ()


def _sizes(random: np.random.Generator, largest: float) -> Sizes:
    """Pins up to a size, plates narrow and wide, and a clearance."""
    hole = largest * random.uniform(0.3, 1.0)
    return Sizes(hole, hole * random.uniform(1.3, 3.5), random.uniform(0, 0.02))


def sliders(count: int) -> Iterator[Machine]:
    """Random bodies on two guides of all kinds, by all their drives, over a part of what each can do or a turn."""
    random = np.random.default_rng(SEED)

    def position(size: float = 1.0) -> complex:
        return complex(*random.normal(size=2)) * size

    def guide(kind: Any) -> Any:
        if kind is Circle:
            return Circle(position(2.0), float(random.uniform(0.3, 2.0)), position())
        if kind is Rail:
            return Rail(position(2.0), float(random.uniform(0, TURN)), position())
        return Slot(position(2.0), position(), float(random.uniform(0, TURN)))

    directions = [(driver, second, drive) for driver in DRIVERS for second in DRIVERS for drive in DRIVERS[driver]]
    directions = [direction for direction in directions if direction[:2] != (Circle, Circle)]
    while count:
        first, second, drive = directions[count % len(directions)]
        linkage = on_guides(
            (guide(first), guide(second)), drive, int(random.choice([-1, 1])), float(random.uniform(-3, 3))
        )
        span = float(random.uniform(0.2, 1.5)) if random.random() < 0.7 or not drive.turns else TURN
        with np.errstate(all="ignore"):
            closes = linkage.closes_over(Interval(linkage.start, linkage.start + span))
        try:
            machine = as_plates(linkage, Interval(0.0, span), Sizes()) if closes else None
            if machine is not None:
                largest = min(1.3 * machine.hole, 0.3 * min(machine.lengths))
                machine = as_plates(linkage, Interval(0.0, span), _sizes(random, largest), _star(random))
        except ValueError:
            machine = None
        # a body that is flung far away gives no information
        if machine is None or max(abs(z) for plate in machine.plates for z in plate.shape.core) > 50:
            continue
        yield machine
        count -= 1


def six_bars(count: int) -> Iterator[Machine]:
    """Random four-bars whose crank or rocker a motor with a rod swings there and back."""
    random = np.random.default_rng(SEED)
    while count:
        links = tuple(10.0 ** random.uniform(-0.6, 0, 4))
        point = (random.uniform(0, 0.5), random.uniform(0, TURN))
        linkage = four_bar(
            links, int(random.choice([-1, 1])), random.uniform(0, TURN), 0j, random.uniform(0, TURN), point
        )
        used = Interval(0.0, float(random.uniform(0.4, 2.5)))
        joints = joints_at(linkage, np.linspace(*used, 400))
        if not joints.closed:
            continue
        link, ends, pivot = "crank", joints.crank_angle[[0, -1]], linkage.pivot_a
        if random.random() < 0.5:
            link, ends, pivot = "rocker", joints.rocker_angle[[0, -1]], linkage.pivot_b
        swing = ends[1] - ends[0]
        built = proportions(abs(swing), float(random.choice([1.0, random.uniform(1.05, 1.6)])))
        if built is None or built.transmission_angle_min < 0.2:
            continue
        radius, angle = (
            float(random.uniform(0.4, 1.1)) * links[0 if link == "crank" else 2],
            random.uniform(-0.5, 0.5),
        )
        # the proportions belong to a swing that turns counter-clockwise
        motor = built.motor if swing > 0 else built.motor.conjugate()
        at = pivot + radius * motor * np.exp(1j * (ends.mean() + angle))
        pin = complex(radius * np.exp(1j * angle))
        motor = Motor(link, complex(at), radius * built.crank, radius * built.rod, pin)
        try:
            yield motor_driven(linkage, used, motor, _sizes(random, 0.25 * min(*links, motor.crank)))
        except ValueError:
            continue
        count -= 1


def other_six_bars(count: int) -> Iterator[tuple[Any, Interval, Motor]]:
    """Random motors on couplers of four-bars, and on cranks, rockers and bodies of linkages on rails and slots, in turn."""
    random = np.random.default_rng(SEED)
    tried = 0
    while count:
        tried += 1
        linkage: Any
        if count % 2:
            linkage = four_bar(
                tuple(10.0 ** random.uniform(-0.4, 0.1, 4)),
                int(random.choice([-1, 1])),
                random.uniform(0, TURN),
                1 - 2j,
            )
        else:
            crank = Circle(complex(*random.normal(size=2)), float(random.uniform(0.4, 1.0)), 0j)
            rail = Rail(
                complex(*random.normal(size=2)), float(random.uniform(0, TURN)), complex(random.uniform(1.5, 3))
            )
            slot = Slot(complex(*random.normal(size=2)) * 2, 0.1j, float(random.uniform(-0.3, 0.3)))
            pair: Any = ((crank, rail), (crank, slot), (rail, crank))[tried % 3]
            linkage = on_guides(pair, DRIVERS[type(pair[0])][0], int(random.choice([-1, 1])), random.uniform(0, 3))
        used = Interval(0.0, float(random.uniform(0.4, 1.2)))
        with np.errstate(all="ignore"):
            machine = motions_of(linkage, used)
        if not all(np.isfinite(link.rate).all() for link in machine.links.values()):
            continue
        link = machine.links[
            str(random.choice([name for name in machine.links if not name.endswith(("slider", "block"))]))
        ]
        if linkage.is_four_bar:
            link = machine.links["coupler"]
        with np.errstate(all="ignore"):
            if link.pivot is None:
                found = place_motor(link, machine.at, np.ones(61), None, 1.5, (-4.0, -4.0, 4.0, 4.0))
            else:
                found = place_motor_about_pivot(link, np.ones(61), None, 0.6, False, None)
        if isinstance(found, str) or found.transmission_angle_min < 0.15:
            continue
        yield linkage, used, Motor(link.name, found.motor, found.crank, found.rod, found.pin)
        count -= 1


def motors_elsewhere(count: int) -> Iterator[Machine]:
    """Return the linkages as machines with plates of all sizes."""
    random, built = np.random.default_rng(SEED), 0
    for case in other_six_bars(2 * count):
        if built == count:
            return
        try:
            plain = motor_driven(*case, Sizes())
            yield motor_driven(*case, _sizes(random, plain.hole))
        except ValueError:
            continue
        built += 1


def outlines(machine: Machine, body: int, core: tuple[complex, ...], travel: Any) -> Any:
    """A core as shapely's geometries at places (n,)."""
    bodies = machine.movement.bodies(travel)
    points = bodies.origin[body][:, None] + bodies.direction[body][:, None] * np.array(core)
    positions = np.stack([points.real, points.imag], axis=-1)
    if len(core) == 1:
        return shapely.points(positions[:, 0])
    return shapely.linestrings(positions) if len(core) == 2 else shapely.polygons(positions)


def disagreements(machine: Machine, search: StackSearch) -> tuple[int, int, int]:
    """Pairs, places that were compared, and of them those where the proof and shapely differ."""
    travel = np.linspace(*machine.used, POSITIONS)
    drawn: dict[Any, Any] = {}
    compared = wrong = 0
    for pair, proof in zip(search.carried, search.proofs):
        for carried in pair:
            if carried not in drawn:
                drawn[carried] = outlines(machine, carried.body, carried.shape.core, travel)
        radii = sum(carried.shape.radius for carried in pair)
        gap = shapely.distance(*(drawn[carried] for carried in pair)) - radii - machine.clearance
        hits = np.zeros(POSITIONS, dtype=bool)
        reported = np.abs(gap) > CLOSE * machine.size
        for run in proof.hits:
            hits |= (run.first <= travel) & (travel <= run.last)
        for run in proof.touches:
            reported &= ~((run.first <= travel) & (travel <= run.last))
        compared += int(reported.sum())
        wrong += int((reported & (hits != (gap < 0))).sum())
    return len(search.proofs), compared, wrong


def nearest(machine: Machine, found: Arrangement) -> float:
    """The least gap less clearance of parts that fill a common layer and are not joined, at all places, over the size."""
    travel = np.linspace(*machine.used, POSITIONS)
    joined = {pin.name: set(pin.joins) for pin in machine.pins}
    telescopes = {frozenset(pair) for pair in machine.telescopes}
    parts = [linkage for linkage in parts_of(machine, found.stack, Heights(1.0, 0.2)) if linkage.kind != "board"]
    drawn = [outlines(machine, part.body, part.shape.core, travel) for part in parts]
    smallest = np.inf
    for k, later in enumerate(parts):
        for n, second in enumerate(parts[:k]):
            if {later.name, second.name} in telescopes:
                continue
            common = set(range(later.layers[0], later.layers[1] + 1)) & set(
                range(second.layers[0], second.layers[1] + 1)
            )
            common &= set(range(1, found.stack.count + 1))
            # a plate of its own replaces the pin
            for part in (later, second):
                if part.kind != "plate":
                    common -= {found.stack.layers[plate] for plate in joined[part.name.split("_")[1]]}
            if common:
                gap = (
                    shapely.distance(drawn[k], drawn[n])
                    - later.shape.radius
                    - second.shape.radius
                    - machine.clearance
                )
                smallest = min(smallest, float(np.min(gap)))
    return smallest / machine.size
