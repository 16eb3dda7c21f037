"""Gaps and layers written as plainly as they can be: shapely at one place, and every arrangement without pruning."""

from __future__ import annotations

import itertools

import numpy as np
import shapely


def shapely_gap(one, other) -> float:
    """Distance of two cores: points, lines or polygons, as complex corners."""
    return shapely.distance(_geometry(one), _geometry(other))


def _geometry(core):
    points = [(z.real, z.imag) for z in np.asarray(core, dtype=complex)]
    if len(points) == 1:
        return shapely.Point(points[0])
    return shapely.LineString(points) if len(points) == 2 else shapely.Polygon(points)


def free_stacks(machine, boards, hits, most):
    """Fewest layers of free stacks, and all of them as (layers, mounts); ``hits(a, b)`` says whether two parts ever collide.

    Without heads, and every plate in every layer: constraints 1 to 4 of `synthesis.assembly.layers` word by word.
    """
    names = [plate.name for plate in machine.plates]
    grounded = [pin.name for pin in machine.pins if pin.grounded] if boards != "bar" else []
    mounts = {"below": ["below"], "above": ["above"], "both": ["below", "above", "below+above"], "bar": []}[boards]
    for count in range(1, most + 1):
        found = []
        for chosen in itertools.product(range(1, count + 1), repeat=len(names)):
            layers = dict(zip(names, chosen))
            if set(chosen) != set(range(1, count + 1)):
                continue
            if any(layers[a] == layers[b] for pin in machine.pins for a, b in itertools.combinations(pin.joins, 2)):
                continue
            for held in itertools.product(mounts, repeat=len(grounded)):
                ways = dict(zip(grounded, held))
                if not _collides(machine, layers, ways, count, hits):
                    found.append((layers, ways))
        if found:
            return count, found
    return None, []


def _collides(machine, layers, ways, count, hits) -> bool:
    filled = {}
    for pin in machine.pins:
        own = [layers[name] for name in pin.joins]
        low = 1 if "below" in ways.get(pin.name, "") else min(own)
        high = count if "above" in ways.get(pin.name, "") else max(own)
        filled[pin.name] = set(range(low, high + 1)), set(own), set(pin.joins)
    for a, b in itertools.combinations(layers, 2):
        if layers[a] == layers[b] and hits(a, b):
            return True
    for pin, (own, _, joins) in filled.items():
        if any(layer in own and plate not in joins and hits(plate, pin) for plate, layer in layers.items()):
            return True
    for (a, (one, mine, _)), (b, (other, its, _)) in itertools.combinations(filled.items(), 2):
        if (one & other) - mine - its and hits(a, b):
            return True
    return False
