"""Data that the searches for all kinds of drives share: the linkage, its load, and the torque that the load requires."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TypeVar

import numpy as np

from linkage_atlas.drive_design.operation import FINE, Operation
from linkage_atlas.drive_design.question import DriveQuestion, DriveRequest, RotaryRequest
from linkage_atlas.drive_design.records import AnySpring, Drive, PinPeaks, Refusal, TorqueCurve
from synthesis.arrays import Complexes, Floats
from synthesis.drives.links import LinkMotions
from synthesis.mechanism import Box
from synthesis.studies.forces import Pull, forces, on_links
from synthesis.work import Work

Value = TypeVar("Value")


class DriveTask:
    """A linkage over its motion with its load, in model units, and what the searches found: drives, springs and refusals.

    Parameters
    ----------
    operation : Operation
    question : DriveQuestion
    max_results : int
        Largest number of drives of each kind.
    work : Work
    """

    def __init__(self, operation: Operation, question: DriveQuestion, max_results: int, work: Work) -> None:
        self.operation, self.question, self.max_results, self.work = operation, question, max_results, work
        self.machine, self.fine = operation.machine, operation.fine
        self.torque, self.fine_torque = (machine.torque(question.load) for machine in (self.machine, self.fine))
        self.loaded = question.loaded and bool(np.any(self.torque))
        self.ranked: list[tuple[tuple[float, ...], Drive]] = []
        """Drives with their ranks; the drive with the smallest rank is the best of its kind."""
        self.springs: list[AnySpring] = []
        self.refused: list[Refusal] = []
        self.notes: list[str] = []

    def refuse(self, kind: str, link: str, reason: str, name: str | None = None) -> None:
        """Add the reason why there is no drive of a kind on a link."""
        self.refused.append(Refusal(kind, link, name, reason))

    @cached_property
    def torque_curve(self) -> TorqueCurve:
        """Torque that the load requires, with its integrals."""
        step = (self.fine.at[-1] - self.fine.at[0]) / (FINE - 1)
        work, amount = _simpson(self.fine_torque) * step, _simpson(np.abs(self.fine_torque)) * abs(step)
        return TorqueCurve(self.operation.curve_at, self.torque, work, amount)

    @cached_property
    def box(self) -> Box:
        """Box of the linkage, larger by half its size each way: the default for ends on the ground."""
        bodies = [] if self.machine.body is None else [self.machine.body]
        pivots = [link.pivot for link in self.machine.links.values() if link.pivot is not None]
        left, low, right, high = envelope(*(link.origin for link in [*self.machine.links.values(), *bodies]), *pivots)
        room = max(right - left, high - low, self.machine.extent) / 2
        return left - room, low - room, right + room, high + room

    def reach(self, reach_max: float | None, link: str) -> float:
        """Return the largest distance of a pin from its link's origin; by default the link's own size."""
        return float(reach_max or self.machine.reaches.get(link, self.machine.extent))

    def given_pin(self, link: str, pin: complex | None, pin_on_link: complex | None) -> complex:
        """Return a given pin in the frame of its link."""
        if pin_on_link is not None:
            return pin_on_link
        assert pin is not None
        return self.machine.link(link).point_at(pin)

    def swing(self, link: str) -> float:
        """Return the rotation of a link over the motion in the user's unit."""
        return abs(self.machine.links[link].swing()) / self.operation.radian

    def if_loaded(self, value: Value) -> Value | None:
        """Return a value that is null without a load."""
        return value if self.loaded else None

    def pin_peaks(self, machine: LinkMotions, *directions: Sequence[Pull]) -> PinPeaks | None:
        """Return the largest pin forces of a four-bar with the forces of a drive, over all directions of a motor."""
        linkage = self.operation.linkage
        if linkage is None or not self.loaded:
            return None
        load = on_links(self.question.load, linkage)
        acting = []
        for link, at, force in load.forces:
            # the body is the coupler with another frame
            name = "coupler" if link == "body" else link
            acting.append(Pull(name, machine.link(link).position(at), np.full(machine.at.size, force)))
        states = [forces(linkage, machine.at, load, [*acting, *pulls]) for pulls in directions]
        pins = [(state.driven_ground, state.driven, state.undriven, state.undriven_ground) for state in states]
        return PinPeaks(*(float(np.abs(pin).max()) for pin in zip(*pins)))

    def too_flat(self, kind: str, link: str, words: str, angle: float | None, minimum: float) -> bool:
        """Check a transmission angle against its minimum and refuse the drive if it is smaller."""
        if angle is None or angle >= minimum:
            return False
        self.refuse(kind, link, f"{words} {np.rad2deg(angle):.4g}, below {np.rad2deg(minimum):.4g} degrees")
        return True

    def note_missing_load(self, drives: Sequence[DriveRequest]) -> None:
        """Explain the ranking of drives without a load."""
        if not self.loaded and any(not isinstance(request, RotaryRequest) for request in drives):
            self.notes.append(
                "no load was given: each drive has the best leverage that was found, and its forces are unknown"
            )


def both_ends(values: Sequence[float] | Floats) -> tuple[float, float]:
    """Return the first and the last of some values."""
    return float(values[0]), float(values[-1])


def envelope(*points: Complexes | complex) -> Box:
    """Return the smallest box around points."""
    points_of_all = np.concatenate([np.atleast_1d(array) for array in points])
    x, y = points_of_all.real, points_of_all.imag
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())


def _simpson(values: Floats) -> float:
    """Return the integral over even steps of 1 by Simpson's rule; an odd number of values."""
    return float((values[0] + values[-1] + 4 * values[1:-1:2].sum() + 2 * values[2:-1:2].sum()) / 3)
