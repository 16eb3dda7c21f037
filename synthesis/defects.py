"""Defects of linkages that reach every sample of a motion: order, branch and circuit.

A linkage that reaches every sample may still fail as a machine: the drive must reverse between two samples (order
defect), pass a dead position (branch defect), or the linkage must be disassembled and assembled in another way
(circuit defect). The terms are those of Chase and Mirth, "Circuits and branches of single-degree-of-freedom planar
linkages", ASME Journal of Mechanical Design 115 (1993), 223-230.

The loop closes at all coordinates, or in intervals that are separated by *cuts*; both branches meet at the ends of an
interval, the dead positions. Therefore each interval is a circuit if it has ends, and each branch is a circuit if it
has none. The slot of a hinge beside a rail has two intervals whose ends it never reaches, because the body would be
infinitely far away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Flags, Floats, Ints
from synthesis.four_bar import grashof_excesses
from synthesis.guides import DRIVERS, Driver, Rail
from synthesis.linkage import Linkage, through
from synthesis.target import TURN, Target

TIE = 1e-9
"""Largest difference, in radians, of drive angles that count as the same position, in order in both directions."""
DEAD = 1e-7
"""Transmission angle, in radians, below which both branches are the same position to within rounding."""
NEAR_CHANGE_POINT = 1e-6
"""Relative distance from a change point below which manufacturing tolerances decide on which circuit a linkage is."""
NAMED = 3
"""Number of samples, or pairs of neighbours, that a reason names; it counts the others."""
ONE_POSITION, _ALIKE = 1e-5, 1e-3
"""Fraction of the travel within which drive positions are equal; difference of distinct samples, radians or extents."""


@dataclass(frozen=True)
class Verdict:
    """Passage of a drive through N samples; an array (N - 1,) has a flag for each pair of neighbours k and k + 1."""

    closes: Flags
    """The loop closes at the sample, (N,)."""
    other_branch: Flags
    other_circuit: Flags
    open_between: Flags
    """The loop opens somewhere on the prescribed path."""
    out_of_order: Flags
    no_return: bool
    """The path must lead from the last sample to the first, and the drive does not turn fully."""
    uncertain: bool
    """The linkage is nearer to a change point than `NEAR_CHANGE_POINT`."""
    driver: str | None = None
    """The drive if it passes all samples in order while it moves in one direction (order, branch and circuit are true);
    otherwise another suitable drive of the guides; None if there is none."""
    reasons: tuple[str, ...] = ()
    """A sentence for each defect; samples count from 1."""

    @cached_property
    def order(self) -> bool:
        """True without an order defect."""
        return bool(np.all(self.closes) and not np.any(self.out_of_order | self.open_between) and not self.no_return)

    @cached_property
    def branch(self) -> bool:
        """True without a branch defect."""
        return not np.any(self.other_branch)

    @cached_property
    def circuit(self) -> bool:
        """True without a circuit defect."""
        return bool(np.all(self.closes) and not np.any(self.other_circuit | self.open_between))

    @cached_property
    def driven(self) -> bool:
        """True if the drive passes all samples in order without reversing."""
        return self.order and self.branch and self.circuit


class Circuits:
    """Coordinates that a drive can reach, in intervals.

    ``turns``: the loop closes throughout a turn. ``meet``: the two branches meet at the ends of each interval.
    ``uncertain``: nearer to a change point than `NEAR_CHANGE_POINT`.
    """

    def __init__(self, linkage: Linkage) -> None:
        conditions = linkage.conditions
        self._angle = linkage.driver.turns
        at_extremes = [
            (extreme, value, condition.size)
            for condition in conditions
            for extreme, value in zip(condition.extremes, condition.value(np.array(condition.extremes)).tolist())
        ]
        cuts = [extreme for extreme, value, _ in at_extremes if value < 0]
        self.uncertain = any(abs(value) < NEAR_CHANGE_POINT * size for _, value, size in at_extremes)
        if linkage.is_four_bar:  # s + l - p - q is the smallest of the three sums
            excess = min(abs(float(excess)) for excess in grashof_excesses(linkage.links))
            self.uncertain = excess < NEAR_CHANGE_POINT * sum(linkage.links)
        second = linkage.local_guides[1]
        endless = linkage.driver is Driver.HINGE and isinstance(second, Rail)
        self.meet = not endless and (bool(cuts) or any(condition.bounded for condition in conditions))
        if endless:
            assert isinstance(second, Rail)
            cuts = [second.direction, second.direction + math.pi]
        self._cuts = sorted(cut % TURN for cut in cuts) if self._angle else sorted(cuts)
        self.turns = self._angle and not cuts

    def part(self, coordinate: Floats) -> tuple[Floats, Ints]:
        """Return coordinates less whole turns, comparable within an interval, and the number of the interval."""
        if not self._angle:
            return coordinate, np.sum(coordinate[..., None] > np.array(self._cuts), axis=-1)
        if not self._cuts:
            return coordinate, np.zeros(coordinate.shape, dtype=int)
        number = sum(np.floor((coordinate - cut) / TURN) for cut in self._cuts)
        return coordinate - TURN * np.floor(number / len(self._cuts)), np.asarray(number, dtype=int)

    def elsewhere(self, number: Ints) -> Flags:
        """Return the mask of neighbours that lie in different intervals, (N - 1,)."""
        steps = np.diff(number)
        return steps % len(self._cuts) != 0 if self._angle and self._cuts else steps != 0


def one_way(steps: Floats) -> tuple[Floats, Floats]:
    """Return steps (n, m) modulo a turn, all in the same direction, and the directions, +1 or -1, shape (n, 1).

    The direction of fewer turns in total is chosen, or else the direction of most steps. Equal positions may lie slightly behind,
    not a turn ahead.
    """
    ahead, back = ((sign * steps + TIE) % TURN - TIE for sign in (1.0, -1.0))
    fewer = [np.ceil(np.sum(steps_on, axis=-1, keepdims=True) / TURN - TIE) for steps_on in (ahead, back)]
    mostly_forward = np.sum(np.sign(back - ahead), axis=-1, keepdims=True) >= 0
    forward = (fewer[0] < fewer[1]) | ((fewer[0] == fewer[1]) & mostly_forward)
    return np.where(forward, ahead, back), np.where(forward, 1.0, -1.0)


def passage(
    linkage: Linkage,
    coordinate: ArrayLike,
    side: ArrayLike,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> Verdict:
    """Return how the drive of a linkage passes samples, without a suitable drive and reasons.

    A drive that turns fully passes them in order if the steps from sample to sample, all taken forwards or all
    backwards, add up to at most a turn; any other drive, if its coordinates rise or fall monotonically.

    Law: the result is the same for reversed samples, for a mirrored, moved or scaled linkage, and, without timing,
    for coordinates that differ by whole turns.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    coordinate : array_like, shape (N,)
        Coordinates of the drive at the samples.
    side : array_like of +1 or -1, shape (N,) or ()
        Branch of each sample, or of all.
    ordered : bool
        The samples must be passed in their order; otherwise in any order, within a turn.
    closed : bool
        The path continues from the last sample to the first.
    timed : bool
        The coordinates are prescribed: the drive moves through exactly these values, also over several turns.
        Otherwise angles count modulo a turn.
    """
    q = np.asarray(coordinate, dtype=float)
    side = np.full(q.shape, side)
    where = Circuits(linkage)
    closes = np.all([condition.value(q) >= 0 for condition in linkage.conditions] or [np.isfinite(q)], axis=0)
    if np.any(side != side[0]):
        angle = np.nan_to_num(linkage.body(q).transmission_angle)
        side = np.where(angle < DEAD, side[np.argmax(angle)], side)
    other_branch = np.diff(side) != 0
    q = np.where(closes, q, 0.0)
    within, number = where.part(q)
    both = closes[1:] & closes[:-1]
    leaves = both & (np.diff(number) != 0)
    elsewhere = where.elsewhere(number) & both
    other_circuit = elsewhere if where.meet else elsewhere | other_branch
    steps = np.diff(within)
    if timed:
        steps = np.diff(q)
        out_of_order = steps * np.sign(q[-1] - q[0]) <= 0
    elif ordered and where.turns:
        out_of_order = np.cumsum(one_way(np.diff(q)[None])[0]) > TURN + TIE
    elif ordered:
        tie = TIE * (1 if linkage.driver.turns else float(np.max(np.abs(q))))
        rises, falls = steps > tie, steps < -tie
        out_of_order = (falls if rises.sum() >= falls.sum() else rises) | elsewhere
    else:
        out_of_order = elsewhere
    return Verdict(
        closes,
        other_branch,
        other_circuit,
        leaves if timed else np.zeros_like(leaves),
        out_of_order & both,
        closed and not where.turns,
        where.uncertain,
    )


def verdict(
    linkage: Linkage,
    coordinate: ArrayLike,
    side: ArrayLike | None = None,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> Verdict:
    """Return the verdict on a linkage.

    Parameters
    ----------
    linkage : Linkage
        The linkage.
    coordinate : array_like, shape (N,)
        Coordinates of the drive at the samples.
    side : array_like of +1 or -1, shape (N,), optional
        Branch of each sample; default: the branch of the linkage.
    ordered, closed, timed : bool
        See `passage`.
    """
    q = np.asarray(coordinate, dtype=float)
    side = linkage.branch if side is None else np.asarray(side)
    passed = passage(linkage, q, side, ordered=ordered, closed=closed, timed=timed)
    drive, alternatives = linkage.driver.value, other_drives(linkage)
    driver = drive if passed.driven else None
    if passed.circuit and not passed.driven:
        poses = [linkage.body(q, sense) for sense in (1, -1)]
        rotation, position = (np.where(side > 0, *pair) for pair in zip(*((p.rotation, p.position) for p in poses)))
        for name, (index, driver_kind) in alternatives.items():
            guides = linkage.guides[::-1] if index else linkage.guides
            redriven = through(guides, driver_kind, float(rotation[0]), complex(position[0]))
            found, sine = redriven.configuration(rotation, position)
            if passage(redriven, found, np.where(sine >= 0, 1, -1), ordered=ordered, closed=closed).driven:
                driver = name
                break
    reasons: tuple[str, ...] = ()
    if passed.uncertain or not passed.driven:
        reasons = _reasons_of(passed, driver, drive, list(alternatives), linkage.driver.turns)
    return replace(passed, driver=driver, reasons=reasons)


def other_drives(linkage: Linkage) -> dict[str, tuple[int, Driver]]:
    """Return every other drive of the guides by its name, with the guide that it moves (0 or 1)."""
    found: dict[str, tuple[int, Driver]] = {}
    for index, guide in enumerate(linkage.guides):
        for driver in DRIVERS[type(guide)]:
            if (index, driver) != (0, linkage.driver):
                taken = driver.value == linkage.driver.value or driver.value in found
                name = "rocker" if taken and driver is Driver.CRANK else f"second {driver}" if taken else driver.value
                found[name] = (index, driver)
    return found


def _reasons_of(
    passed: Verdict, driver: str | None, drive: str, alternatives: Sequence[str], turns: bool = True
) -> tuple[str, ...]:
    """Return a sentence for each defect of a passage by ``drive``.

    ``driver`` is a drive among the ``alternatives`` that passes the samples without a defect, if there is any.
    ``turns``: the drive turns; otherwise it moves on a line.
    """
    moves, moving = ("turns", "turning") if turns else ("moves", "moving")
    reasons = []
    if not np.all(passed.closes):
        numbers = [str(index + 1) for index in np.flatnonzero(~passed.closes)]
        reasons.append(f"the linkage does not close at {_listed(numbers)}")
    if np.any(flags := passed.open_between):
        reasons.append(f"the linkage does not close everywhere between {_named(flags)}")
    if np.any(flags := passed.other_branch):
        reasons.append(f"{_named(flags)} lie on different branches")
    if np.any(flags := passed.other_circuit):
        reasons.append(
            f"{_named(flags)} lie on different circuits: the linkage would have to be disassembled between them"
        )
    if np.all(passed.closes) and np.any(flags := passed.out_of_order & ~passed.other_circuit):
        first = int(np.argmax(flags)) + 1
        reasons.append(
            f"a {drive} that {moves} in one direction does not pass samples {first} and {first + 1} in this order"
        )
    if passed.no_return:
        only = f"the {drive} only swings" if turns else f"the {drive} only moves back and forth"
        reasons.append(f"{only}: {moving} in one direction, it does not return from the last sample to the first")
    if driver is not None and driver != drive:
        reasons.append(f"only the {driver} can drive the linkage through the samples, not the {drive}")
    elif driver is None:
        drives = [drive, *alternatives]
        named = f"{', '.join(drives[:-1])} nor {drives[-1]}"
        reasons.append(
            f"neither {named} can drive the linkage through the samples, {moving} in one direction"
            if alternatives
            else f"the {drive} cannot drive the linkage through the samples, {moving} in one direction"
        )
    if passed.uncertain:
        reasons.append("the linkage is so near a change point that it may pass from one circuit to the other")
    return tuple(reasons)


def shared_positions(motion: Target, turns: bool = True) -> list[str]:
    """Return a sentence if different samples lie at the same position of the drive, to rounding.

    A drive that passes the samples in order only thanks to rounding cannot separate such samples. The ends of an open
    path that are a whole turn apart are an example.

    Parameters
    ----------
    motion : Target
        The motion with the positions of the drive.
    turns : bool
        The positions are angles, and count modulo a turn.
    """
    resolution = ONE_POSITION * np.ptp(motion.crank)
    drive = motion.crank % TURN if turns else motion.crank
    order = np.argsort(drive, kind="stable")
    step = np.diff(drive[order], append=drive[order[0]] + TURN if turns else np.inf)
    pairs = np.sort(np.stack([order, np.roll(order, -1)]), axis=0)[:, step <= resolution]
    differ = np.zeros(pairs.shape[1], dtype=bool)
    for samples, weights, same in (
        (motion.position, motion.position_weights, _ALIKE * motion.extent if motion.position is not None else 0.0),
        (None if motion.rotation is None else np.exp(1j * motion.rotation), motion.rotation_weights, _ALIKE),
    ):
        if samples is not None:
            first, second = pairs
            both = True if weights is None else (weights[first] > 0) & (weights[second] > 0)
            differ |= (np.abs(samples[first] - samples[second]) > same) & both
    if not differ.any():
        return []
    named = sorted((pairs[:, differ] + 1).T.tolist())
    names = (
        [str(first) for first in named[0]] if len(named) == 1 else [f"{first}/{second}" for first, second in named]
    )
    what, closeness = (
        ("crank position", "rounding or a whole turn") if turns else ("position of the drive", "rounding")
    )
    return [f"{_listed(names)} share one {what}, to {closeness}, although they differ"]


def _named(flags: Flags) -> str:
    """Name the flagged pairs of neighbours (N - 1,): "samples 2 and 3", "samples 2/3, 7/8"."""
    first = np.flatnonzero(flags) + 1
    return _listed(f"{first[0]} {first[0] + 1}".split() if first.size == 1 else [f"{k}/{k + 1}" for k in first])


def _listed(names: list[str]) -> str:
    """List the first few samples by name: "sample 2", "samples 2 and 3", "samples 2, 3, 4 and 5 more"."""
    if len(names) == 1:
        return f"sample {names[0]}"
    remaining = len(names) - NAMED
    named, last = (names[:NAMED], f"{remaining} more") if remaining > 0 else (names[:-1], names[-1])
    return f"samples {', '.join(named)} and {last}"
