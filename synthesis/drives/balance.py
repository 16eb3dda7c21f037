"""Springs of zero free length that balance a linkage in every position, in closed form.

The plane of motion is vertical. With e1, e2, e3 the directions of crank, coupler and rocker every point of a four-bar is
``a0 + a1 e1 + a2 e2``, so masses have the potential ``const + Re(W1 e1 + W2 e2)``. If e2 is expressed by e1 and e3, this is
``Re(V1 e1 + V3 e3)``: two pendulums on fixed pivots. A spring from the ground at s to p e1 on the crank gives
``-k Re(conj(s - A) p e1)``. Two such springs, on crank and rocker, balance any four-bar; a single spring does so only under a
condition on signs (Kuo, Mechanism and Machine Theory 214, 106140, derived independently here).

A body on guides has two such pendulums as well: a crank about its pivot, a block about its pin, and the body about the pin that a
slider carries. A spring there from s to p e1 gives -k Re(conj(s) p e1), also on a slider, which does not turn. If the guides
include a circle, or are two rails, these pendulums carry every weight. They do not carry a weight along the rail beside a slot
or between two slots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from synthesis.arrays import Complexes, Floats
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.springs import Spring
from synthesis.guides import Circle, Rail
from synthesis.linkage import Linkage
from synthesis.studies.forces import Load

_NONE = 1e-12
"""Fraction of the potential below which a part of it counts as zero."""
_LEFT = 1e-9
"""Fraction of the largest torque that springs on guides may leave because of rounding."""


@dataclass(frozen=True)
class Potential:
    """Potential of the masses and the force on a four-bar, with the coefficients W1, W2, V1 and V3 of the module's docstring."""

    linkage: Linkage
    w1: complex
    w2: complex

    @property
    def v1(self) -> complex:
        """Coefficient of the crank if crank and rocker carry all of the potential."""
        crank, coupler, _, _ = self.linkage.links
        return self.w1 - self.w2 * crank / coupler

    @property
    def v3(self) -> complex:
        """Coefficient of the rocker if crank and rocker carry all of the potential."""
        _, coupler, rocker, _ = self.linkage.links
        return self.w2 * rocker / coupler


def potential_of(linkage: Linkage, load: Load) -> Potential:
    """Return the potential of a load's masses and of its force.

    A torque is left out: no springs balance it in every position.
    """
    crank, coupler, rocker, _ = linkage.links
    w1 = w2 = 0j

    def add(pull: complex, link: str, point: complex) -> None:
        nonlocal w1, w2
        a1, a2 = {
            "crank": (point, 0j),
            "coupler": (complex(crank), point),
            "rocker": (point * crank / rocker, point * coupler / rocker),
        }[link]
        w1, w2 = w1 - np.conj(pull) * a1, w2 - np.conj(pull) * a2

    if linkage.mounted:
        add(load.force, "coupler", linkage.arm)
    weights = [(mass.link, mass.at, mass.mass * load.gravity) for mass in load.masses]
    for link, point, force in [*load.forces, *weights]:
        if link == "body":
            link, point = "coupler", linkage.arm + point * np.exp(1j * (linkage.body_offset or 0.0))
        add(force, link, point)
    return Potential(linkage, complex(w1), complex(w2))


def two_springs(potential: Potential, stiffness: float | None = None) -> list[Spring]:
    """Return the springs from the ground to crank and rocker that balance a four-bar, which always exist.

    They act on the crank pin and on the middle of the rocker. A spring whose coefficient vanishes is left out.

    Parameters
    ----------
    potential : Potential
    stiffness : float, optional
        Stiffness of both springs; by default each spring's ground end is as far from the pivot as its other end.
    """
    linkage = potential.linkage
    crank, _, rocker, _ = linkage.links
    total = abs(potential.v1) + abs(potential.v3)
    springs = []
    for link, pivot, part, point in (
        ("crank", linkage.pivot_a, potential.v1, crank),
        ("rocker", linkage.pivot_b, potential.v3, rocker / 2),
    ):
        if abs(part) > _NONE * total:
            rate = abs(part) / point**2 if stiffness is None else stiffness
            springs.append(
                Spring((GROUND, link), (complex(pivot + np.conj(part / (rate * point))), complex(point)), float(rate))
            )
    return springs


def one_spring(potential: Potential, between: tuple[str, str]) -> Spring | float:
    """Return the only spring of its kind that balances a four-bar.

    Parameters
    ----------
    potential : Potential
    between : pair of str
        ("ground", "coupler"), ("crank", "rocker"), ("ground", "crank") or ("ground", "rocker").

    Returns
    -------
    Spring or float
        The spring, or the negative stiffness that it would need; infinity if there is none.
    """
    linkage = potential.linkage
    crank, coupler, rocker, _ = linkage.links
    total = abs(potential.w1) + abs(potential.w2)
    a, b = complex(linkage.pivot_a), linkage.pivot_b
    ground = a - b
    match between:
        case ("ground", "coupler"):
            q1, q2 = potential.w1 / np.conj(ground), potential.w2 / np.conj(ground)
            if min(abs(q1.imag), abs(q2.imag)) <= _NONE * (abs(q1) + abs(q2)):
                return np.inf
            distance = crank * q2.imag / q1.imag
            rate = (q2.real * q1.imag / q2.imag - q1.real) / (crank * (1 - distance / coupler))
            if not rate > 0:
                return float(rate)
            anchor = b + np.conj(potential.w2) / (rate * distance)
            return Spring(between, (complex(anchor), complex(distance)), float(rate))
        case ("crank", "rocker"):
            qa, qb = potential.v1 / np.conj(ground), potential.v3 / np.conj(ground)
            if min(abs(qa.imag), abs(qb.imag)) <= _NONE * (abs(qa) + abs(qb)):
                return np.inf
            ratio = -qb.imag / qa.imag
            y = (qb.real + ratio * qa.real) / (ratio**2 / rocker - ratio / crank)
            point = ratio * y / rocker - qa.real - 1j * qa.imag
            rate = abs(point) ** 2 / y
            if not rate > 0:
                return float(rate)
            return Spring(between, (complex(point / rate), complex(ratio * point / rate)), float(rate))
        case ("ground", "crank" | "rocker"):
            own, remaining = (potential.v1, potential.v3) if between[1] == "crank" else (potential.v3, potential.v1)
            if abs(remaining) > _NONE * total or abs(own) <= _NONE * total:
                return np.inf
            return next(spring for spring in two_springs(potential) if spring.between == between)
    return np.inf


@dataclass(frozen=True)
class _Pendulum:
    """A link that turns about a point of a neighbour, with the part Re(U e) of the potential that depends on its direction e."""

    between: tuple[str, str]
    pivot: complex
    """Pivot in the frame of the first link."""
    level: complex
    """Direction of the first link's frame, which does not turn."""
    joint: complex
    """Pivot in the frame of the second link."""
    arm: float
    """Distance from the pivot at which the spring acts."""
    direction: Complexes
    rate: Floats

    @property
    def rows(self) -> Floats:
        """Derivatives (n, 2) of Re(U e) by the drive, for the real and the imaginary part of U."""
        return np.column_stack([-self.direction.imag * self.rate, -self.direction.real * self.rate])

    def spring(self, part: complex, stiffness: float | None) -> Spring:
        """Return the spring that cancels Re(U e)."""
        rate = abs(part) / self.arm**2 if stiffness is None else stiffness
        end = self.pivot + np.conj(part / (rate * self.arm)) / self.level
        return Spring(self.between, (complex(end), self.joint + self.arm), float(rate))


def _pendulums(linkage: Linkage | None, machine: LinkMotions) -> list[_Pendulum]:
    """Return the links on circles and a single link that turns with the body: a block, or otherwise the body on a slider.

    A hinged link without a linkage is a pendulum itself.
    """
    if linkage is None:
        arm, links = machine.extent / 2, machine.links.values()
        return [
            _Pendulum((GROUND, link.name), link.origin[0], 1 + 0j, 0j, arm, link.direction, link.rate)
            for link in links
        ]
    first, body, second = linkage.link_names
    found, turning = [], []
    for guide, name in zip(linkage.guides, (first, second)):
        if isinstance(guide, Rail):
            link, level = machine.links[body], complex(machine.links[name].direction[0])
            turning.append(
                _Pendulum((name, body), 0j, level, guide.body_point, machine.extent / 4, link.direction, link.rate)
            )
            continue
        link = machine.links[name]
        pivot, arm = (guide.pivot, guide.radius) if isinstance(guide, Circle) else (guide.pin, machine.extent / 4)
        pendulum = _Pendulum((GROUND, name), complex(pivot), 1 + 0j, 0j, arm, link.direction, link.rate)
        if isinstance(guide, Circle):
            found.append(pendulum)
        else:
            turning.insert(0, pendulum)
    return found + turning[:1]


def springs_on_pendulums(
    linkage: Linkage | None, machine: LinkMotions, torque: Floats, stiffness: float | None = None
) -> list[Spring] | None:
    """Return springs that balance the torque of the drive of a linkage on guides; None if there are none.

    The coefficients of the potential follow from the torque by least squares; if the pendulums carry all of it, nothing remains.

    Parameters
    ----------
    linkage : Linkage or None
        None for a link on a hinge.
    machine : LinkMotions
    torque : ndarray, shape (n,)
        Torque that the drive must give.
    stiffness : float, optional
        Stiffness of all springs.
    """
    if not np.all(np.isfinite(torque)):
        return None
    pendulums = _pendulums(linkage, machine)
    rows = np.concatenate([pendulum.rows for pendulum in pendulums], axis=1)
    size = np.abs(rows).max()
    parts = np.linalg.lstsq(rows / size, torque / size, rcond=None)[0]
    largest = np.abs(torque).max()
    if np.abs(rows @ parts - torque).max() > _LEFT * largest:
        return None
    springs = []
    for pendulum, (real, imaginary) in zip(pendulums, parts.reshape(-1, 2)):
        part = complex(real, imaginary)
        if abs(part) * np.abs(pendulum.rate).max() > _LEFT * largest:
            springs.append(pendulum.spring(part, stiffness))
    return springs
