"""Arrange plates in layers so that nothing collides, by a search over layers and over the mounting of fixed pins.

Layers are numbered from 1; board 0 lies below them, board N + 1 above. An arrangement satisfies these conditions:

1. Plates that a pin joins lie in different layers.
2. Plates in the same layer do not collide.
3. A pin fills the layers from its lowest to its highest plate, and a fixed pin also those up to its board. Plates in these layers
   that it does not join do not collide with it.
4. Two pins do not collide in a layer in which neither of them has a plate of its own, or in which one of them slides in a slit
   of a plate that both join.
5. A head fills another layer at each free end of a pin and lies in no board. Only with heads may a layer be empty.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, product
from typing import NamedTuple

from synthesis.assembly.gaps import CarriedShape, Gaps, MinimumGap, Proof, Run
from synthesis.assembly.machine import FULL_TURN_TOLERANCE, Machine, Stop
from synthesis.assembly.shapes import disc
from synthesis.errors import FieldError
from synthesis.target import TURN, Interval
from synthesis.work import Work

HEAD = 1.8
"""Ratio of the diameters of a head and its pin."""
BELOW, ABOVE, BOTH = "below", "above", "below+above"
BOARDS = ("below", "above", "both", "bar")
MAX_STACKS = 40_000
"""Number of arrangements that are searched for free arrangements, which takes a few seconds."""
MAX_BLOCKED_STACKS = 4_000
"""Number of arrangements that are searched for the best if none is free."""
_LEVEL = 1e-9
"""Difference of smallest gaps that counts as equal, as a fraction of the size."""
Pair = tuple[str, str]


class Head(NamedTuple):
    """A head of a pin and the layer that it fills."""

    pin: str
    end: str
    """``below`` or ``above``."""
    layer: int


@dataclass(frozen=True)
class Stack:
    """Layers of plates and mounting of each fixed pin, with the layers that pins and heads fill."""

    count: int
    layers: dict[str, int]
    mounts: dict[str, str]
    pins: dict[str, tuple[int, int]]
    heads: tuple[Head, ...]
    pairs: tuple[int, ...] = ()
    """Indices of the pairs that meet in a layer."""


class Collision(NamedTuple):
    """Two parts and the crank angles over which they collide; beyond the end of a whole turn if the range contains the seam."""

    pair: Pair
    first: float
    last: float


@dataclass(frozen=True)
class Arrangement:
    """The best stack with its collisions, its smallest gap and the ends of its motion."""

    status: str
    """``free``, ``touching`` or ``blocked``."""
    stack: Stack
    min_gap: tuple[Pair, MinimumGap] | None
    """Smallest gap of all pairs that meet; None if no pairs meet or the stack is not free."""
    collisions: tuple[Collision, ...]
    touches: tuple[Collision, ...]
    free: Interval | None
    """Longest part of the used interval over which a blocked stack is free."""
    low: Stop | None
    high: Stop | None
    fewer: dict[int, Collision | None]
    """Collision that prevents a stack with a layer less; None if no such stack exists."""
    alternatives: int
    """Number of further free stacks with the same number of layers."""
    tried: int
    passes: dict[str, tuple[Collision, ...]]
    """Collisions of plates with a shaft through all layers at each fixed pivot; empty if both sides can hold it."""
    exhaustive: bool = True
    """True if all arrangements with this number of layers, and for a blocked stack with all allowed numbers, were searched."""
    best_known: bool = True
    """For a blocked stack, true if it is the best of all, not only of the searched stacks."""


class StackRequest(NamedTuple):
    """Requirements of an assembly."""

    boards: str = "below"
    heads: bool = False
    max_layers: int = 6
    mounts: Mapping[str, str] = {}
    """Required mounting of some fixed pins."""


def arrange(machine: Machine, request: StackRequest, work: Work) -> Arrangement:
    """Return the best stack of a machine's plates.

    A free stack with the fewest layers is the best, or otherwise a stack that is free over the longest part of the motion.
    Among free stacks with the same number of layers, more pins held on both sides come first, then shorter pins, then a larger
    smallest gap.
    """
    return StackSearch(machine, request, work).solve()


class StackSearch:
    """Parts of a machine, proofs for their pairs, and the search for a stack."""

    def __init__(self, machine: Machine, request: StackRequest, work: Work) -> None:
        self.machine, self.request, self.work = machine, request, work
        self.plates = [part.name for part in machine.plates]
        self.joined = {pin.name: frozenset(pin.joins) for pin in machine.pins}
        # a pin that slides in a plate may meet the others of that plate
        self.sliding = {
            (plate.name, frozenset((slit.pin, pin.name)))
            for plate in machine.plates
            for slit in plate.slits
            for pin in machine.pins
            if plate.name in pin.joins and pin.name != slit.pin
        }
        # each part has its shape on each body that it belongs to
        parts = {plate.name: [CarriedShape(plate.body, plate.shape)] for plate in machine.plates}
        rounds = [(pin.name, pin.radius, pin.points) for pin in machine.pins]
        rounds += [(_head(name), HEAD * radius, points) for name, radius, points in rounds if request.heads]
        for name, radius, points in rounds:
            parts[name] = [CarriedShape(at.body, disc(at.at, radius)) for at in points]
        self.partner = {a: b for pair in machine.telescopes for a, b in (pair, pair[::-1])}
        self.pairs = self._pairs_of(list(parts))
        self.carried = [_on_same_body(parts[first], parts[second]) for first, second in self.pairs]
        self.gaps = Gaps(machine.movement, self.carried, machine.clearance, machine.size)
        self.proofs = self.gaps.prove(machine.used, work)
        self.number = {pair: k for k, pair in enumerate(self.pairs)}
        self.strict = _Masks(self.proofs, machine, touching=True)
        self.tried, self.cut = 0, False
        # with more layers than plates a layer would stay empty; heads need layers of their own
        self.counts = range(
            1, request.max_layers + 1 if request.heads else min(request.max_layers, len(self.plates)) + 1
        )

    def _pairs_of(self, names: Sequence[str]) -> list[Pair]:
        """Return the pairs that may meet in a layer, without plates that a pin joins and without a pin and its plates."""
        never = {frozenset(pair) for pair in self.machine.telescopes}
        for pin, plates in self.joined.items():
            never |= {frozenset((a, b)) for a in plates for b in plates if a != b}
            never |= {frozenset((part, plate)) for part in (pin, _head(pin)) for plate in plates}
            never.add(frozenset((pin, _head(pin))))
        return [pair for pair in combinations(names, 2) if frozenset(pair) not in never]

    def pair(self, first: str, second: str) -> int:
        """Return the index of a pair."""
        found = self.number.get((first, second))
        return self.number[second, first] if found is None else found

    # -- stacks -----------------------------------------------------------------------------------------------------

    def stacks(
        self, count: int, masks: _Masks, passes: Callable[[int], bool], limit: int
    ) -> Iterator[tuple[Stack, int]]:
        """Yield the stacks with some number of layers, and the masks of their collisions.

        ``passes`` checks the collisions of a part of a stack: further plates can only add collisions. At most ``limit`` stacks
        are examined.
        """
        boards = self.request.boards
        options = [self._mounts(pin.name) for pin in self.machine.pins if pin.grounded and boards != "bar"]
        grounded = [pin.name for pin in self.machine.pins if pin.grounded and boards != "bar"]
        for layers in self._layers(count, masks, passes, limit, {}, 0):
            self.work.check()
            for mounts in product(*options):
                if self.tried >= limit or self.work.expired():
                    self.cut = True
                    return
                stack = self._stack(count, layers, dict(zip(grounded, mounts)))
                if stack is None:
                    continue
                self.tried += 1
                mask, numbers = 0, set()
                for pair in self._meeting(stack):
                    numbers.add(number := self.pair(*pair))
                    mask |= masks.by_pair[number]
                    if mask and not passes(mask):
                        break
                else:
                    if passes(mask):
                        yield replace(stack, pairs=tuple(sorted(numbers))), mask

    def _mounts(self, pin: str) -> tuple[str, ...]:
        mount = self.request.mounts.get(pin)
        if mount is not None:
            return (mount,)
        return {"below": (BELOW,), "above": (ABOVE,), "both": (BELOW, ABOVE, BOTH)}[self.request.boards]

    def _open_to(self, plate: str, count: int) -> range:
        """Return the layers of a plate; next to a board there is no room for the head of a pin that moves with the plate."""
        boards = self.request.boards
        moving = any(plate in pin.joins and not pin.grounded for pin in self.machine.pins)
        if not (self.request.heads and moving):
            return range(1, count + 1)
        return range(1 + (boards in ("below", "both")), count + (boards not in ("above", "both")))

    def _layers(
        self,
        count: int,
        masks: _Masks,
        passes: Callable[[int], bool],
        limit: int,
        assigned: dict[str, int],
        mask: int,
    ) -> Iterator[dict[str, int]]:
        """Yield the layers of all plates that are consistent with the plates assigned so far and the pins between them."""
        if self.tried >= limit:
            self.cut = True
            return
        if len(assigned) == len(self.plates):
            yield dict(assigned)
            return
        plate, remaining = self.plates[len(assigned)], len(self.plates) - len(assigned) - 1
        for layer in self._open_to(plate, count):
            if not self.request.heads and count - len({layer, *assigned.values()}) > remaining:
                continue  # a layer would stay empty
            if any(
                assigned.get(neighbour) == layer
                for plates in self.joined.values()
                if plate in plates
                for neighbour in plates
                if neighbour != plate
            ):
                continue
            partner = self.partner.get(plate)
            if partner in assigned and assigned[partner] != layer:
                continue
            combined = mask
            for neighbour, level in assigned.items():
                if level == layer and neighbour != partner:
                    combined |= masks.by_pair[self.pair(neighbour, plate)]
            assigned[plate] = layer
            for pin, plates in self.joined.items():
                if plates <= assigned.keys():
                    layers_of_pin = [assigned[joined] for joined in plates]
                    for neighbour, level in assigned.items():
                        if min(layers_of_pin) <= level <= max(layers_of_pin) and neighbour not in plates:
                            combined |= masks.by_pair[self.pair(neighbour, pin)]
            if passes(combined):
                yield from self._layers(count, masks, passes, limit, assigned, combined)
            else:
                self.tried += len(assigned) == len(self.plates)
            del assigned[plate]

    def _stack(self, count: int, layers: dict[str, int], mounts: dict[str, str]) -> Stack | None:
        """Return the stack with these layers and mounts; None if there is no room for a head."""
        boards = self.request.boards
        floor, roof = boards in ("below", "both"), boards in ("above", "both")
        pins: dict[str, tuple[int, int]] = {}
        heads: list[Head] = []
        for pin, plates in self.joined.items():
            own_layers = [layers[plate] for plate in plates]
            mount = mounts.get(pin, "")
            low = 0 if mount in (BELOW, BOTH) else min(own_layers)
            high = count + 1 if mount in (ABOVE, BOTH) else max(own_layers)
            pins[pin] = low, high
            if self.request.heads:
                heads += [Head(pin, BELOW, low - 1)] * (low > 0) + [Head(pin, ABOVE, high + 1)] * (high <= count)
        if self.request.heads:
            if any((floor and head.layer < 1) or (roof and head.layer > count) for head in heads):
                return None
            # otherwise the same stack occurs among the stacks with fewer layers
            filled = [*layers.values(), *(head.layer for head in heads)]
            lowest = min(filled) if floor else min(layers.values())
            highest = max(filled) if roof else max(layers.values())
            if lowest != 1 or highest != count:
                return None
        return Stack(count, dict(layers), mounts, pins, tuple(heads))

    def _meeting(self, stack: Stack) -> Iterator[Pair]:
        """Yield the pairs that meet in a layer, possibly several times."""
        for layer in range(stack.count + 2):
            plates = [name for name, level in stack.layers.items() if level == layer]
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
                    first, second = pair
                    yield first, second
            tops = [head.pin for head in stack.heads if head.layer == layer]
            for pin in tops:
                yield from ((plate, _head(pin)) for plate in plates)
                yield from ((second, _head(pin)) for second in bare if second != pin)
            yield from ((_head(a), _head(b)) for a, b in combinations(tops, 2) if a != b)

    # -- the answer -------------------------------------------------------------------------------------------------

    def solve(self) -> Arrangement:
        """Return the best stack with all results."""
        loose = _Masks(self.proofs, self.machine, touching=False)
        for status, masks in (("free", self.strict), ("touching", loose)):
            if status == "touching" and masks.by_pair == self.strict.by_pair:
                continue
            self.tried, self.cut = 0, False
            for count in self.counts:
                free = [stack for stack, _ in self.stacks(count, masks, lambda mask: mask == 0, MAX_STACKS)]
                if free:
                    return self._arrangement(status, *self._best(free), None, len(free) - 1, masks)
        tried, was_cut = self.tried, self.cut
        best = self._longest_free(self.counts, loose)
        if best is None:
            self.work.go_on()  # else none was looked at
            raise FieldError(
                "/layers_max",
                f"must be larger: plates on common pins{', with pin heads,' * self.request.heads} need more than "
                f"{self.request.max_layers} layers",
            )
        _, first, last = loose.longest(loose.of(best.pairs))
        free_part = None if first is None or last is None else Interval(first, last)
        best_known, self.cut = not self.cut, was_cut
        self.tried = max(self.tried, tried)
        return replace(self._arrangement("blocked", best, None, free_part, 0, loose), best_known=best_known)

    def _longest_free(self, counts: Sequence[int], masks: _Masks) -> Stack | None:
        """Return the stack with some number of layers that is free over the longest part of the motion."""
        self.tried = 0
        best, longest = None, -1.0

        def improves(mask: int) -> bool:
            return masks.longest(mask)[0] > longest

        for count in counts:
            for stack, mask in self.stacks(count, masks, improves, MAX_BLOCKED_STACKS):
                best, longest = stack, masks.longest(mask)[0]
        return best

    def _best(self, free: Sequence[Stack]) -> tuple[Stack, tuple[Pair, MinimumGap] | None]:
        """Return the best free stack by pins held on both sides, length of pins and smallest gap."""
        ranks = [
            (-[*stack.mounts.values()].count(BOTH), sum(high - low for low, high in stack.pins.values()))
            for stack in free
        ]
        best_rank = min(ranks)
        equal = [stack for stack, rank in zip(free, ranks) if rank == best_rank]
        met = {pair for stack in equal for pair in stack.pairs if self.proofs[pair].free}
        min_gaps = self.gaps.minimum_gaps(sorted(met))

        def smallest(stack: Stack) -> tuple[Pair, MinimumGap] | None:
            gaps = [(self.pairs[pair], min_gaps[pair]) for pair in stack.pairs if pair in min_gaps]
            return min(gaps, key=lambda entry: entry[1].gap, default=None)

        candidates = [(stack, smallest(stack)) for stack in equal]
        step = _LEVEL * self.machine.size
        return min(
            candidates, key=lambda entry: float("-inf") if entry[1] is None else -round(entry[1][1].gap / step)
        )

    def _arrangement(
        self,
        status: str,
        stack: Stack,
        min_gap: tuple[Pair, MinimumGap] | None,
        free: Interval | None,
        alternatives: int,
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
            min_gap,
            self._collisions(stack.pairs, "hits"),
            self._collisions(stack.pairs, "touches"),
            free,
            low,
            high,
            fewer,
            alternatives,
            tried,
            {pin.name: self._passes(pin.name) for pin in self.machine.pins if pin.grounded},
            exhaustive,
        )

    def _collisions(self, pairs: Sequence[int], kind: str) -> tuple[Collision, ...]:
        """Return the collisions of pairs by crank angle; collisions on both sides of the seam of a turn are merged."""
        found = []
        for pair in pairs:
            runs: list[Run] = list(getattr(self.proofs[pair], kind))
            first, last = self.machine.used
            if self.machine.whole_turn and len(runs) > 1 and runs[0].first <= first and runs[-1].last >= last:
                runs = [*runs[1:-1], Run(runs[-1].first, runs[0].last + TURN)]
            found += [Collision(self.pairs[pair], *run) for run in runs]
        return tuple(sorted(found, key=lambda collision: (collision.first, collision.last, collision.pair)))

    def _why_not(self, count: int, masks: _Masks) -> Collision | None:
        """Return the longest collision of the best stack with some number of layers."""
        best = self._longest_free([count], masks)
        found = () if best is None else self._collisions(best.pairs, "hits")
        return max(found, key=lambda collision: collision.last - collision.first, default=None)

    def _passes(self, pin: str) -> tuple[Collision, ...]:
        plates = [plate for plate in self.plates if plate not in self.joined[pin]]
        return self._collisions([self.pair(plate, pin) for plate in plates], "hits")

    def _stops(self, stack: Stack, free: Interval | None) -> tuple[Stop | None, Stop | None]:
        """Return the ends of the motion below and above an interval over which the stack is free."""
        if free is None:
            return None, None
        loop, ends = self.machine.loop, self.machine.slit_ends
        if loop is None and None in ends:
            if free.last - free.first >= TURN - FULL_TURN_TOLERANCE:
                return None, None
            runs = self._beyond(stack, Interval(free.last, free.first + TURN))
            if not runs:
                return None, None
            first, last = runs[0], max(runs, key=lambda run: run.last)
            return Stop(last.last - TURN, last.pair), Stop(first.first, first.pair)
        low, high = (
            Stop(loop[k], None) if end is None else end  # type: ignore[index]
            for k, end in enumerate(ends)
        )
        if runs := self._beyond(stack, Interval(low.at, free.first)):
            run = max(runs, key=lambda run: run.last)
            low = Stop(run.last, run.pair)
        if runs := self._beyond(stack, Interval(free.last, high.at)):
            high = Stop(runs[0].first, runs[0].pair)
        return low, high

    def _beyond(self, stack: Stack, interval: Interval) -> list[Collision]:
        """Return the collisions of a stack's pairs over another interval, the first collision first."""
        if interval.last - interval.first < FULL_TURN_TOLERANCE or not stack.pairs:
            return []
        carried = [self.carried[pair] for pair in stack.pairs]
        proofs = Gaps(self.machine.movement, carried, self.machine.clearance, self.machine.size).prove(
            interval, self.work
        )
        found = [Collision(self.pairs[pair], *run) for pair, proof in zip(stack.pairs, proofs) for run in proof.hits]
        return sorted(found, key=lambda collision: collision.first)


def _head(pin: str) -> str:
    """Return the name of a pin's heads."""
    return f"head {pin}"


def _on_same_body(first: Sequence[CarriedShape], second: Sequence[CarriedShape]) -> tuple[CarriedShape, CarriedShape]:
    """Return a shape of each part, on the same body if possible."""
    options = list(product(first, second))
    return next((pair for pair in options if pair[0].body == pair[1].body), options[0])


class _Masks:
    """Collisions of pairs as bits of an integer, with a bit for each end of a collision and for each range between two ends."""

    def __init__(self, proofs: Sequence[Proof], machine: Machine, touching: bool) -> None:
        runs = [[*proof.hits, *(proof.touches if touching else ())] for proof in proofs]
        first, last = machine.used
        self.points = sorted({first, last, *(end for pair_runs in runs for run in pair_runs for end in run)})
        at = {point: 2 * k for k, point in enumerate(self.points)}
        self.bits = 2 * len(self.points) - 1
        self.by_pair = [
            sum({1 << bit: 0 for run in pair_runs for bit in range(at[run.first], at[run.last] + 1)})
            for pair_runs in runs
        ]
        self._whole = machine.whole_turn
        self.longest = cache(self._longest)

    def of(self, pairs: Sequence[int]) -> int:
        """Return the bits in which any of some pairs collides."""
        mask = 0
        for pair in pairs:
            mask |= self.by_pair[pair]
        return mask

    def _longest(self, mask: int) -> tuple[float, float | None, float | None]:
        """Return the length and the ends of the longest range without a bit; ranges at the seam of a turn are merged."""
        parts: list[tuple[float, float]] = []
        start: float | None = None
        for bit in range(self.bits + 1):
            occupied = bit == self.bits or bool(mask >> bit & 1)
            if not occupied and start is None:
                start = self.points[bit // 2]
            if occupied and start is not None:
                parts.append((start, self.points[min(bit, self.bits - 1) // 2 + (bit < self.bits and bit % 2)]))
                start = None
        if self._whole and len(parts) > 1 and not mask & 1 and not mask >> (self.bits - 1) & 1:
            parts = [*parts[1:-1], (parts[-1][0], parts[0][1] + TURN)]
        if not parts:
            return 0.0, None, None
        first, last = max(parts, key=lambda part: part[1] - part[0])
        return last - first, first, last
