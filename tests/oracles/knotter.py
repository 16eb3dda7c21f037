"""Independent models of the knotter, written directly from the printed equations: with mpmath, and with numpy.

Equation numbers refer to Zhang et al., Transactions of the CSAM 49(8), 2018.
The arguments of `Exact` are in degrees.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np
from scipy.interpolate import PchipInterpolator

SIZES = {"alpha2": 8, "d1": 136, "D": 20, "d5": 54, "d6": 142, "d9": 12, "d10": 24.5, "lead": 23.5, "ratio": 0.5}
POINTS = {
    "S1": (22, 14, -39), "S3": (0, 16, -12), "S4": (0, 8, -28), "S5": (0, 0, 0), "S7": (26.5, -5.5, -53),
    "S8": (40, 0, -27), "S9": (56.5, 0, -30.5), "S10": (59, 0, 31.5),
}  # fmt: skip
"""Assumed coordinates in mm (REF); S0 is 30 mm from the disc's axis, at 15 degrees."""


def rotation(axis: str, angle) -> mp.matrix:
    """Return the rotation matrix of eqs 1 to 3, for an angle in radians."""
    c, s = mp.cos(angle), mp.sin(angle)
    rows = {
        "i": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "j": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "k": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return mp.matrix(rows[axis])


class Exact:
    """A knotter with senses -1 and -1, in the working precision of mpmath.

    Angles are first rounded to doubles in radians, as in the code under test; ``round_angles=False`` uses exact degrees.
    """

    def __init__(self, alpha1=0, alpha3=0, points=(), round_angles=True, **sizes) -> None:
        radians = (lambda x: mp.mpf(float(np.radians(float(x))))) if round_angles else mp.radians
        sizes = {**SIZES, **sizes}
        self.alpha1, self.alpha2, self.alpha3 = radians(alpha1), radians(sizes["alpha2"]), radians(alpha3)
        self.lead, self.jaw_open = radians(sizes["lead"]), radians(22.5)
        self.size = {name: mp.mpf(value) for name, value in sizes.items()}
        s0 = [-30 * mp.sin(radians(15)), 0, 30 * mp.cos(radians(15))]
        if round_angles:
            s0 = [float(x) for x in (-30.0 * np.sin(np.radians(15.0)), 0.0, 30.0 * np.cos(np.radians(15.0)))]
        self.points = {name: mp.matrix(xyz) for name, xyz in {"S0": s0, **POINTS, **dict(points)}.items()}

    def disc_in_bill(self, alpha) -> mp.matrix:
        """Return S0 in u4 (eq 9)."""
        size = self.size
        r = rotation("j", -(self.lead + size["ratio"] * alpha)) * self.points["S0"] - mp.matrix([0, size["D"], 0])
        r = rotation("i", self.alpha1) * r + mp.matrix([size["d5"], 0, -size["d1"]])
        r = rotation("j", self.alpha2) * (rotation("i", self.alpha3) * r) + mp.matrix([0, 0, size["d6"]])
        return rotation("k", alpha) * r

    def bill_in_seat(self, r: mp.matrix, alpha) -> mp.matrix:
        """Return a point of the bill in the frame of the disc's bearing, by the inverse of eq 9 (intended by eq 17)."""
        size = self.size
        r = rotation("j", -self.alpha2) * (rotation("k", -alpha) * r - mp.matrix([0, 0, size["d6"]]))
        r = rotation("i", -self.alpha3) * r - mp.matrix([size["d5"], 0, -size["d1"]])
        return rotation("i", -self.alpha1) * r + mp.matrix([0, size["D"], 0])

    def alpha4(self, alpha):
        """Return the angle of the jaw: 22.5 degrees up to 270, then evenly to 0 at 337."""
        fraction = 1 - (alpha - mp.radians(270)) / mp.radians(67)
        return self.jaw_open * min(max(fraction, 0), 1)

    def jaw_offset(self) -> mp.matrix:
        return mp.matrix([self.size["d9"], 0, self.size["d10"]])

    def bill_in_jaw(self, r: mp.matrix, alpha) -> mp.matrix:
        """Return a point of the bill in u5 (eqs 22 to 24)."""
        return rotation("j", -self.alpha4(alpha)) * (r + self.jaw_offset())

    def wrap(self, alpha) -> tuple:
        """Return E1 in the plane i4 = 0 (eq 11), its position along the rope from 0 to 1, and the vertices of its triangle."""
        p, q = self.disc_in_bill(alpha), self.points["S1"]
        t = p[0] / (p[0] - q[0])
        crossing = p + t * (q - p)
        return (
            (crossing[1], crossing[2]),
            t,
            [(self.points[name][1], self.points[name][2]) for name in ("S3", "S4", "S5")],
        )

    def bite(self, alpha) -> tuple:
        """Return E2 in the plane j5 = 0 (eq 26), its position along the rope from 0 to 1, and the vertices of its triangle."""
        p, q, s9 = (
            self.bill_in_jaw(r, alpha) for r in (self.disc_in_bill(alpha), self.points["S7"], self.points["S9"])
        )
        t = p[1] / (p[1] - q[1])
        crossing = p + t * (q - p)
        return (crossing[0], crossing[2]), t, [(0, 0), (self.points["S8"][0], self.points["S8"][2]), (s9[0], s9[2])]

    def side(self, event: str, edge: int, alpha):
        """Return a number whose sign is the side of an edge on which E1 (``wrap``) or E2 (``bite``) lies; zero on the edge."""
        (x, y), _, corners = getattr(self, event)(alpha)
        (x0, y0), (x1, y1) = corners[edge], corners[(edge + 1) % 3]
        return (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)

    def root(self, event: str, edge: int, *guess):
        """Return the angle of the bill (rad) at which E1 or E2 passes the line of an edge, to all digits."""
        return mp.findroot(lambda alpha: self.side(event, edge, alpha), tuple(map(mp.mpf, guess)))

    def depth(self, alpha):
        """Return the depth of S10 beyond the disc's plane with the jaw locked at 270 degrees (eq 18); positive interferes."""
        return self.bill_in_seat(rotation("j", self.jaw_open) * self.points["S10"] - self.jaw_offset(), alpha)[1]


I, J, K = np.eye(3)  # noqa: E741


def rotated(axis: str, angle: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Rotate vectors by the matrices of eqs 1 to 3, for arrays of angles."""
    c, s = np.cos(angle), np.sin(angle)
    ones, zeros = np.ones_like(c), np.zeros_like(c)
    rows = {
        "i": [[ones, zeros, zeros], [zeros, c, -s], [zeros, s, c]],
        "j": [[c, zeros, s], [zeros, ones, zeros], [-s, zeros, c]],
        "k": [[c, -s, zeros], [s, c, zeros], [zeros, zeros, ones]],
    }[axis]
    return np.einsum("ij...,...j->...i", np.array(rows), vector)


def disc_to_bill(r: np.ndarray, alpha: np.ndarray, size: dict, sense: dict, beta: np.ndarray) -> np.ndarray:
    """Transform vectors (..., 3) from disc to bill by eq 9 with explicit senses."""
    ones, e = np.ones_like(alpha), sense["alpha"]
    r = rotated("j", sense["beta"] * beta, np.broadcast_to(r, (*np.shape(alpha), 3))) - size["D"] * J
    r = rotated("i", -e * size["alpha1"] * ones, r) - size["d1"] * K + size["d5"] * I
    r = rotated("j", size["alpha2"] * ones, rotated("i", -e * size["alpha3"] * ones, r)) + size["d6"] * K
    return rotated("k", alpha, r)


class RandomKnotter:
    """A knotter with random dimensions and laws, by the printed equations and their inverses."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        names = ("alpha1", "alpha2", "alpha3", "d1", "D", "d5", "d6", "d9", "d10")
        low = (-0.5, -0.5, -0.5, 40, -100, 20, 80, -30, -30)
        high = (0.8, 0.5, 0.8, 250, 100, 120, 200, 30, 30)
        self.size = dict(zip(names, map(float, random.uniform(low, high))))
        self.sense = {name: int(random.choice([-1, 1])) for name in ("alpha", "beta")}
        scatter = random.choice([0.0, 10.0, 40.0])
        nominal = {"S0": (-30.0 * np.sin(np.radians(15.0)), 0.0, 30.0 * np.cos(np.radians(15.0))), **POINTS}
        self.points = {name: tuple(xyz + random.normal(size=3) * scatter) for name, xyz in nominal.items()}
        if random.random() < 0.6:
            self.points |= {name: tuple(random.normal(size=3) * 50) for name in ("S3", "S5")}
        knots = np.concatenate([[-1.0], np.sort(random.uniform(-1, 8, 6)), [8.0]])
        angles = random.uniform(-3, 3, 8)
        self.kind = ("lead", "linear", "pchip")[seed % 3]
        self.rows = tuple(knots), tuple(angles)
        self.lead, self.ratio = map(float, random.uniform(-3, 3, 2)) if self.kind == "lead" else (0.0, 0.0)
        self.beta = {
            "lead": lambda alpha: self.lead + self.ratio * alpha,
            "linear": lambda alpha: np.interp(alpha, knots, angles),
            "pchip": PchipInterpolator(knots, angles),
        }[self.kind]
        self.jaw = (random.uniform(4, 4.8), random.uniform(5, 6)), tuple(random.uniform(-1, 1, 2))

    def alpha4(self, alpha: np.ndarray) -> np.ndarray:
        return np.interp(alpha, *self.jaw)

    def corners(self, name: str, alpha: np.ndarray) -> list[np.ndarray]:
        """Return the ends of the rope and the vertices of the triangle, in u4 (wrap) or u5 (bite)."""
        size, shape = self.size, (*np.shape(alpha), 3)
        points = {name: np.broadcast_to(xyz, shape) for name, xyz in self.points.items()}
        disc = disc_to_bill(points["S0"], alpha, size, self.sense, self.beta(alpha))
        if name == "wrap":
            return [disc, points["S1"], points["S3"], points["S4"], points["S5"]]
        p, q, s9 = (
            rotated("j", -self.alpha4(alpha), x + size["d9"] * I + size["d10"] * K)
            for x in (disc, points["S7"], points["S9"])
        )
        return [p, q, 0 * disc, points["S8"], s9]

    def inside_coordinates(self, name: str, alpha: np.ndarray) -> np.ndarray:
        """Return five numbers (last axis) that are all positive if the rope crosses the inside of the triangle.

        They are the barycentric coordinates u, v and 1 - u - v in the triangle, and t and 1 - t along the rope.
        """
        p, q, a, b, c = self.corners(name, alpha)
        system = np.stack([b - a, c - a, p - q], axis=-1)
        u, v, t = np.moveaxis(np.linalg.solve(system, (p - a)[..., None])[..., 0], -1, 0)
        return np.stack([v, 1 - u - v, u, t, 1 - t], axis=-1)  # for the edges ab, bc, ca and the ends p, q

    def jaw_in_seat(self, alpha: np.ndarray, locked: bool) -> np.ndarray:
        """Return S10 in the frame of the disc's bearing."""
        size, e, ones = self.size, self.sense["alpha"], np.ones_like(alpha)
        alpha4 = self.alpha4(np.radians(270.0) * ones if locked else alpha)
        r = rotated("j", alpha4, np.broadcast_to(self.points["S10"], (*np.shape(alpha), 3)))
        r = rotated("k", -alpha, r - size["d9"] * I - size["d10"] * K) - size["d6"] * K
        r = rotated("i", e * size["alpha3"] * ones, rotated("j", -size["alpha2"] * ones, r))
        return rotated("i", e * size["alpha1"] * ones, r + size["d1"] * K - size["d5"] * I) + size["D"] * J
