"""Poses, rates and a drive's force of any linkage, by conditions between three rigid bodies: no formula is shared.

Nine coordinates: position and angle of both guided links and of the body between them. Eight conditions hold them,
the ninth prescribes the drive. Poses follow by Newton's method, rates and their changes by differentiating the
conditions once and twice, forces by three equations of Newton and Euler a body, with a force in each condition.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from synthesis.drives.links import GROUND
from synthesis.guides import Circle, Driver, Rail, Slot
from synthesis.linkage import Linkage
from synthesis.studies.forces import Load


class State(NamedTuple):
    """Coordinates of the three bodies, x y angle each, and their first and second derivatives by the drive's coordinate."""

    at: np.ndarray
    rate: np.ndarray
    change: np.ndarray

    def place(self, k: int, point: complex) -> complex:
        x, y, angle = self.at[3 * k : 3 * k + 3]
        return complex(x, y) + point * np.exp(1j * angle)

    def acceleration(self, k: int, point: complex) -> complex:
        _, _, angle = self.at[3 * k : 3 * k + 3]
        x, y, turned = self.change[3 * k : 3 * k + 3]
        return complex(x, y) + (1j * turned - self.rate[3 * k + 2] ** 2) * point * np.exp(1j * angle)


Condition = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
"""At coordinates and rates: values (m,), slopes (m, 9), and second derivatives at steady rates (m,)."""


def _point(at: np.ndarray, rate: np.ndarray, k: int | None, point: complex) -> tuple[complex, np.ndarray, complex]:
    """A place, its slopes (9,) and its second derivative at steady rates."""
    if k is None:
        return point, np.zeros(9, dtype=complex), 0j
    arm = point * np.exp(1j * at[3 * k + 2])
    slopes = np.zeros(9, dtype=complex)
    slopes[3 * k : 3 * k + 3] = 1, 1j, 1j * arm
    return complex(at[3 * k], at[3 * k + 1]) + arm, slopes, complex(-(rate[3 * k + 2] ** 2) * arm)


def pinned(i: int, point: complex, j: int | None, other_point: complex) -> Condition:
    """Join two points; None for the ground."""

    def of(at: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        first, other_values = _point(at, rate, i, point), _point(at, rate, j, other_point)
        gap, slopes, bent = (a - b for a, b in zip(first, other_values))
        return np.array([gap.real, gap.imag]), np.array([slopes.real, slopes.imag]), np.array([bent.real, bent.imag])

    return of


def turned_as(i: int, j: int | None, angle: float) -> Condition:
    """The angle between two bodies."""
    slopes = np.zeros((1, 9))
    slopes[0, 3 * i + 2] = 1
    if j is not None:
        slopes[0, 3 * j + 2] = -1

    def of(at: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        # angles are equal if they differ by whole turns
        off = slopes @ at - angle
        return np.angle(np.exp(1j * off)), slopes, np.zeros(1)

    return of


def on_line(i: int, j: int | None, point: complex, angle: float, turn: complex = 1j, along: float = 0.0) -> Condition:
    """The origin of a body on a line of another (of the ground for None); with ``turn`` 1 its place along it."""

    def of(at: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        first, other_values = _point(at, rate, i, 0j), _point(at, rate, j, point)
        w, slopes, bent = (a - b for a, b in zip(first, other_values))
        spin, back = 0.0, np.exp(-1j * angle)
        if j is not None:
            spin, back = rate[3 * j + 2], back * np.exp(-1j * at[3 * j + 2])
            speed = slopes @ rate
            bent = bent - 2j * spin * speed - spin**2 * w
            slopes = slopes.copy()
            slopes[3 * j + 2] -= 1j * w
        back = back * np.conj(turn)
        return (np.array([np.real(back * w) - along]), np.real(back * slopes)[None], np.array([np.real(back * bent)]))

    return of


@dataclass(frozen=True)
class Bodies:
    """A linkage as three bodies: guided link, body, guided link."""

    names: tuple[str, str, str]
    joints: list[Condition]
    drive: Callable[[float], Condition]
    """The condition that its drive is at a travel."""
    begin: np.ndarray
    """(9,): coordinates near those at the first sample."""
    body: tuple[complex, complex]
    """Return origin and direction of the body's frame, in which loads are defined, in the second body's frame."""

    def along(self, travel: np.ndarray) -> list[State]:
        """Return states at coordinates of the drive, each near enough to the previous."""
        at, found = self.begin, []
        for position in travel.tolist():
            all_cases = [*self.joints, self.drive(position)]
            for _ in range(60):
                parts = [condition(at, np.zeros(9)) for condition in all_cases]
                step = np.linalg.solve(np.concatenate([p[1] for p in parts]), np.concatenate([p[0] for p in parts]))
                at = at - step
                if np.abs(step).max() < 1e-14 * max(1.0, np.abs(at).max()):
                    break
            slopes = np.concatenate([condition(at, np.zeros(9))[1] for condition in all_cases])
            unit = np.zeros(9)
            unit[-1] = 1.0
            rate = np.linalg.solve(slopes, unit)
            bent = np.concatenate([condition(at, rate)[2] for condition in all_cases])
            found.append(State(at, rate, np.linalg.solve(slopes, -bent)))
        return found

    def force(self, state: State, load: Load, link: str, pin: complex, on: str, rod_end: complex) -> float:
        """Return the force of a rod from a position, or from a point of another link, to a point of a link: pushing
        is positive.
        """
        slopes = np.concatenate([joint(state.at, state.rate)[1] for joint in self.joints])
        right = np.zeros(9)
        origin, direction = self.body

        def acts(k: int, position: complex, pull: complex, moment: float = 0.0) -> np.ndarray:
            arm = position - complex(state.at[3 * k], state.at[3 * k + 1])
            column = np.zeros(9)
            column[3 * k : 3 * k + 3] = pull.real, pull.imag, np.imag(np.conj(arm) * pull) + moment
            return column

        right += acts(1, state.place(1, origin), load.force, load.torque)
        for acting in load.forces:
            k, at = (
                (1, origin + direction * acting.at)
                if acting.link == "body"
                else (self.names.index(acting.link), acting.at)
            )
            right += acts(k, state.place(k, at), acting.force)
        for mass in load.masses:
            k, at = (
                (1, origin + direction * mass.at) if mass.link == "body" else (self.names.index(mass.link), mass.at)
            )
            pull = mass.mass * (load.gravity - load.metre * load.speed**2 * state.acceleration(k, at))
            spin = mass.inertia * load.metre * load.speed**2 * state.change[3 * k + 2]
            right += acts(k, state.place(k, at), pull, -spin)
        k = self.names.index(link)
        here = state.place(k, pin)
        there = rod_end if on == GROUND else state.place(self.names.index(on), rod_end)
        push = (here - there) / abs(here - there)
        rod = acts(k, here, push)
        if on != GROUND:
            rod += acts(self.names.index(on), there, -push)
        return float(np.linalg.solve(np.column_stack([slopes.T, rod]), -right)[8])


def bodies(linkage: Linkage) -> Bodies:
    """Return the linkage as bodies and conditions."""
    if linkage.is_four_bar:
        return _four_bar(linkage)
    pose = linkage.body(np.array([linkage.start]))
    angle, position = float(pose.rotation[0]), complex(pose.position[0])
    begin = np.zeros(9)
    begin[3:6] = position.real, position.imag, angle
    joints: list[Condition] = []
    for k, guide in ((0, linkage.guides[0]), (2, linkage.guides[1])):
        at = complex(position + np.exp(1j * angle) * guide.body_point)
        if isinstance(guide, Circle):
            begin[3 * k : 3 * k + 3] = guide.pivot.real, guide.pivot.imag, np.angle(at - guide.pivot)
            joints += [pinned(k, 0j, None, guide.pivot), pinned(k, guide.radius + 0j, 1, guide.body_point)]
        elif isinstance(guide, Rail):
            begin[3 * k : 3 * k + 3] = at.real, at.imag, guide.direction
            joints += [
                pinned(k, 0j, 1, guide.body_point),
                on_line(k, None, guide.point, guide.direction),
                turned_as(k, None, guide.direction),
            ]
        else:
            begin[3 * k : 3 * k + 3] = guide.pin.real, guide.pin.imag, angle + guide.body_direction
            joints += [
                pinned(k, 0j, None, guide.pin),
                on_line(k, 1, guide.body_point, guide.body_direction),
                turned_as(k, 1, guide.body_direction),
            ]
    driven = linkage.guides[0]

    def drive(travel: float) -> Condition:
        q = linkage.start + travel
        if linkage.driver.turns:
            return turned_as(0, None, q)
        if isinstance(driven, Rail):
            return on_line(0, None, driven.point, driven.direction, 1, q)
        assert isinstance(driven, Slot)
        assert linkage.driver is Driver.CYLINDER
        return on_line(0, 1, driven.body_point, driven.body_direction, 1, q)

    names = linkage.link_names
    return Bodies((names[0], "coupler", names[2]), joints, drive, begin, (0j, 1 + 0j))


def _four_bar(linkage: Linkage) -> Bodies:
    crank, coupler, rocker, _ = linkage.links
    a, b = complex(linkage.pivot_a), complex(linkage.pivot_b)
    angle = linkage.start + linkage.ground_angle
    d = a + crank * np.exp(1j * angle)
    reach = abs(b - d)
    along = (coupler**2 - rocker**2 + reach**2) / (2 * reach)
    c = d + (b - d) / reach * (along + 1j * linkage.branch * np.sqrt(coupler**2 - along**2))
    begin = np.array([a.real, a.imag, angle, d.real, d.imag, np.angle(c - d), b.real, b.imag, np.angle(c - b)])
    joints = [
        pinned(0, 0j, None, a),
        pinned(0, crank + 0j, 1, 0j),
        pinned(2, 0j, None, b),
        pinned(2, rocker + 0j, 1, coupler + 0j),
    ]
    turn = complex(np.exp(1j * (linkage.body_offset or 0.0)))
    return Bodies(
        ("crank", "coupler", "rocker"),
        joints,
        lambda travel: turned_as(0, None, angle + travel),
        begin,
        (complex(linkage.arm), turn),
    )
