"""Search for springs of a catalogue that leave the smallest root mean square torque to the drive.

A spring of length l pulls with ``preload + stiffness (l - free_length)``; a gas spring's pull is negative. The drive gives the
torque of the load and stretches the spring besides: ``T + F(l) dl/dphi``. The ends of the springs are sought on a grid, then by a
descent with exact derivatives within boxes, at a distance from the pivots and with every length in the spring's range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.leverage import lengths_and_arms, leverage_derivatives
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.max_min import solve_sqp
from synthesis.drives.placement_search import grid_of
from synthesis.drives.springs import (
    Behaviour,
    Between,
    MountedSprings,
    Spring,
    SpringRegion,
    SpringRow,
    mount_springs,
    rms_of,
)
from synthesis.work import Work


@dataclass(frozen=True)
class SpringSearchOptions:
    """Options of the search for springs of a catalogue."""

    grid: int = 12
    """Number of grid points of a box in each direction."""
    directions: int = 12
    """Number of directions of grid points on a link."""
    radii: tuple[float, ...] = (0.3, 0.6, 0.95)
    """Distances of grid points on a link, as fractions of its reach."""
    descents: int = 4
    """Number of descents for each row of the catalogue on each pair of links."""
    rows: int = 6
    """Number of rows, the best of all pairs of links, for which descents are made."""
    rows_per_pair: int = 2
    """Number of rows of each pair of links for which descents are made."""
    behaviour_descents: int = 24
    """Number of descents for a row and a pair of links if a behaviour is required, which few placements show."""
    violation_cost: float = 1e3
    """Cost on the grid of a violated behaviour, per fraction of the rms torque without springs or of the longest length."""
    rounds: int = 2
    """Number of rounds in which springs are placed in turn before they are placed together."""
    max_steps: int = 500
    """Largest number of steps of a descent."""
    range_slack: float = 0.2
    """Fraction of the longest length by which a grid placement may leave the range of lengths at the start of a descent."""
    digits: int = 9
    """Decimal digits of the cost on the grid; placements of equal cost keep their order."""
    gain: float = 1e-6
    """Smallest relative decrease of the rms torque that counts as an improvement."""


OPTIONS = SpringSearchOptions()
_TOLERANCE = 1e-6
"""Margin of lengths inside their range at the positions of the search, as a fraction of the longest length."""


class _Start(NamedTuple):
    """A row of the catalogue on a pair of links, with placements of the grid at which descents begin."""

    cost: float
    between: Between
    kind: SpringRow
    ends: list[tuple[complex, complex]]


def best_spring(
    machine: LinkMotions,
    torque: Floats,
    betweens: Sequence[Between],
    kinds: list[SpringRow],
    room: SpringRegion,
    work: Work | None = None,
    behaviour: Behaviour | None = None,
    options: SpringSearchOptions = OPTIONS,
) -> MountedSprings | str:
    """Find the spring of a catalogue, the pair of links and its ends that leave the least rms torque.

    Parameters
    ----------
    machine : LinkMotions
    torque : ndarray, shape (n,)
        What the drive gives without the spring.
    betweens : sequence of pairs of str
        Pairs of links to try.
    kinds : list of SpringRow
        The catalogue.
    room : Room
        Where the ends may be.
    work : Work, optional
        The search returns the best known placement once its time is up.
    behaviour : Behaviour, optional
        Limits on the torque that remains; placements that satisfy them come before all others.

    Returns
    -------
    Fitted or str
        The spring, or a sentence with the reason why no row fits.
    """
    starts: list[_Start] = []
    nearest: tuple[float, float, float, Between] | None = None
    for between in betweens:
        if starts and work is not None and work.expired():
            break
        candidates, spread = _screen(machine, torque, between, kinds, room, behaviour, options)
        starts += candidates
        if nearest is None or spread[0] < nearest[0]:
            nearest = (*spread, between)
    if not starts:
        assert nearest is not None
        change, low, high, (first, second) = nearest
        where = f" between {first} and {second}" if len(betweens) == 1 else " between any two links"
        return (
            f"no spring of {len(kinds)} fits{where}: the smallest change of length there is {change:.4g}, "
            f"and lengths range from {low:.4g} to {high:.4g}"
        )
    best: tuple[tuple[float, float, float], Between, SpringRow, complex, complex] | None = None
    for start in _promising(starts, options):
        problem = _SpringProblem(machine, start.between, start.kind, room)
        for ends in start.ends:
            if work is not None and work.expired() and best is not None:
                break
            rank, z = _descend([problem], torque, problem.start(*ends), behaviour, options)
            if best is None or rank < (*best[0][:2], best[0][2] * (1 - options.gain)):
                best = (rank, start.between, start.kind, *problem.ends(z))
    assert best is not None
    if best[0][0] > 0:  # no spring fits and behaves: the best fit shows the deficit
        return best_spring(machine, torque, betweens, kinds, room, work, options=options)
    _, between, kind, ground, pin = best
    spring = Spring(between, (ground, pin), kind.stiffness, kind.free_length, kind.preload)
    return mount_springs(machine, torque, [_in_link_frame(machine, spring)], [kind])


def _promising(starts: list[_Start], options: SpringSearchOptions) -> list[_Start]:
    """Return the starts with the lowest cost of all, and the best starts of each pair of links."""
    starts = sorted(starts, key=lambda start: start.cost)
    chosen = {id(start) for start in starts[: options.rows]}
    for between in {start.between for start in starts}:
        chosen |= {
            id(start) for start in [start for start in starts if start.between == between][: options.rows_per_pair]
        }
    return [start for start in starts if id(start) in chosen]


def _screen(
    machine: LinkMotions,
    torque: Floats,
    between: Between,
    kinds: list[SpringRow],
    room: SpringRegion,
    behaviour: Behaviour | None,
    options: SpringSearchOptions,
) -> tuple[list[_Start], tuple[float, float, float]]:
    """Evaluate the rows of a catalogue on a grid of placements on two links.

    The torque of a spring is linear in its stiffness and its force at length 0, so that sums over the motion are made once for
    all rows.

    Returns
    -------
    starts : list of _Start
        The rows that fit somewhere.
    spread : tuple of float
        Smallest change of length on the grid, and the smallest and the largest length.
    """
    first, second = between
    grounds, pins = _grid(machine, first, second, room, options)
    if not grounds.size:
        return [], (np.inf, 0.0, 0.0)
    length, arm = lengths_and_arms(machine.seen(second, first), 0j, grounds, pins)
    shortest, longest = length.min(axis=1), length.max(axis=1)
    pull = length * arm
    square_sum = float(np.dot(torque, torque)) or 1.0
    by_arm, by_pull = arm @ torque, pull @ torque
    arms, pulls, products = (np.einsum("mn,mn->m", a, b) for a, b in ((arm, arm), (pull, pull), (arm, pull)))
    starts = []
    for kind in kinds:
        fits = (shortest >= kind.shortest) & (longest <= kind.longest)
        a, k = kind.offset, kind.stiffness
        square = square_sum + a * a * arms + k * k * pulls + 2 * (a * by_arm + k * by_pull + a * k * products)
        if behaviour is None:
            usable = np.flatnonzero(fits)
            cost = square[usable] / square_sum
        else:
            # few placements show the behaviour, and a descent moves other placements into the range of lengths
            beyond = np.maximum(kind.shortest - shortest, longest - kind.longest)
            usable = np.flatnonzero(beyond < options.range_slack * kind.longest)
            remaining = torque + a * arm[usable] + k * pull[usable]
            violations = behaviour.violation(remaining) / np.sqrt(square_sum / torque.size)
            violations = violations + np.maximum(beyond[usable], 0.0) / kind.longest
            cost = square[usable] / square_sum + options.violation_cost * violations
        if not usable.size:
            continue
        # of equal placements the first, whatever rounding makes of them
        cost = np.round(cost, options.digits)
        order = usable[np.argsort(cost, kind="stable")]
        if behaviour is not None:
            order = order[np.sort(np.unique(grounds[order], return_index=True)[1])]
        order = order[: options.descents if behaviour is None else options.behaviour_descents]
        ends = [(complex(grounds[m]), complex(pins[m])) for m in order]
        starts.append(_Start(float(cost.min()), between, kind, ends))
    return starts, (float((longest - shortest).min()), float(shortest.min()), float(longest.max()))


def _in_link_frame(machine: LinkMotions, spring: Spring) -> Spring:
    """Return a spring with its first end in its link's frame instead of the plane at the first sample."""
    return replace(spring, points=(machine.point_on(spring.between[0], spring.points[0]), spring.points[1]))


def _grid(
    machine: LinkMotions, first: str, second: str, room: SpringRegion, options: SpringSearchOptions
) -> tuple[Complexes, Complexes]:
    """Return all pairs of first ends, in the plane at the first sample, and points of the second link."""
    angles = np.exp(1j * np.linspace(0, 2 * np.pi, options.directions, endpoint=False))
    around = (np.maximum(np.array(options.radii) * room.reach, room.clear)[:, None] * angles).ravel()
    if first == GROUND:
        grounds = grid_of(room.box, options.grid)
        for pivot in _pivots(machine):
            grounds = grounds[np.abs(grounds - pivot) >= room.clear]
    else:
        link = machine.link(first)
        grounds = link.origin[0] + link.direction[0] * around
    return np.repeat(grounds, around.size), np.tile(around, grounds.size)


def _pivots(machine: LinkMotions) -> list[complex]:
    return [link.pivot for link in machine.links.values() if link.pivot is not None]


class _SpringProblem:
    """Lengths and torque of a spring, with exact derivatives by its four unknowns: the coordinates of its ends over the size."""

    def __init__(self, machine: LinkMotions, between: tuple[str, str], kind: SpringRow, room: SpringRegion) -> None:
        first, second = between
        self.link, self.kind, self.room = machine.seen(second, first), kind, room
        left, bottom, right, top = room.box
        self.size = max(right - left, top - bottom, room.reach)
        self.origin = None if first == GROUND else complex(machine.link(first).origin[0])
        self.centres = _pivots(machine) if self.origin is None else [self.origin]
        self.low, self.high = kind.shortest + _TOLERANCE * kind.longest, kind.longest * (1 - _TOLERANCE)
        free: list[tuple[float | None, float | None]] = [(None, None)] * 2
        box: list[tuple[float | None, float | None]] = [
            (left / self.size, right / self.size),
            (bottom / self.size, top / self.size),
        ]
        self.bounds = (box if self.origin is None else free) + free

    def ends(self, z: Floats) -> tuple[complex, complex]:
        return complex(z[0], z[1]) * self.size, complex(z[2], z[3]) * self.size

    def start(self, ground: complex, pin: complex) -> Floats:
        return np.array([ground.real, ground.imag, pin.real, pin.imag]) / self.size

    def torque(self, z: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the length and its derivatives (n, 4), and the torque and its derivatives (n, 4)."""
        first, second = self.ends(z)
        link, size, kind = self.link, self.size, self.kind
        v = link.position(second) - first
        length = np.maximum(np.abs(v), 1e-12 * size)
        along = v / length
        speed = link.speed(second)
        arm = np.real(np.conj(along) * speed)
        change, arms = leverage_derivatives(link, along, length, speed, size)
        force = kind.preload + kind.stiffness * (length - kind.free_length)
        return length, change, force * arm, kind.stiffness * change * arm[:, None] + force[:, None] * arms

    def rows(self, z: Floats) -> tuple[Floats, Floats]:
        """Return values that must not be negative, for lengths and squared distances, and their derivatives."""
        length, change, _, _ = self.torque(z)
        first, second = self.ends(z)
        room, size = self.room, self.size
        clear, reach = room.clear**2, room.reach**2
        distances = [abs(second) ** 2 - clear, reach - abs(second) ** 2]
        slopes = [[0, 0, second.real, second.imag], [0, 0, -second.real, -second.imag]]
        for centre in self.centres:
            offset = first - centre
            distances.append(abs(offset) ** 2 - clear)
            slopes.append([offset.real, offset.imag, 0, 0])
            if self.origin is not None:
                distances.append(reach - abs(offset) ** 2)
                slopes.append([-offset.real, -offset.imag, 0, 0])
        values = [(length - self.low) / size, (self.high - length) / size, np.array(distances) / size**2]
        return np.concatenate(values), np.concatenate([change / size, -change / size, 2 * np.array(slopes) / size])


def _descend(
    problems: list[_SpringProblem],
    torque: Floats,
    start: Floats,
    behaviour: Behaviour | None,
    options: SpringSearchOptions,
) -> tuple[tuple[float, float, float], Floats]:
    """Descend to the nearest optimum of some springs together.

    Returns
    -------
    rank : tuple of float
        Violations of the ranges of lengths and places, and of the behaviour, 0 within rounding; then the rms torque that remains.
    z : ndarray
        The unknowns, four per spring; ``begin`` where the descent ended with a higher rank.
    """
    rms = float(np.sqrt(np.mean(torque**2))) or 1.0
    four = [slice(4 * k, 4 * k + 4) for k in range(len(problems))]

    def cost(z: Floats) -> tuple[float, Floats]:
        evaluations = [problem.torque(z[own]) for problem, own in zip(problems, four)]
        remaining = (torque + sum(evaluation[2] for evaluation in evaluations)) / rms
        slopes = np.concatenate([evaluation[3] for evaluation in evaluations], axis=1) / rms
        return float(np.mean(remaining**2)), np.asarray(2 * remaining @ slopes / remaining.size)

    def rows(z: Floats) -> Floats:
        return np.concatenate([problem.rows(z[own])[0] for problem, own in zip(problems, four)])

    def left_of(z: Floats) -> Floats:
        return np.asarray(torque + sum(problem.torque(z[own])[2] for problem, own in zip(problems, four)))

    def slopes(z: Floats) -> Floats:
        evaluations = [problem.rows(z[own])[1] for problem, own in zip(problems, four)]
        table = np.zeros((sum(len(block) for block in evaluations), z.size))
        row = 0
        for block, own in zip(evaluations, four):
            table[row : row + len(block), own] = block
            row += len(block)
        return table

    def behaviour_rows(z: Floats) -> Floats:
        assert behaviour is not None
        return behaviour.rows(left_of(z)) / rms

    def behaviour_slopes(z: Floats) -> Floats:
        assert behaviour is not None
        evaluations = [problem.torque(z[own])[3] for problem, own in zip(problems, four)]
        return behaviour.slopes(np.concatenate(evaluations, axis=1)) / rms

    def rank(z: Floats) -> tuple[float, float, float]:
        excess = max(-float(rows(z).min()), 0.0)
        violation = 0.0 if behaviour is None else float(behaviour.violation(left_of(z))) / rms
        return (
            excess if excess > _TOLERANCE / 2 else 0.0,
            violation if violation > _TOLERANCE else 0.0,
            float(np.sqrt(cost(z)[0])) * rms,
        )

    bounds = [bound for problem in problems for bound in problem.bounds]
    limits = [{"type": "ineq", "fun": rows, "jac": slopes}]
    if behaviour is not None:
        limits.append({"type": "ineq", "fun": behaviour_rows, "jac": behaviour_slopes})
    z = solve_sqp(cost, start, bounds, limits, 1e-12, options.max_steps)
    if not np.all(np.isfinite(z)) or rank(z) > rank(start):
        z = start
    return rank(z), z


def best_pair(
    machine: LinkMotions,
    torque: Floats,
    betweens: list[Between],
    kinds: list[SpringRow],
    room: SpringRegion,
    work: Work | None = None,
    behaviour: Behaviour | None = None,
    options: SpringSearchOptions = OPTIONS,
) -> MountedSprings | str:
    """Find springs on several pairs of links that work together.

    They are placed in turn, each with the other springs mounted, in some rounds; then all together. For the parameters see
    `best_spring`; there is a spring on each pair of links.
    """
    placed: dict[int, MountedSprings] = {}
    torques, combined = [0 * torque for _ in betweens], torque
    for _ in range(options.rounds):
        for k, between in enumerate(betweens):
            remaining = torque + sum(torques[:k] + torques[k + 1 :])
            found = best_spring(machine, remaining, [between], kinds, room, work, options=options)
            if isinstance(found, str):
                return found
            if k not in placed or found.rms < rms_of(combined):
                placed[k], torques[k], combined = found, found.torque - remaining, found.torque
        if work is not None and work.expired():
            break
    springs = [fit.springs[0] for fit in placed.values()]
    rows = [kind for fit in placed.values() for kind in fit.kinds if kind is not None]
    problems = [_SpringProblem(machine, between, kind, room) for between, kind in zip(betweens, rows)]
    # unknowns have the first end in the plane at the first sample
    levels = [complex(machine.end(spring.between[0], spring.points[0])[0]) for spring in springs]
    start = [problem.start(level, spring.points[1]) for problem, level, spring in zip(problems, levels, springs)]
    _, z = _descend(problems, torque, np.concatenate(start), behaviour, options)
    for k, (problem, spring) in enumerate(zip(problems, springs)):
        springs[k] = _in_link_frame(machine, replace(spring, points=problem.ends(z[4 * k : 4 * k + 4])))
    return mount_springs(machine, torque, springs, rows)
