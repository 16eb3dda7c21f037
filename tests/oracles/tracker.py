"""A four-bar followed round its circuit in small steps, and what a sequence of samples is judged by on that way.

A configuration is (gamma, x, y): the angle of the coupler and the place of the crank pin D, the crank's pivot at the origin, the
rocker's at (L4, 0). Two distances are kept, |AD| and |BC|, so the configurations are curves in three dimensions. The cross
product of the two gradients is tangent to them and keeps its sense along a curve; where two curves come near each other it
points against the sense on the other one, so that a step which lands on the wrong curve is seen and taken again, shorter.
Nothing of the product is imported.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

TURN = 2 * math.pi
STEP = 0.04
TURNED = math.cos(0.12)


def configuration(lengths, theta1, side):
    """gamma, x, y by two circles that meet at C, or None."""
    l1, l2, l3, l4 = lengths
    x, y = l1 * math.cos(theta1), l1 * math.sin(theta1)
    along, across = l4 - x, -y
    r = math.hypot(along, across) or math.inf
    foot = (r * r + l2 * l2 - l3 * l3) / (2 * r)
    if not foot * foot <= l2 * l2:
        return None
    height = side * math.sqrt(l2 * l2 - foot * foot)
    return math.atan2(foot * across + height * along, foot * along - height * across), x, y


def angles(lengths, state):
    """theta1, theta2, theta3 in (-pi, pi]."""
    gamma, x, y = state
    cx, cy = x + lengths[1] * math.cos(gamma), y + lengths[1] * math.sin(gamma)
    return math.atan2(y, x), gamma, math.atan2(cy, cx - lengths[3])


def sides(lengths, state):
    """The sines that are zero at a dead position of the crank, sin(theta3 - theta2), and of the rocker, sin(theta1 - theta2)."""
    theta1, theta2, theta3 = angles(lengths, state)
    return math.sin(theta3 - theta2), math.sin(theta1 - theta2)


def distances(lengths, state):
    """Half of |AD|^2 - L1^2 and |BC|^2 - L3^2, and their gradients."""
    l1, l2, l3, l4 = lengths
    gamma, x, y = state
    c, s = l2 * math.cos(gamma), l2 * math.sin(gamma)
    ux, uy = x + c - l4, y + s
    values = (x * x + y * y - l1 * l1) / 2, (ux * ux + uy * uy - l3 * l3) / 2
    return values, (0.0, x, y), (uy * c - ux * s, ux, uy)


def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def tangent(lengths, state):
    _, first, second = distances(lengths, state)
    t = cross(first, second)
    size = math.sqrt(dot(t, t))
    return t[0] / size, t[1] / size, t[2] / size


def corrected(lengths, state, normal):
    """Newton's method to the curve within the plane through ``state`` with this normal; None where it does not converge."""
    for _ in range(8):
        (f, g), first, second = distances(lengths, state)
        b, c = cross(second, normal), cross(normal, first)
        det = dot(first, b)
        if det == 0:
            return None
        move = [-(f * b[k] + g * c[k]) / det for k in range(3)]
        state = tuple(state[k] + move[k] for k in range(3))
        size = max(map(abs, move))
        if size < 1e-14:
            break
        if size > 1:
            return None
    return state if size < 1e-11 else None


def apart(one, other):
    """Distance of two configurations; gamma counts modulo a turn."""
    turn = (one[0] - other[0] + math.pi) % TURN - math.pi
    return turn, one[1] - other[1], one[2] - other[2]


def advance(lengths, state, t, step):
    """The next configuration, its tangent and the step that was taken."""
    while True:
        ahead = tuple(state[k] + step * t[k] for k in range(3))
        there = corrected(lengths, ahead, t)
        if there is not None:
            turned = tangent(lengths, there)
            if dot(turned, t) > TURNED and max(map(abs, apart(there, ahead))) < step / 5 + 1e-12:
                return there, turned, step
        step /= 2
        assert step > 1e-14, "the way is lost"


@dataclass
class Circuit:
    """Configurations round a whole circuit, with tangents and the way from the first one; lengths have perimeter 4."""

    lengths: tuple
    states: list
    tangents: list
    way: list
    length: float
    found: dict = field(default_factory=dict)

    @cached_property
    def seen(self):
        """Of each configuration what `_drives` asks for."""
        return [_seen(self.lengths, state) for state in self.states]

    def at(self, way):
        """The configuration at a way from the first."""
        way %= self.length
        k = max(bisect_left(self.way, way) - 1, 0)
        rest, state, t = way - self.way[k], self.states[k], self.tangents[k]
        while rest > 1e-13:
            state, t, step = advance(self.lengths, state, t, rest)
            rest -= step
        return state

    def place(self, state):
        """The way to a configuration, or None where it is not on this circuit."""
        if state not in self.found:
            self.found[state] = self._place(state)
        return self.found[state]

    def _place(self, state):
        # in a hairpin the nodes of the other leg are as near: all within a step are tried
        far = [sum(d * d for d in apart(one, state)) for one in self.states]
        for k in sorted((k for k in range(len(far)) if far[k] < (1.2 * STEP) ** 2), key=far.__getitem__):
            there, t, way = self.states[k], self.tangents[k], self.way[k]
            for _ in range(200):
                rest = dot(apart(state, there), t)
                if not 1e-13 < rest < 2 * STEP:
                    break
                there, t, step = advance(self.lengths, there, t, rest)
                way += step
            if max(map(abs, apart(state, there))) < 1e-7:
                return way % self.length
        return None

    def reach(self):
        """Smallest and largest theta1, from that of the first configuration; None for one that turns fully."""
        return _reach([crank[0] for crank, _ in [*self.seen, self.seen[0]]])


def _reach(values):
    total = low = high = 0.0
    for one, other in pairwise(values):
        total += (other - one + math.pi) % TURN - math.pi
        low, high = min(low, total), max(high, total)
    return None if abs(total) > 1 else (low, high)


def track(lengths, theta1, side):
    """The circuit through a configuration."""
    size = sum(lengths) / 4
    lengths = tuple(length / size for length in lengths)
    start = configuration(lengths, theta1, side)
    states, tangents, way = [start], [tangent(lengths, start)], [0.0]
    step = STEP
    while True:
        there, t, step = advance(lengths, states[-1], tangents[-1], step)
        # round once if the first configuration lies ahead of the last one, not ahead of this one, and on the line between them
        before, behind = apart(start, states[-1]), apart(start, there)
        rest = dot(before, tangents[-1])
        if rest > 0 >= dot(behind, t) and dot(before, before) - rest * rest < (step / 5) ** 2:
            return Circuit(lengths, states, tangents, way, way[-1] + rest)
        states.append(there)
        tangents.append(t)
        way.append(way[-1] + step)
        step = min(1.5 * step, STEP)
        assert len(states) < 100_000, "the circuit does not close"


@dataclass
class Judgement:
    """What `synthesis.fourbar.verdict.Verdict` says, from the tracked circuit."""

    order: bool
    branch: bool
    circuit: bool
    driver: str | None


def judge(circuit, samples, ordered=True, closed=False):
    """Samples (theta1, side), at least one of them on the circuit."""
    lengths = circuit.lengths
    states = [configuration(lengths, theta1, side) for theta1, side in samples]
    places = [circuit.place(state) for state in states]
    same_circuit = None not in places
    signs = [sides(lengths, state)[0] > 0 for state in states]
    drivers = [None]
    if same_circuit:
        ways = _ways(places, circuit.length, ordered)
        drivers = [
            name
            for which, name in ((0, "crank"), (1, "rocker"))
            if any(_drives(circuit, places[samples[0]], way, which, closed) for samples, way in ways)
        ] or [None]
    order = _crank_order(circuit, [theta1 for theta1, _ in samples], places, ordered, closed)
    return Judgement(order, len(set(signs)) == 1, same_circuit, drivers[0])


def _ways(places, length, ordered):
    """Orders of the samples with the signed way from the first to the last of them, below a whole round."""
    count = len(places)
    if ordered:
        orders = [list(range(count))]
    else:
        once = sorted(range(count), key=places.__getitem__)
        orders = [once[k:] + once[:k] for k in range(count)]
    found = []
    for order in orders:
        for sense in (1, -1):
            steps = [(sense * (places[b] - places[a])) % length for a, b in pairwise(order)]
            if sum(steps) < length:
                found.append((order, sense * sum(steps)))
    return found


def _drives(circuit, first, way, which, closed):
    """Whether a link turns one way, and does not pass a dead position, from a place on; round the circuit where closed."""
    way = math.copysign(circuit.length, way) if closed else way
    low, high = sorted((first, first + way))
    inside = [
        seen
        for lap in range(math.floor(low / circuit.length), math.ceil(high / circuit.length))
        for seen, at in zip(circuit.seen, circuit.way)
        if low + 1e-9 < at + lap * circuit.length < high - 1e-9
    ]
    ends = [_seen(circuit.lengths, circuit.at(one)) for one in (low, high)]
    way_of_link = [one[which] for one in (ends[0], *inside, ends[1])]
    if len({sign for _, sign in way_of_link}) > 1:
        return False
    steps = [(b - a + math.pi) % TURN - math.pi for (a, _), (b, _) in pairwise(way_of_link)]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)


def _seen(lengths, state):
    """Of crank and rocker, the angle and which side of its dead positions the configuration is on."""
    theta1, theta2, theta3 = angles(lengths, state)
    return (theta1, math.sin(theta3 - theta2) > 0), (theta3, math.sin(theta1 - theta2) > 0)


def _crank_order(circuit, crank, places, ordered, closed):
    """Whether the crank angles alone are passed one way, by a crank that reaches them all on this circuit."""
    reach = circuit.reach()
    if reach is None:
        sums = [sum((sense * (b - a)) % TURN for a, b in pairwise(crank)) for sense in (1, -1)]
        return not ordered or min(sums) < TURN
    if closed:
        return False
    first = angles(circuit.lengths, circuit.states[0])[0] + reach[0]
    span = reach[1] - reach[0]
    margin = (TURN - span) / 2
    swung = [(one - first + margin) % TURN - margin for one in crank]
    # the ends of the swing are known to a step's square only
    if any(place is None and not 0 <= one <= span for one, place in zip(swung, places)):
        return False
    steps = [b - a for a, b in pairwise(swung)]
    return not ordered or all(step > 0 for step in steps) or all(step < 0 for step in steps)
