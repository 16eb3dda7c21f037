"""The knotter's equations typed out as printed, apart from the product: with mpmath, and with numpy for random machines.

Equation numbers are those of Zhang et al., Transactions of the CSAM 49(8), 2018. Degrees at the interface of `Exact`.
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
"""The assumed inputs (REF); S0 is 30 from the disc's axis, at 15 degrees."""


def rotation(axis: str, angle) -> mp.matrix:
    """Eqs 1 to 3, the angle in radians."""
    c, s = mp.cos(angle), mp.sin(angle)
    rows = {
        "i": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "j": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "k": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }
    return mp.matrix(rows[axis])


class Exact:
    """A knotter in as many digits as mpmath works with; senses -1, -1.

    Angles are rounded to doubles in radians first, as the product gets them; ``round_angles=False`` keeps degrees exact.
    """

    def __init__(self, alpha1=0, alpha3=0, points=(), round_angles=True, **sizes) -> None:
        radians = (lambda x: mp.mpf(float(np.radians(float(x))))) if round_angles else mp.radians
        given = {**SIZES, **sizes}
        self.alpha1, self.alpha2, self.alpha3 = radians(alpha1), radians(given["alpha2"]), radians(alpha3)
        self.lead, self.hook_open = radians(given["lead"]), radians(22.5)
        self.size = {name: mp.mpf(value) for name, value in given.items()}
        s0 = [-30 * mp.sin(radians(15)), 0, 30 * mp.cos(radians(15))]
        if round_angles:
            s0 = [float(x) for x in (-30.0 * np.sin(np.radians(15.0)), 0.0, 30.0 * np.cos(np.radians(15.0)))]
        self.points = {name: mp.matrix(xyz) for name, xyz in {"S0": s0, **POINTS, **dict(points)}.items()}

    def disc_in_bill(self, alpha) -> mp.matrix:
        """S0 in u4 (eq 9)."""
        size = self.size
        r = rotation("j", -(self.lead + size["ratio"] * alpha)) * self.points["S0"] - mp.matrix([0, size["D"], 0])
        r = rotation("i", self.alpha1) * r + mp.matrix([size["d5"], 0, -size["d1"]])
        r = rotation("j", self.alpha2) * (rotation("i", self.alpha3) * r) + mp.matrix([0, 0, size["d6"]])
        return rotation("k", alpha) * r

    def bill_in_seat(self, r: mp.matrix, alpha) -> mp.matrix:
        """A point of the bill from the disc's bearing: the inverse of eq 9, which eq 17 is meant to be."""
        size = self.size
        r = rotation("j", -self.alpha2) * (rotation("k", -alpha) * r - mp.matrix([0, 0, size["d6"]]))
        r = rotation("i", -self.alpha3) * r - mp.matrix([size["d5"], 0, -size["d1"]])
        return rotation("i", -self.alpha1) * r + mp.matrix([0, size["D"], 0])

    def alpha4(self, alpha):
        """The hook's angle: 22.5 degrees until 270, then evenly to 0 at 337."""
        share = 1 - (alpha - mp.radians(270)) / mp.radians(67)
        return self.hook_open * min(max(share, 0), 1)

    def hook_offset(self) -> mp.matrix:
        return mp.matrix([self.size["d9"], 0, self.size["d10"]])

    def bill_in_hook(self, r: mp.matrix, alpha) -> mp.matrix:
        """Eqs 22 to 24."""
        return rotation("j", -self.alpha4(alpha)) * (r + self.hook_offset())

    def wrap(self, alpha) -> tuple:
        """E1 in the plane i4 = 0 (eq 11), where it lies on the rope, and the corners of its triangle."""
        p, q = self.disc_in_bill(alpha), self.points["S1"]
        t = p[0] / (p[0] - q[0])
        at = p + t * (q - p)
        return (at[1], at[2]), t, [(self.points[name][1], self.points[name][2]) for name in ("S3", "S4", "S5")]

    def bite(self, alpha) -> tuple:
        """E2 in the plane j5 = 0 (eq 26), where it lies on the rope, and the corners of its triangle."""
        p, q, s9 = (
            self.bill_in_hook(r, alpha) for r in (self.disc_in_bill(alpha), self.points["S7"], self.points["S9"])
        )
        t = p[1] / (p[1] - q[1])
        at = p + t * (q - p)
        return (at[0], at[2]), t, [(0, 0), (self.points["S8"][0], self.points["S8"][2]), (s9[0], s9[2])]

    def side(self, event: str, edge: int, alpha):
        """On which side of an edge's line E1 (``wrap``) or E2 (``bite``) lies; zero on it."""
        (x, y), _, corners = getattr(self, event)(alpha)
        (x0, y0), (x1, y1) = corners[edge], corners[(edge + 1) % 3]
        return (x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)

    def root(self, event: str, edge: int, *guess):
        """Where E1 or E2 passes an edge's line, rad, to all digits."""
        return mp.findroot(lambda alpha: self.side(event, edge, alpha), tuple(map(mp.mpf, guess)))

    def depth(self, alpha):
        """S10 past the disc's plane with the hook locked at 270 degrees (eq 18), positive is interference."""
        return self.bill_in_seat(rotation("j", self.hook_open) * self.points["S10"] - self.hook_offset(), alpha)[1]


I, J, K = np.eye(3)  # noqa: E741


def rotated(axis: str, angle: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Eqs 1 to 3 as matrices, one per angle."""
    c, s = np.cos(angle), np.sin(angle)
    one, zero = np.ones_like(c), np.zeros_like(c)
    rows = {
        "i": [[one, zero, zero], [zero, c, -s], [zero, s, c]],
        "j": [[c, zero, s], [zero, one, zero], [-s, zero, c]],
        "k": [[c, -s, zero], [s, c, zero], [zero, zero, one]],
    }[axis]
    return np.einsum("ij...,...j->...i", np.array(rows), vector)


def disc_to_bill(r: np.ndarray, alpha: np.ndarray, size: dict, sense: dict, beta: np.ndarray) -> np.ndarray:
    """Eq 9 with its senses made explicit; ``r`` has the components along its last axis."""
    same, e = np.ones_like(alpha), sense["alpha"]
    r = rotated("j", sense["beta"] * beta, np.broadcast_to(r, (*np.shape(alpha), 3))) - size["D"] * J
    r = rotated("i", -e * size["alpha1"] * same, r) - size["d1"] * K + size["d5"] * I
    r = rotated("j", size["alpha2"] * same, rotated("i", -e * size["alpha3"] * same, r)) + size["d6"] * K
    return rotated("k", alpha, r)


class Twin:
    """One knotter at random, its equations and their inverses typed out."""

    def __init__(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        names = ("alpha1", "alpha2", "alpha3", "d1", "D", "d5", "d6", "d9", "d10")
        low = (-0.5, -0.5, -0.5, 40, -100, 20, 80, -30, -30)
        high = (0.8, 0.5, 0.8, 250, 100, 120, 200, 30, 30)
        self.size = dict(zip(names, map(float, random.uniform(low, high))))
        self.sense = {name: int(random.choice([-1, 1])) for name in ("alpha", "beta")}
        spread = random.choice([0.0, 10.0, 40.0])
        places = {"S0": (-30.0 * np.sin(np.radians(15.0)), 0.0, 30.0 * np.cos(np.radians(15.0))), **POINTS}
        self.points = {name: tuple(at + random.normal(size=3) * spread) for name, at in places.items()}
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
        self.hook = (random.uniform(4, 4.8), random.uniform(5, 6)), tuple(random.uniform(-1, 1, 2))

    def alpha4(self, alpha: np.ndarray) -> np.ndarray:
        return np.interp(alpha, *self.hook)

    def corners(self, name: str, alpha: np.ndarray) -> list[np.ndarray]:
        """Ends of the rope and corners of the triangle, in u4 (wrap) or u5 (bite)."""
        size, at = self.size, {name: np.broadcast_to(x, (*np.shape(alpha), 3)) for name, x in self.points.items()}
        disc = disc_to_bill(at["S0"], alpha, size, self.sense, self.beta(alpha))
        if name == "wrap":
            return [disc, at["S1"], at["S3"], at["S4"], at["S5"]]
        p, q, s9 = (
            rotated("j", -self.alpha4(alpha), x + size["d9"] * I + size["d10"] * K)
            for x in (disc, at["S7"], at["S9"])
        )
        return [p, q, 0 * disc, at["S8"], s9]

    def shares(self, name: str, alpha: np.ndarray) -> np.ndarray:
        """Positive numbers inside: 1 - u - v, u, v of the triangle, t and 1 - t of the segment; last axis."""
        p, q, a, b, c = self.corners(name, alpha)
        system = np.stack([b - a, c - a, p - q], axis=-1)
        u, v, t = np.moveaxis(np.linalg.solve(system, (p - a)[..., None])[..., 0], -1, 0)
        return np.stack([v, 1 - u - v, u, t, 1 - t], axis=-1)  # the edges ab, bc, ca, then the ends p, q

    def hook_depth(self, alpha: np.ndarray, locked: bool) -> np.ndarray:
        """S10 from the disc's bearing."""
        size, e, same = self.size, self.sense["alpha"], np.ones_like(alpha)
        fourth = self.alpha4(np.radians(270.0) * same if locked else alpha)
        r = rotated("j", fourth, np.broadcast_to(self.points["S10"], (*np.shape(alpha), 3)))
        r = rotated("k", -alpha, r - size["d9"] * I - size["d10"] * K) - size["d6"] * K
        r = rotated("i", e * size["alpha3"] * same, rotated("j", -size["alpha2"] * same, r))
        return rotated("i", e * size["alpha1"] * same, r + size["d1"] * K - size["d5"] * I) + size["D"] * J
