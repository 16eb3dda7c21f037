"""Follow a four-bar round its circuit in small steps, and judge a sequence of samples on it.

A configuration is (gamma, x, y): the angle of the coupler and the position of the crank pin D, the crank's pivot at
the origin, the rocker's at (L4, 0). Two distances are constant, |AD| and |BC|, so the configurations are curves in
three dimensions. The cross product of the two gradients is tangent to them and keeps its sense along a curve; near
a second curve it points against the sense of that curve, so that a step which lands on the wrong curve is detected
and repeated with a shorter step. Nothing of the product is imported.
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
    """Apply Newton's method to the curve within the plane through ``state`` with this normal; None if it does not
    converge.
    """
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


def apart(first, second):
    """Distance of two configurations; gamma counts modulo a turn."""
    turn = (first[0] - second[0] + math.pi) % TURN - math.pi
    return turn, first[1] - second[1], first[2] - second[2]


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
    """Configurations round a whole circuit, with tangents and the path length from the first; lengths have
    perimeter 4.
    """

    lengths: tuple
    states: list
    tangents: list
    path_length: list
    length: float
    found: dict = field(default_factory=dict)

    @cached_property
    def seen(self):
        """Angles that `_drives` needs for each configuration."""
        return [_seen(self.lengths, state) for state in self.states]

    def at(self, distance):
        """The configuration at a way from the first."""
        distance %= self.length
        k = max(bisect_left(self.path_length, distance) - 1, 0)
        remaining, state, t = distance - self.path_length[k], self.states[k], self.tangents[k]
        while remaining > 1e-13:
            state, t, step = advance(self.lengths, state, t, remaining)
            remaining -= step
        return state

    def position(self, state):
        """Return the path length to a configuration, or None if it is not on this circuit."""
        if state not in self.found:
            self.found[state] = self._position(state)
        return self.found[state]

    def _position(self, state):
        # in a hairpin the nodes of the other leg are as near: all within a step are tried
        distant = [sum(d * d for d in apart(sample, state)) for sample in self.states]
        for k in sorted((k for k in range(len(distant)) if distant[k] < (1.2 * STEP) ** 2), key=distant.__getitem__):
            there, t, distance = self.states[k], self.tangents[k], self.path_length[k]
            for _ in range(200):
                remaining = dot(apart(state, there), t)
                if not 1e-13 < remaining < 2 * STEP:
                    break
                there, t, step = advance(self.lengths, there, t, remaining)
                distance += step
            if max(map(abs, apart(state, there))) < 1e-7:
                return distance % self.length
        return None

    def reach(self):
        """Return smallest and largest theta1, from the first configuration; None for a crank that turns fully."""
        return _reach([crank[0] for crank, _ in [*self.seen, self.seen[0]]])


def _reach(values):
    total = low = high = 0.0
    for first, second in pairwise(values):
        total += (second - first + math.pi) % TURN - math.pi
        low, high = min(low, total), max(high, total)
    return None if abs(total) > 1 else (low, high)


def track(lengths, theta1, side):
    """The circuit through a configuration."""
    size = sum(lengths) / 4
    lengths = tuple(length / size for length in lengths)
    start = configuration(lengths, theta1, side)
    states, tangents, distance = [start], [tangent(lengths, start)], [0.0]
    step = STEP
    while True:
        there, t, step = advance(lengths, states[-1], tangents[-1], step)
        # round once if the first configuration lies ahead of the last, not ahead of this, and on the line between them
        before, behind = apart(start, states[-1]), apart(start, there)
        remaining = dot(before, tangents[-1])
        if remaining > 0 >= dot(behind, t) and dot(before, before) - remaining * remaining < (step / 5) ** 2:
            return Circuit(lengths, states, tangents, distance, distance[-1] + remaining)
        states.append(there)
        tangents.append(t)
        distance.append(distance[-1] + step)
        step = min(1.5 * step, STEP)
        assert len(states) < 100_000, "the circuit does not close"


@dataclass
class Judgement:
    """The contents of `synthesis.fourbar.verdict.Verdict`, from the tracked circuit."""

    order: bool
    branch: bool
    circuit: bool
    driver: str | None


def judge(circuit, samples, ordered=True, closed=False):
    """Samples (theta1, side), at least one of them on the circuit."""
    lengths = circuit.lengths
    states = [configuration(lengths, theta1, side) for theta1, side in samples]
    positions = [circuit.position(state) for state in states]
    same_circuit = None not in positions
    signs = [sides(lengths, state)[0] > 0 for state in states]
    drivers = [None]
    if same_circuit:
        directions = _orders(positions, circuit.length, ordered)
        drivers = [
            name
            for which, name in ((0, "crank"), (1, "rocker"))
            if any(
                _drives(circuit, positions[samples[0]], direction, which, closed) for samples, direction in directions
            )
        ] or [None]
    order = _crank_order(circuit, [theta1 for theta1, _ in samples], positions, ordered, closed)
    return Judgement(order, len(set(signs)) == 1, same_circuit, drivers[0])


def _orders(positions, length, ordered):
    """Orders of the samples with the signed way from the first to the last of them, below a whole round."""
    count = len(positions)
    if ordered:
        orders = [list(range(count))]
    else:
        once = sorted(range(count), key=positions.__getitem__)
        orders = [once[k:] + once[:k] for k in range(count)]
    found = []
    for order in orders:
        for sense in (1, -1):
            steps = [(sense * (positions[b] - positions[a])) % length for a, b in pairwise(order)]
            if sum(steps) < length:
                found.append((order, sense * sum(steps)))
    return found


def _drives(circuit, first, distance, which, closed):
    """Return true if a link turns in a direction without a dead position from a position on; round the circuit if
    closed.
    """
    distance = math.copysign(circuit.length, distance) if closed else distance
    low, high = sorted((first, first + distance))
    inside = [
        seen
        for lap in range(math.floor(low / circuit.length), math.ceil(high / circuit.length))
        for seen, at in zip(circuit.seen, circuit.path_length)
        if low + 1e-9 < at + lap * circuit.length < high - 1e-9
    ]
    ends = [_seen(circuit.lengths, circuit.at(end)) for end in (low, high)]
    way_of_link = [seen[which] for seen in (ends[0], *inside, ends[1])]
    if len({sign for _, sign in way_of_link}) > 1:
        return False
    steps = [(b - a + math.pi) % TURN - math.pi for (a, _), (b, _) in pairwise(way_of_link)]
    return all(step > 0 for step in steps) or all(step < 0 for step in steps)


def _seen(lengths, state):
    """Of crank and rocker, the angle and which side of its dead positions the configuration is on."""
    theta1, theta2, theta3 = angles(lengths, state)
    return (theta1, math.sin(theta3 - theta2) > 0), (theta3, math.sin(theta1 - theta2) > 0)


def _crank_order(circuit, crank, positions, ordered, closed):
    """Return true if a crank that reaches all crank angles on this circuit passes them in a direction."""
    reach = circuit.reach()
    if reach is None:
        sums = [sum((sense * (b - a)) % TURN for a, b in pairwise(crank)) for sense in (1, -1)]
        return not ordered or min(sums) < TURN
    if closed:
        return False
    first = angles(circuit.lengths, circuit.states[0])[0] + reach[0]
    span = reach[1] - reach[0]
    margin = (TURN - span) / 2
    swung = [(angle - first + margin) % TURN - margin for angle in crank]
    # the ends of the swing are known to a step's square only
    if any(position is None and not 0 <= angle <= span for angle, position in zip(swung, positions)):
        return False
    steps = [b - a for a, b in pairwise(swung)]
    return not ordered or all(step > 0 for step in steps) or all(step < 0 for step in steps)
