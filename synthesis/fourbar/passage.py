"""How the crank of four-bars passes samples: where it must turn back, change branch or circuit, or cannot go at all.

A configuration is given by theta1 and the side of C (+1: left of D->B), which is the sign of sin(theta3 - theta2). With X and Y
of `kinematics` the loop closes where both are at least 0; X is smallest at theta1 = pi, where it is
(L2+L3)^2 - (L1+L4)^2, and Y at theta1 = 0, where it is (L4-L1)^2 - (L3-L2)^2. So two signs tell everything about circuits:

* Neither is negative: the crank turns fully, it is or the ground is the shortest link. sin(theta3 - theta2) vanishes only where
  X Y = 0, so never: the side cannot change, and the two sides are the two circuits.
* One is negative (not a Grashof linkage): the crank swings about the other place. Both sides meet at both ends of the swing: one
  circuit.
* Both are negative (a Grashof linkage; coupler or rocker is the shortest link): theta1 reaches neither 0 nor pi, so the sign of
  sin(theta1) cannot change: the two circuits, mirror images. Within each both sides meet at both ends of the swing.

What is said of the crank holds for the rocker after both have changed places: lengths (L3, L2, L1, L4), crank angle pi - theta3,
side the sign of sin(theta1 - theta2).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from synthesis.fourbar.kinematics import close_loop, grashof_excesses
from synthesis.target import TURN

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

TIE = 1e-9
"""Crank angles closer than this, in radians, are the same place: they are in order either way round."""
DEAD = 1e-7
"""Below this transmission angle, in radians, both sides are the same place to within the rounding of theta1."""
NEAR_CHANGE_POINT = 1e-6
"""Of the perimeter: where |s + l - p - q| is smaller, circuits all but meet and manufacture decides which of them it is on."""


@dataclass(frozen=True)
class Circuits:
    """Where the crank of linkages can be.

    Attributes
    ----------
    turns, at_zero, at_pi : ndarray of bool, shape (n, 1)
        The loop closes at every crank angle; at theta1 = 0; at theta1 = pi.
    uncertain : ndarray of bool, shape (n,)
        Nearer to a change point than `NEAR_CHANGE_POINT`.
    """

    turns: Flags
    at_zero: Flags
    at_pi: Flags
    uncertain: Flags

    @classmethod
    def of(cls, lengths: Floats) -> Circuits:
        """Those of linkages with lengths (n, 4), by the signs of Y at theta1 = 0, a b, and of X at pi, c times the perimeter."""
        a, b, c = grashof_excesses(lengths)
        at_zero, at_pi = (np.sign(a) * np.sign(b) >= 0)[:, None], (c >= 0)[:, None]
        # of the three pairings of the links s + l against p + q is the nearest to equality
        least = np.minimum(np.minimum(np.abs(a), np.abs(b)), np.abs(c))
        return cls(at_zero & at_pi, at_zero, at_pi, least < NEAR_CHANGE_POINT * lengths.sum(axis=-1))

    def swing(self, angle: Floats) -> tuple[Floats, Floats]:
        """Angles (n, N) less whole turns, cut where the crank cannot be, and the number of the swing: one more after each cut."""
        shift = np.where(self.at_zero, np.pi, 0.0)
        swings = np.where(self.at_zero | self.at_pi, 1.0, 2.0)  # in a turn
        number = np.floor((angle + shift) * swings / TURN)
        return angle - TURN * np.floor(number / swings), number


@dataclass(frozen=True)
class Passage:
    """How the crank passes samples; a flag of neighbours, shape (n, N - 1), is that of samples k and k + 1.

    Attributes
    ----------
    closes : ndarray of bool, shape (n, N)
        The four lengths reach the crank angle.
    other_branch, other_circuit, open_between, out_of_order : ndarray of bool, shape (n, N - 1)
        Defects between neighbours; ``open_between``: the loop does not close everywhere on the prescribed way.
    no_return : ndarray of bool, shape (n,)
        The way must lead on from the last sample to the first, and the crank does not turn fully.
    uncertain : ndarray of bool, shape (n,)
        As of `Circuits`.
    """

    closes: Flags
    other_branch: Flags
    other_circuit: Flags
    open_between: Flags
    out_of_order: Flags
    no_return: Flags
    uncertain: Flags

    @cached_property
    def order(self) -> Flags:
        """Shape (n,)."""
        broken = np.any(self.out_of_order | self.open_between, axis=-1)
        return np.all(self.closes, axis=-1) & ~broken & ~self.no_return

    @cached_property
    def branch(self) -> Flags:
        """Shape (n,)."""
        return ~np.any(self.other_branch, axis=-1)

    @cached_property
    def circuit(self) -> Flags:
        """Shape (n,)."""
        return np.all(self.closes, axis=-1) & ~np.any(self.other_circuit | self.open_between, axis=-1)

    @cached_property
    def driven(self) -> Flags:
        """Whether the crank drives the linkage through all samples in order, turning one way; shape (n,)."""
        return self.order & self.branch & self.circuit


def one_way(steps: Floats) -> tuple[Floats, Floats]:
    """Steps (n, m) modulo a turn, all taken the same way round, and that way, +1 or -1, shape (n, 1).

    It is the way of fewer turns in total; where they are equal, that of most steps. Ties may lie just behind, not a turn ahead.
    """
    ahead, back = ((way * steps + TIE) % TURN - TIE for way in (1.0, -1.0))
    fewer = [np.ceil(np.sum(one, axis=-1, keepdims=True) / TURN - TIE) for one in (ahead, back)]
    most = np.sum(np.sign(back - ahead), axis=-1, keepdims=True) >= 0
    forward = (fewer[0] < fewer[1]) | ((fewer[0] == fewer[1]) & most)
    return np.where(forward, ahead, back), np.where(forward, 1.0, -1.0)


def passage(
    lengths: ArrayLike,
    crank_angle: ArrayLike,
    side: ArrayLike,
    *,
    ordered: bool = True,
    closed: bool = False,
    timed: bool = False,
) -> Passage:
    """How the crank of linkages passes samples.

    Order by crank angles, modulo a turn: a crank that turns fully passes them in order if the steps from sample to sample, all
    taken forwards or all backwards, add up to a turn at most; one that swings, if its angles rise or fall throughout.

    Parameters
    ----------
    lengths : array_like, shape (n, 4)
        L1, L2, L3, L4 in any unit.
    crank_angle : array_like, shape (n, N)
        theta1 at the samples in radians.
    side : array_like of +1 or -1, shape (n, N)
        The branch that each sample lies on.
    ordered : bool
        The samples are to be passed in the order given; otherwise in any order, within a turn.
    closed : bool
        After the last sample the way leads on to the first.
    timed : bool
        The crank angles are prescribed: they, and the way between them, are taken as they are, over several turns too. Otherwise
        they count modulo a turn.

    Returns
    -------
    Passage
        Law: ``driven`` and its parts are the same for reversed samples, ``k * lengths`` and the mirror image (-theta1, -side).
    """
    lengths, angle, side = np.asarray(lengths, dtype=float), np.asarray(crank_angle, dtype=float), np.asarray(side)
    closure = close_loop(lengths, angle)
    where = Circuits.of(lengths)
    turns = where.turns
    if np.any(side != side[..., :1]):
        # a sample at a dead position lies on both branches: it is given that of the sample farthest from one
        transmission = np.nan_to_num(closure.transmission_angle)
        clearest = np.take_along_axis(side, np.argmax(transmission, axis=-1)[:, None], axis=-1)
        side = np.where(transmission < DEAD, clearest, side)
    other_branch = np.diff(side, axis=-1) != 0
    angle = np.where(closure.closed, angle, 0.0)
    within, number = where.swing(angle)
    both_closed = closure.closed[:, 1:] & closure.closed[:, :-1]
    leaves = ~turns & both_closed & (np.diff(number, axis=-1) != 0)
    mirror_image = ~(where.at_zero | where.at_pi) & both_closed & (np.diff(number, axis=-1) % 2 != 0)
    open_between = leaves if timed else np.zeros_like(leaves)
    if timed:
        steps = np.diff(angle, axis=-1)
        out_of_order = steps * np.sign(angle[:, -1:] - angle[:, :1]) <= 0
    elif ordered:
        travelled = np.cumsum(one_way(np.diff(angle, axis=-1))[0], axis=-1)
        steps = np.diff(within, axis=-1)
        rises, falls = steps > TIE, steps < -TIE
        turns_back = np.where(np.sum(rises, axis=-1) >= np.sum(falls, axis=-1), falls.T, rises.T).T
        out_of_order = np.where(turns, travelled > TURN + TIE, turns_back) | mirror_image
    else:
        out_of_order = mirror_image
    return Passage(
        closure.closed,
        other_branch,
        np.where(turns, other_branch, mirror_image),
        open_between,
        out_of_order & both_closed,
        closed & ~turns[:, 0],
        where.uncertain,
    )


def from_the_rocker(lengths: ArrayLike, crank_angle: ArrayLike, side: ArrayLike) -> tuple[Floats, Floats, Floats]:
    """The same configurations with crank and rocker exchanged, as lengths, crank angle and side; shapes as of `passage`.

    Law: doing it twice gives the configurations back, crank angles modulo a turn.
    """
    lengths, side = np.asarray(lengths, dtype=float), np.asarray(side)
    closure = close_loop(lengths, crank_angle)
    theta3 = np.where(side > 0, closure.rocker_angle(1), closure.rocker_angle(-1))
    theta2 = np.where(side > 0, closure.coupler_angle(1), closure.coupler_angle(-1))
    across = np.sin(closure.crank_angle - theta2)
    return lengths[:, [2, 1, 0, 3]], np.pi - theta3, np.where(across >= 0, 1.0, -1.0)
