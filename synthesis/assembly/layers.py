"""In which layers plates lie so that nothing collides, by a small search over layers and over how fixed pins are held; and parts.

Layers are numbered from 1; board 0 lies below them, board N + 1 above. What is asked of an arrangement:

1. plates that a pin joins lie in different layers;
2. plates in one layer keep clear of one another;
3. a pin fills the layers from its lowest to its highest plate, a fixed one on to its board; plates there that it does not join
   keep clear of it;
4. so do two pins in a layer where neither has a plate of its own, or where one slides in a slit of the plate of both;
5. a head fills one layer more at each free end of a pin, and lies in no board: only with heads may a layer be empty.

The parts of an arrangement (plates, pins, posts, heads, boards) are flat outlines between two heights, each on one body. The z
axis rises with the layers; layer 1 begins at z = 0. An outline is a `Shape` in the frame of the body that carries it. Where that
frame is at a crank angle, `Movement.bodies` says: ``origin + direction * z``, from `Machine.origin` in the user's plane.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations, product
from typing import Literal, NamedTuple

from synthesis.assembly.gaps import Carried, Gaps, Least, Proof, Run, Shape, disc, hull
from synthesis.assembly.machine import WHOLE, Hole, Machine, Pin, Slit
from synthesis.assembly.movement import GROUND
from synthesis.errors import FieldError
from synthesis.mechanism import Box
from synthesis.target import TURN, Interval
from synthesis.work import Work

ENVELOPE = "envelope"
BOARDS = ("below", "above", "both", "bar")
HEAD = 1.8
"""Diameter of a head, in diameters of its pin."""
BELOW, ABOVE, BOTH = "below", "above", "below+above"
MOST_LOOKED, MOST_BLOCKED = 40_000, 4_000
"""Arrangements that are looked at for free ones, and for the best of those that are not: a few seconds."""
THICKNESS = 0.5
"""The default thickness of a plate, in diameters of its holes."""
WASHER = 0.2
"""The default thickness of the washers between two layers, in thicknesses of a plate."""
_LEVEL = 1e-9
"""Of the size: least gaps nearer than this are alike."""

Pair = tuple[str, str]


class Head(NamedTuple):
    """A head of a pin and the layer that it fills."""

    pin: str
    end: str
    """"below" or "above"."""
    layer: int


@dataclass(frozen=True)
class Stack:
    """Layers of plates, how each fixed pin is held, and what follows: layers that pins and heads fill."""

    count: int
    layers: dict[str, int]
    mounts: dict[str, str]
    pins: dict[str, tuple[int, int]]
    heads: tuple[Head, ...]
    pairs: tuple[int, ...] = ()
    """Numbers of the pairs that meet in a layer."""

    @property
    def held(self) -> int:
        """Pins that are held on both sides."""
        return sum(mount == BOTH for mount in self.mounts.values())

    @property
    def pin_length(self) -> int:
        """Of all pins, in layers."""
        return sum(high - low for low, high in self.pins.values())


class Collision(NamedTuple):
    """Two parts, and crank angles over which they collide; over the seam of a turn beyond its end."""

    pair: Pair
    first: float
    last: float


class Stop(NamedTuple):
    """Where the motion ends."""

    at: float
    pair: Pair | None
    """What collides there; None: the loop itself ends."""


@dataclass(frozen=True)
class Shaft:
    """Whether a shaft may pass through all layers at a fixed pivot, and what passes over it if not."""

    both_sides: bool
    passes: tuple[Collision, ...]


@dataclass(frozen=True)
class Arrangement:
    """The best stack, and what is to be said of it."""

    status: str
    """"free", "touching" or "blocked"."""
    stack: Stack
    least: tuple[Pair, Least] | None
    """The least gap of all pairs that meet; None where none does, or where the stack is not free."""
    collisions: tuple[Collision, ...]
    touches: tuple[Collision, ...]
    free: Interval | None
    """Where the stack is blocked, the longest part of the used interval over which it is free."""
    low: Stop | None
    high: Stop | None
    fewer: dict[int, Collision | None]
    """What stops the best stack with a layer less; None where no stack of so few layers exists."""
    others: int
    """Further free stacks of as many layers."""
    tried: int
    shaft: dict[str, Shaft] = field(default_factory=dict)
    exhaustive: bool = True
    """Whether all arrangements of as many layers, and where blocked of all layers allowed, were looked at."""
    best_known: bool = True
    """Where blocked: whether the stack is the best of all, and not only of those that were looked at."""


class Asked(NamedTuple):
    """What an assembly is asked for."""

    boards: str = "below"
    heads: bool = False
    most: int = 6
    mounts: Mapping[str, str] = {}
    """How some of the fixed pins must be held."""


class _Part(NamedTuple):
    """A plate, a pin or a head, and its shape on each body that it belongs to."""

    name: str
    shapes: tuple[Carried, ...]


def arrange(machine: Machine, asked: Asked, work: Work) -> Arrangement:
    """The best stack of a machine's plates: free with the fewest layers, or else free over the longest part of the motion.

    Among free ones of as many layers: most pins held on both sides, then the shortest pins, then the largest least gap.
    """
    return Search(machine, asked, work).answer()


class Search:
    """The parts of a machine, what is proved of their pairs, and the search for a stack."""

    def __init__(self, machine: Machine, asked: Asked, work: Work) -> None:
        self.machine, self.asked, self.work = machine, asked, work
        self.plates = [one.name for one in machine.plates]
        self.pins = [one.name for one in machine.pins]
        self.joined = {pin.name: frozenset(pin.joins) for pin in machine.pins}
        # a pin that slides in a plate may meet the others of that plate
        self.sliding = {
            (plate.name, frozenset((slit.pin, pin.name)))
            for plate in machine.plates
            for slit in plate.slits
            for pin in machine.pins
            if plate.name in pin.joins and pin.name != slit.pin
        }
        parts = [_Part(one.name, (Carried(one.body, one.shape),)) for one in machine.plates]
        parts += [
            _Part(one.name, tuple(Carried(at.body, disc(at.at, one.radius)) for at in one.places))
            for one in machine.pins
        ]
        if asked.heads:
            parts += [
                _Part(_head(one.name), tuple(Carried(at.body, disc(at.at, HEAD * one.radius)) for at in one.places))
                for one in machine.pins
            ]
        self.partner = {a: b for pair in machine.telescopes for a, b in (pair, pair[::-1])}
        self.pairs = self._pairs_of(parts)
        shapes, numbers = _numbered(parts, self.pairs)
        self.gaps = Gaps(machine.movement, shapes, numbers, machine.clearance, machine.size)
        self.proofs = self.gaps.prove(machine.used, work)
        self.shapes, self.numbers = shapes, numbers
        self.number = {pair: k for k, pair in enumerate(self.pairs)}
        self.strict = _Masks(self.proofs, machine, touching=True)
        self.tried, self.cut = 0, False
        # more layers than plates would leave one empty; heads need some of their own
        self.counts = range(1, asked.most + 1 if asked.heads else min(asked.most, len(self.plates)) + 1)

    def _pairs_of(self, parts: Sequence[_Part]) -> list[Pair]:
        """The pairs that may meet in a layer: not plates that a pin joins, nor a pin and what it joins."""
        never = {frozenset(pair) for pair in self.machine.telescopes}
        for pin, plates in self.joined.items():
            never |= {frozenset((a, b)) for a in plates for b in plates if a != b}
            never |= {frozenset((own, plate)) for own in (pin, _head(pin)) for plate in plates}
            never.add(frozenset((pin, _head(pin))))
        names = [part.name for part in parts]
        return [
            (one, other)
            for k, one in enumerate(names)
            for other in names[k + 1 :]
            if frozenset((one, other)) not in never
        ]

    def pair(self, one: str, other: str) -> int:
        """Number of a pair."""
        found = self.number.get((one, other))
        return self.number[other, one] if found is None else found

    # -- stacks -----------------------------------------------------------------------------------------------------

    def stacks(self, count: int, masks: _Masks, bound: _Bound) -> Iterator[tuple[Stack, int]]:
        """Stacks of a number of layers that the bound lets pass, with the masks of their collisions, layers rising."""
        boards = self.asked.boards
        options = [self._mounts(pin.name) for pin in self.machine.pins if pin.grounded and boards != "bar"]
        grounded = [pin.name for pin in self.machine.pins if pin.grounded and boards != "bar"]
        for layers in self._layers(count, masks, bound, {}, 0):
            self.work.check()
            for mounts in product(*options):
                if self.tried >= bound.most_looked or self.work.expired():
                    self.cut = True
                    return
                stack = self._stack(count, layers, dict(zip(grounded, mounts)))
                if stack is None:
                    continue
                self.tried += 1
                mask, found = 0, set()
                for pair in self._meeting(stack):
                    found.add(number := self.pair(*pair))
                    mask |= masks.by_pair[number]
                    if mask and not bound.lets_pass(mask):
                        break
                else:
                    if bound.lets_pass(mask):
                        yield replace(stack, pairs=tuple(sorted(found))), mask

    def _mounts(self, pin: str) -> tuple[str, ...]:
        given = self.asked.mounts.get(pin)
        if given is not None:
            return (given,)
        return {"below": (BELOW,), "above": (ABOVE,), "both": (BELOW, ABOVE, BOTH)}[self.asked.boards]

    def _open_to(self, plate: str, count: int) -> range:
        """Layers that a plate may lie in: beside a board there is none for the heads of a pin that moves with it."""
        boards = self.asked.boards
        moving = any(plate in pin.joins and not pin.grounded for pin in self.machine.pins)
        if not (self.asked.heads and moving):
            return range(1, count + 1)
        return range(1 + (boards in ("below", "both")), count + (boards not in ("above", "both")))

    def _layers(
        self, count: int, masks: _Masks, bound: _Bound, placed: dict[str, int], mask: int
    ) -> Iterator[dict[str, int]]:
        """Layers of all plates, where those placed so far and the pins between them do not exclude them."""
        if self.tried >= bound.most_looked:
            self.cut = True
            return
        if len(placed) == len(self.plates):
            yield dict(placed)
            return
        plate, left = self.plates[len(placed)], len(self.plates) - len(placed) - 1
        for layer in self._open_to(plate, count):
            if not self.asked.heads and count - len({layer, *placed.values()}) > left:
                continue  # a layer would stay empty
            if any(
                placed.get(other) == layer
                for plates in self.joined.values()
                if plate in plates
                for other in plates
                if other != plate
            ):
                continue
            partner = self.partner.get(plate)
            if partner in placed and placed[partner] != layer:
                continue
            more = mask
            for other, at in placed.items():
                if at == layer and other != partner:
                    more |= masks.by_pair[self.pair(other, plate)]
            placed[plate] = layer
            for pin, plates in self.joined.items():
                if plates <= placed.keys():
                    own = [placed[one] for one in plates]
                    for other, at in placed.items():
                        if min(own) <= at <= max(own) and other not in plates:
                            more |= masks.by_pair[self.pair(other, pin)]
            if bound.lets_pass(more):
                yield from self._layers(count, masks, bound, placed, more)
            else:
                self.tried += len(placed) == len(self.plates)
            del placed[plate]

    def _stack(self, count: int, layers: dict[str, int], mounts: dict[str, str]) -> Stack | None:
        """The stack of layers and mounts with the pairs that meet in it; None where a head has no place."""
        boards = self.asked.boards
        floor, roof = boards in ("below", "both"), boards in ("above", "both")
        pins: dict[str, tuple[int, int]] = {}
        heads: list[Head] = []
        for pin, plates in self.joined.items():
            own = [layers[one] for one in plates]
            mount = mounts.get(pin, "")
            low = 0 if mount in (BELOW, BOTH) else min(own)
            high = count + 1 if mount in (ABOVE, BOTH) else max(own)
            pins[pin] = low, high
            if self.asked.heads:
                heads += [Head(pin, BELOW, low - 1)] * (low > 0) + [Head(pin, ABOVE, high + 1)] * (high <= count)
        if self.asked.heads:
            if any((floor and one.layer < 1) or (roof and one.layer > count) for one in heads):
                return None
            # else the same stack stands among those of fewer layers
            filled = [*layers.values(), *(one.layer for one in heads)]
            lowest = min(filled) if floor else min(layers.values())
            highest = max(filled) if roof else max(layers.values())
            if lowest != 1 or highest != count:
                return None
        return Stack(count, dict(layers), mounts, pins, tuple(heads))

    def _meeting(self, stack: Stack) -> Iterator[Pair]:
        """Pairs that meet in a layer; some more than once."""
        for layer in range(stack.count + 2):
            plates = [name for name, own in stack.layers.items() if own == layer]
            yield from (pair for pair in combinations(plates, 2) if self.partner.get(pair[0]) != pair[1])
            inner = 1 <= layer <= stack.count
            through = [name for name, (low, high) in stack.pins.items() if inner and low <= layer <= high]
            bare = []
            for pin in through:
                joined = self.joined[pin]
                yield from ((plate, pin) for plate in plates if plate not in joined)
                if not joined.intersection(plates):
                    bare.append(pin)
            yield from combinations(bare, 2)
            for plate, pair in self.sliding:
                if plate in plates and pair <= set(through):
                    one, other = pair
                    yield one, other
            tops = [head.pin for head in stack.heads if head.layer == layer]
            for pin in tops:
                yield from ((plate, _head(pin)) for plate in plates)
                yield from ((other, _head(pin)) for other in bare if other != pin)
            yield from ((_head(a), _head(b)) for a, b in combinations(tops, 2) if a != b)

    # -- the answer -------------------------------------------------------------------------------------------------

    def answer(self) -> Arrangement:
        """The best stack with everything that is said of it."""
        loose = _Masks(self.proofs, self.machine, touching=False)
        for status, masks in (("free", self.strict), ("touching", loose)):
            if status == "touching" and masks.by_pair == self.strict.by_pair:
                continue
            self.tried, self.cut = 0, False
            for count in self.counts:
                free = [stack for stack, _ in self.stacks(count, masks, Free())]
                if free:
                    return self._told(status, *self._best(free), None, len(free) - 1, masks)
        looked, cut = self.tried, self.cut
        self.tried, longest = 0, _Longest(loose)
        best: Stack | None = None
        for count in self.counts:
            for stack, mask in self.stacks(count, loose, longest):
                best = stack
                longest.most = loose.longest(mask)[0]
        if best is None:
            self.work.go_on()  # else none was looked at
            raise FieldError(
                "/layers_most",
                f"plates on common pins{', with heads,' * self.asked.heads} need more than {self.asked.most} layers",
            )
        _, first, last = loose.longest(loose.of(best.pairs))
        free_part = None if first is None or last is None else Interval(first, last)
        best_known, self.cut = not self.cut, cut
        self.tried = max(self.tried, looked)
        return replace(self._told("blocked", best, None, free_part, 0, loose), best_known=best_known)

    def _best(self, free: Sequence[Stack]) -> tuple[Stack, tuple[Pair, Least] | None]:
        """The first by pins held on both sides, by length of pins, and by least gap."""
        order = min((-one.held, one.pin_length) for one in free)
        alike = [one for one in free if (-one.held, one.pin_length) == order]
        least = self.gaps.least(
            sorted({pair for one in alike for pair in one.pairs if self.proofs[pair].free}), self.machine.used
        )

        def smallest(stack: Stack) -> tuple[Pair, Least] | None:
            gaps = [(self.pairs[pair], least[pair]) for pair in stack.pairs if pair in least]
            return min(gaps, key=lambda one: one[1].gap, default=None)

        found = [(one, smallest(one)) for one in alike]
        step = _LEVEL * self.machine.size
        return min(found, key=lambda one: float("-inf") if one[1] is None else -round(one[1][1].gap / step))

    def _told(
        self,
        status: str,
        stack: Stack,
        least: tuple[Pair, Least] | None,
        free: Interval | None,
        others: int,
        masks: _Masks,
    ) -> Arrangement:
        tried, exhaustive = self.tried, not self.cut
        low, high = self._stops(stack, self.machine.used if status != "blocked" else free)
        fewer: dict[int, Collision | None] = {}
        if status != "blocked" and stack.count > 1:
            fewer[stack.count - 1] = self._why_not(stack.count - 1, masks)
        return Arrangement(
            status,
            stack,
            least,
            self._collisions(stack.pairs, "hits"),
            self._collisions(stack.pairs, "touches"),
            free,
            low,
            high,
            fewer,
            others,
            tried,
            {pin.name: self._shaft(pin.name) for pin in self.machine.pins if pin.grounded},
            exhaustive,
        )

    def _collisions(self, pairs: Sequence[int], what: str) -> tuple[Collision, ...]:
        """Collisions of pairs by crank angle, those on both sides of the seam of a turn as one."""
        found = []
        for pair in pairs:
            runs: list[Run] = list(getattr(self.proofs[pair], what))
            first, last = self.machine.used
            if self.machine.whole_turn and len(runs) > 1 and runs[0].first <= first and runs[-1].last >= last:
                runs = [*runs[1:-1], Run(runs[-1].first, runs[0].last + TURN)]
            found += [Collision(self.pairs[pair], *run) for run in runs]
        return tuple(sorted(found, key=lambda one: (one.first, one.last, one.pair)))

    def _why_not(self, count: int, masks: _Masks) -> Collision | None:
        """The collision that takes most of the motion from the best stack of so few layers."""
        self.tried = 0
        longest, best = _Longest(masks), None
        for stack, mask in self.stacks(count, masks, longest):
            best = stack
            longest.most = masks.longest(mask)[0]
        if best is None:
            return None
        return max(self._collisions(best.pairs, "hits"), key=lambda one: one.last - one.first, default=None)

    def _shaft(self, pin: str) -> Shaft:
        plates = [plate for plate in self.plates if plate not in self.joined[pin]]
        passes = self._collisions([self.pair(plate, pin) for plate in plates], "hits")
        return Shaft(not passes, passes)

    def _stops(self, stack: Stack, free: Interval | None) -> tuple[Stop | None, Stop | None]:
        """Where the stack collides next, a slit or the loop ends, below and above an interval over which it is free."""
        if free is None:
            return None, None
        loop, turn = self.machine.loop, TURN
        ends = self.machine.slit_ends
        if loop is None and None in ends:
            if free.last - free.first >= turn - WHOLE:
                return None, None
            runs = self._runs(stack, Interval(free.last, free.first + turn))
            if not runs:
                return None, None
            (pair, run), (last_pair, last_run) = min(runs, key=_begin), max(runs, key=_end)
            return Stop(last_run.last - turn, last_pair), Stop(run.first, pair)
        low, high = (
            Stop(*end) if end is not None else Stop(loop[k], None)  # type: ignore[index]
            for k, end in enumerate(ends)
        )
        if runs := self._runs(stack, Interval(low.at, free.first)):
            pair, run = max(runs, key=_end)
            low = Stop(run.last, pair)
        if runs := self._runs(stack, Interval(free.last, high.at)):
            pair, run = min(runs, key=_begin)
            high = Stop(run.first, pair)
        return low, high

    def _runs(self, stack: Stack, interval: Interval) -> list[tuple[Pair, Run]]:
        """Collisions of a stack's pairs over another interval."""
        if interval.last - interval.first < WHOLE or not stack.pairs:
            return []
        gaps = Gaps(
            self.machine.movement,
            self.shapes,
            [self.numbers[pair] for pair in stack.pairs],
            self.machine.clearance,
            self.machine.size,
        )
        proofs = gaps.prove(interval, self.work)
        return [(self.pairs[pair], run) for pair, proof in zip(stack.pairs, proofs) for run in proof.hits]


def _begin(one: tuple[Pair, Run]) -> float:
    return one[1].first


def _end(one: tuple[Pair, Run]) -> float:
    return one[1].last


def _head(pin: str) -> str:
    """Name of a pin's heads."""
    return f"head {pin}"


def _numbered(parts: Sequence[_Part], pairs: Sequence[Pair]) -> tuple[list[Carried], list[tuple[int, int]]]:
    """All shapes of parts, and each pair by two of them: on one body where there is one that both belong to."""
    shapes = [shape for part in parts for shape in part.shapes]
    first, count = {}, 0
    for part in parts:
        first[part.name] = range(count, count + len(part.shapes))
        count += len(part.shapes)
    found = []
    for one, other in pairs:
        both = list(product(first[one], first[other]))
        found.append(next((pair for pair in both if shapes[pair[0]].body == shapes[pair[1]].body), both[0]))
    return shapes, found


# -- parts of the motion as bits ----------------------------------------------------------------------------------------


class _Masks:
    """Collisions of pairs as bits of an integer: one for each place where any begins or ends, and one for each part between."""

    def __init__(self, proofs: Sequence[Proof], machine: Machine, touching: bool) -> None:
        runs = [[*proof.hits, *(proof.touches if touching else ())] for proof in proofs]
        first, last = machine.used
        self.points = sorted({first, last, *(end for own in runs for run in own for end in run)})
        at = {point: 2 * k for k, point in enumerate(self.points)}
        self.bits = 2 * len(self.points) - 1
        self.by_pair = [
            sum({1 << bit: 0 for run in own for bit in range(at[run.first], at[run.last] + 1)}) for own in runs
        ]
        self._whole = machine.whole_turn
        self.longest = cache(self._longest)

    def of(self, pairs: Sequence[int]) -> int:
        """Where any of some pairs collides."""
        mask = 0
        for pair in pairs:
            mask |= self.by_pair[pair]
        return mask

    def _longest(self, mask: int) -> tuple[float, float | None, float | None]:
        """The longest part of the motion without a bit: its length, and its ends; over the seam of a whole turn as one."""
        parts: list[tuple[float, float]] = []
        begin: float | None = None
        for bit in range(self.bits + 1):
            taken = bit == self.bits or bool(mask >> bit & 1)
            if not taken and begin is None:
                begin = self.points[bit // 2]
            if taken and begin is not None:
                parts.append((begin, self.points[min(bit, self.bits - 1) // 2 + (bit < self.bits and bit % 2)]))
                begin = None
        if self._whole and len(parts) > 1 and not mask & 1 and not mask >> (self.bits - 1) & 1:
            parts = [*parts[1:-1], (parts[-1][0], parts[0][1] + TURN)]
        if not parts:
            return 0.0, None, None
        first, last = max(parts, key=lambda part: part[1] - part[0])
        return last - first, first, last


class _Bound:
    """Whether a stack, or a part of one, is still of interest by where it collides; and how many are looked at, at most."""

    most_looked = MOST_LOOKED

    def lets_pass(self, mask: int) -> bool:
        """``mask``: collisions so far; more plates only add to them."""
        raise NotImplementedError


class Free(_Bound):
    """Those that collide nowhere."""

    def lets_pass(self, mask: int) -> bool:
        """Nothing may be added to a collision."""
        return mask == 0


class _Longest(_Bound):
    """Those that are free over a longer part of the motion than the best so far."""

    most_looked = MOST_BLOCKED

    def __init__(self, masks: _Masks) -> None:
        self.masks, self.most = masks, -1.0

    def lets_pass(self, mask: int) -> bool:
        """More collisions leave shorter parts."""
        return self.masks.longest(mask)[0] > self.most


# -- an envelope, and boxes that are kept free -------------------------------------------------------------------------


def outside(machine: Machine, envelope: Box | None, keep_out: Sequence[Box], work: Work) -> list[Collision]:
    """Where plates leave the envelope, or enter a box; boxes in the user's plane, named envelope, keep_out 1, keep_out 2, ...

    To 1e-5 of the machine's size. Law: with plates of no width these are the places where the lines of the links do so.
    """
    if envelope is None and not keep_out:
        return []
    walls: list[tuple[str, Shape]] = [
        (f"keep_out {number}", _wall(box, machine)) for number, box in enumerate(keep_out, 1)
    ]
    if envelope is not None:
        left, low, right, high = envelope
        # farther than any plate is from the ground's origin, or the envelope
        far = 4 * (machine.size + max(abs(end) for end in envelope) + abs(machine.origin) + machine.width)
        far += 4 * sum(plate.shape.reach for plate in machine.plates)
        sides = (
            (left - far, low - far, left, high + far),
            (right, low - far, right + far, high + far),
            (left - far, low - far, right + far, low),
            (left - far, high, right + far, high + far),
        )
        walls += [(ENVELOPE, _wall(side, machine)) for side in sides]
    shapes = [Carried(plate.body, plate.shape) for plate in machine.plates]
    plates = len(shapes)
    shapes += [Carried(GROUND, shape) for _, shape in walls]
    pairs = [(k, plates + n) for k in range(plates) for n in range(len(walls))]
    gaps = Gaps(machine.movement, shapes, pairs, machine.clearance, machine.size, rough=True)
    proofs = gaps.prove(machine.used, work)
    found = [
        Collision((walls[n - plates][0], machine.plates[k].name), *run)
        for (k, n), proof in zip(pairs, proofs)
        for run in proof.hits
    ]
    return sorted(found, key=lambda one: (one.first, one.last, one.pair))


def _wall(box: Box, machine: Machine) -> Shape:
    """A box in the ground's frame; walls need no clearance, which is therefore taken off."""
    left, low, right, high = box
    corners = complex(left, low), complex(right, low), complex(right, high), complex(left, high)
    return Shape(tuple(z - machine.origin for z in corners), -machine.clearance)


# -- parts -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """A part of one thickness.

    ``name``: of a plate its own (crank, coupler, rocker, body, bar); pin_D, post_P, head_D_below, board_below. ``body``: number
    of the body that carries it, in `Movement.names`; a pin goes with the first body that it belongs to. ``holes``: of plates and
    boards, with the pin that each is for; their diameter is that of the machine's holes, and so is the width of ``slits``.
    ``layers``: the lowest and the highest that it fills, 0 the board below. ``z``: its lower and upper face.
    """

    name: str
    kind: Literal["plate", "pin", "post", "head", "board"]
    body: int
    shape: Shape
    holes: tuple[Hole, ...]
    layers: tuple[int, int]
    z: tuple[float, float]
    slits: tuple[Slit, ...] = ()


class Heights(NamedTuple):
    """Thickness of the plates, and of the washers that keep two layers apart; both in the unit of the lengths."""

    thickness: float
    washer: float

    @classmethod
    def of(cls, machine: Machine, thickness: float | None = None, washer: float | None = None) -> Heights:
        """With the defaults for what is not given."""
        thick = THICKNESS * machine.hole if thickness is None else thickness
        return cls(thick, WASHER * thick if washer is None else washer)

    def z(self, low: int, high: int) -> tuple[float, float]:
        """The faces of what fills layers ``low`` to ``high``."""
        step = self.thickness + self.washer
        return (low - 1) * step, (high - 1) * step + self.thickness


def parts_of(machine: Machine, stack: Stack, heights: Heights) -> list[Part]:
    """The parts of a stack: plates, then pins and posts, heads and boards.

    Law: no two parts that fill a common layer and do not touch by design (a plate and its own pin) come nearer than the
    clearance, where the stack is free.
    """
    found = [
        Part(one.name, "plate", one.body, one.shape, one.holes, (layer, layer), heights.z(layer, layer), one.slits)
        for one in machine.plates
        for layer in (stack.layers[one.name],)
    ]
    pins = {pin.name: pin for pin in machine.pins}
    for name, (low, high) in stack.pins.items():
        pin, kind = pins[name], "post" if pins[name].post else "pin"
        found.append(_round(f"{kind}_{name}", kind, pin, pin.radius, low, high, heights))  # type: ignore[arg-type]
    for name, end, layer in stack.heads:
        found.append(
            _round(f"head_{name}_{end}", "head", pins[name], HEAD * pins[name].radius, layer, layer, heights)
        )
    grounded = [pin for pin in machine.pins if pin.grounded]
    outline = Shape(hull([pin.places[0].at for pin in grounded]), machine.width / 2)
    for name, layer in (("below", 0), ("above", stack.count + 1)):
        holes = tuple(
            Hole(pin.places[0].at, pin.name) for pin in grounded if name in stack.mounts.get(pin.name, "").split("+")
        )
        if holes:
            found.append(
                Part(f"board_{name}", "board", GROUND, outline, holes, (layer, layer), heights.z(layer, layer))
            )
    return found


def _round(
    name: str, kind: Literal["pin", "post", "head"], pin: Pin, radius: float, low: int, high: int, heights: Heights
) -> Part:
    body, at = pin.places[0]
    return Part(name, kind, body, disc(at, radius), (), (low, high), heights.z(low, high))
