"""Motions of several linkages at once, as arrays; four-bars are computed together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from synthesis.arrays import Complexes, Flags, Floats
from synthesis.four_bar import FULL_CRANK, close_loop, family, transmission_angle_over
from synthesis.linkage import Linkage
from synthesis.target import TURN, Interval


class BodyMotions(NamedTuple):
    """Motions of the bodies of n linkages at N travels of their drives; NaN if the loop does not close."""

    rotation: Floats
    """Rotation in radians, continuous in the travel, (n, N)."""
    position: Complexes
    """Position of the body point, (n, N)."""


def body_motions(linkages: Sequence[Linkage], travel: ArrayLike) -> BodyMotions:
    """Return the motions of the bodies of linkages.

    Parameters
    ----------
    linkages : sequence of Linkage
        At least one.
    travel : array_like, shape (n, N) or (N,)
        Travel of each drive from the first sample, in radians or units of length.
    """
    travel = np.atleast_2d(np.asarray(travel, dtype=float))
    travel = np.broadcast_to(travel, (len(linkages), travel.shape[1]))
    if not all(linkage.is_four_bar for linkage in linkages):
        poses = [linkage.body(linkage.start + row) for linkage, row in zip(linkages, travel)]
        return BodyMotions(np.array([pose.rotation for pose in poses]), np.array([pose.position for pose in poses]))
    links = np.array([linkage.links for linkage in linkages])
    branch = np.array([linkage.branch for linkage in linkages])
    start, ground_angle, offset = np.array(
        [(linkage.start, linkage.ground_angle, linkage.body_offset or 0.0) for linkage in linkages]
    ).T[:, :, None]
    pivot, arm = np.array([(linkage.pivot_a, linkage.arm) for linkage in linkages]).T[:, :, None]
    crank = start + np.concatenate([np.zeros((len(linkages), 1)), travel], axis=1)
    angle = close_loop(links, crank).coupler_angle(branch)
    begin = angle[:, :1]
    turns = np.nan_to_num(np.round((begin - np.arctan2(np.sin(begin), np.cos(begin))) / TURN))
    crank, angle = crank[:, 1:] + ground_angle, angle[:, 1:] - TURN * turns + ground_angle
    position = pivot + links[:, :1] * np.exp(1j * crank) + arm * np.exp(1j * angle)
    return BodyMotions(angle + offset, position)


def turn_fully(linkages: Sequence[Linkage]) -> Flags:
    """Check which drives turn fully, (n,)."""
    if all(linkage.is_four_bar for linkage in linkages):
        return np.array([name in FULL_CRANK for name in family([linkage.links for linkage in linkages])], dtype=bool)
    return np.array([linkage.turns_fully for linkage in linkages], dtype=bool)


def transmission_angles_over(linkages: Sequence[Linkage], travel: Interval) -> Floats:
    """Return the smallest transmission angle of each linkage, (n,); NaN if the loop opens.

    ``travel``: interval of the travel from the first sample, with ends of shape (n,).
    """
    start = np.array([linkage.start for linkage in linkages])
    interval = travel.after(start)
    if all(linkage.is_four_bar for linkage in linkages):
        links = np.array([linkage.links for linkage in linkages]).reshape(-1, 4)
        return transmission_angle_over(links, interval)
    ends = zip(linkages, *(np.broadcast_to(end, start.shape).tolist() for end in interval))
    return np.array([linkage.transmission_angle_over(Interval(first, last)) for linkage, first, last in ends])
