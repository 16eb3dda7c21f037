"""How linkages on two guides pass the samples of a motion: in order, on one branch and circuit, by which drive.

Words and rules are those of `synthesis.fourbar.passage`, for every pair of guides and every drive. The coordinates at which the
loop closes are all there are, or parts of them, with the *cuts* in between; at their ends, the dead positions, both branches
meet. So parts are the circuits where the coordinate has ends, and the branches are where it has none. The slot of a hinge
beside a rail has two parts whose ends it never reaches: the body would be infinitely far.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Flags, Floats, Ints
from synthesis.fourbar.passage import DEAD, NEAR_CHANGE_POINT, TIE, Passage, Verdict, one_way, reasons_of
from synthesis.guides import DRIVERS, Driver, Rail
from synthesis.linkage import Linkage, through
from synthesis.target import TURN


class Circuits:
    """Where a drive can be.

    ``turns``: the loop closes all around a turn. ``meet``: the two branches meet at the ends of each part. ``uncertain``:
    nearer to a change point than `passage.NEAR_CHANGE_POINT`.
    """

    def __init__(self, linkage: Linkage) -> None:
        conditions = linkage.conditions
        self._angle = linkage.driver.turns
        at_extremes = [
            (place, float(one.value(np.array([place]))[0]), one.size) for one in conditions for place in one.extremes
        ]
        cuts = [place for place, value, _ in at_extremes if value < 0]
        self.uncertain = any(abs(value) < NEAR_CHANGE_POINT * size for _, value, size in at_extremes)
        other = linkage.local_guides[1]
        endless = linkage.driver is Driver.HINGE and isinstance(other, Rail)
        self.meet = not endless and (bool(cuts) or any(one.bounded for one in conditions))
        if endless:
            assert isinstance(other, Rail)
            cuts = [other.direction, other.direction + math.pi]
        self._cuts = sorted(place % TURN for place in cuts) if self._angle else sorted(cuts)
        self.turns = self._angle and not cuts

    def part(self, coordinate: Floats) -> tuple[Floats, Ints]:
        """Coordinates less whole turns, comparable within a part, and the number of the part: one more after each cut."""
        if not self._angle:
            return coordinate, np.sum(coordinate[..., None] > np.array(self._cuts), axis=-1)
        if not self._cuts:
            return coordinate, np.zeros(coordinate.shape, dtype=int)
        number = sum(np.floor((coordinate - cut) / TURN) for cut in self._cuts)
        return coordinate - TURN * np.floor(number / len(self._cuts)), np.asarray(number, dtype=int)

    def elsewhere(self, number: Ints) -> Flags:
        """Whether neighbours lie in different parts, (N - 1,)."""
        steps = np.diff(number)
        return steps % len(self._cuts) != 0 if self._angle and self._cuts else steps != 0


def passage(
    linkage: Linkage,
    coordinate: ArrayLike,
    side: ArrayLike,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> Passage:
    """How the drive of a linkage passes samples: flags as of `fourbar.passage.Passage`, of one linkage.

    Law: the same for reversed samples, for a mirrored, moved or scaled linkage, and with ``coordinate`` more by whole turns.

    Parameters
    ----------
    coordinate : array_like, shape (N,)
        Of the drive.
    side : array_like of +1 or -1, shape (N,)
        The branch that each sample lies on.
    ordered, closed, timed : bool
        As of `fourbar.passage.passage`.
    """
    q, side = np.asarray(coordinate, dtype=float), np.asarray(side)
    where = Circuits(linkage)
    closes = np.all([one.value(q) >= 0 for one in linkage.conditions] or [np.isfinite(q)], axis=0)
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
    return Passage(
        closes[None],
        other_branch[None],
        other_circuit[None],
        (leaves if timed else np.zeros_like(leaves))[None],
        (out_of_order & both)[None],
        np.array([closed and not where.turns]),
        np.array([where.uncertain]),
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
    """The verdict on a linkage; ``driver`` is that of the linkage, or another one of its guides that can where it cannot.

    ``coordinate`` (N,): of the drive. ``side`` (N,): the branch of each sample, default the linkage's own.
    """
    q = np.asarray(coordinate, dtype=float)
    side = np.full(q.shape, linkage.branch) if side is None else np.asarray(side)
    passed = passage(linkage, q, side, ordered=ordered, closed=closed, timed=timed)
    order, branch, circuit, driven, uncertain = (
        bool(one[0]) for one in (passed.order, passed.branch, passed.circuit, passed.driven, passed.uncertain)
    )
    drive, others = linkage.driver.value, other_drives(linkage)
    driver = drive if driven else None
    if circuit and not driven:
        poses = [linkage.body(q, way) for way in (1, -1)]
        rotation, position = (np.where(side > 0, *pair) for pair in zip(*((p.rotation, p.position) for p in poses)))
        for name, (place, other) in others.items():
            guides = linkage.guides[::-1] if place else linkage.guides
            redriven = through(guides, other, float(rotation[0]), complex(position[0]))
            found, sine = redriven.configuration(rotation, position)
            if passage(redriven, found, np.where(sine >= 0, 1, -1), ordered=ordered, closed=closed).driven[0]:
                driver = name
                break
    reasons = (
        reasons_of(passed, 0, driver, drive, list(others), linkage.driver.turns) if uncertain or not driven else ()
    )
    return Verdict(order, branch, circuit, driver, uncertain, reasons)


def other_drives(linkage: Linkage) -> dict[str, tuple[int, Driver]]:
    """Every other drive that the guides offer: by its name, the guide that it moves (0 or 1) and how."""
    found: dict[str, tuple[int, Driver]] = {}
    for place, guide in enumerate(linkage.guides):
        for driver in DRIVERS[type(guide)]:
            if (place, driver) != (0, linkage.driver):
                taken = driver.value == linkage.driver.value or driver.value in found
                name = "rocker" if taken and driver is Driver.CRANK else f"second {driver}" if taken else driver.value
                found[name] = (place, driver)
    return found
