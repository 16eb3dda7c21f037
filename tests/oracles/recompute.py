"""The errors of a reply and the limits it breaks, recomputed from its JSON numbers by other means than the software's own.

Nothing of the software is imported. The loop is closed by intersecting two circles, in mpmath at `DIGITS` digits, where the
software uses half-angle formulas in double precision; so agreement of both is no tautology, also near change points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from mpmath import mp, mpf

DIGITS = 50
REACHED = 1e-9
"""An objective below this is an exact answer."""
LINKS = ("crank", "coupler", "rocker", "ground")


class Angles(NamedTuple):
    """Coupler angle and direction of a linkage at crank angles, in high precision."""

    theta2: list[Any]
    """Continuous in the crank angle."""
    direction: list[tuple[Any, Any]]
    """Cosine and sine of theta2."""


class Recomputed(NamedTuple):
    """Errors of a solution: angles in radians, positions in the user's unit; None for quantities without a target."""

    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float


def close_by_circles(links: Sequence[Any], branch: int, crank: Sequence[Any]) -> Angles | None:
    """The loop by intersection of the circles about D (coupler) and B (rocker).

    Parameters
    ----------
    links : sequence of 4 numbers
        Crank, coupler, rocker, ground, taken as they are: floats or more digits.
    branch : +1 or -1
        +1: C lies to the left of D->B.
    crank : sequence
        theta1 in radians.

    Returns
    -------
    Angles or None
        None where the circles do not meet at some sample. Law: ``L1 e^{i t1} + L2 e^{i t2} - L4`` has the length L3.
    """
    with mp.workdps(DIGITS):
        l1, l2, l3, l4 = (mpf(value) for value in links)
        theta2, direction = [], []
        for t in crank:
            cosine, sine = mp.cos_sin(mpf(t))
            vx, vy = l4 - l1 * cosine, -l1 * sine
            square = vx * vx + vy * vy
            if square == 0:
                return None
            along = (square + l2 * l2 - l3 * l3) / (2 * square)
            across2 = l2 * l2 / square - along * along
            if across2 < 0:
                return None
            across = branch * mp.sqrt(across2)
            cx, cy = along * vx - across * vy, along * vy + across * vx
            direction.append((cx / l2, cy / l2))
            if l1 <= l4:
                toward = mp.atan2(vy, vx)
            else:  # B - D = -e^{i t1} (L1 - L4 e^{-i t1}): this bracket stays in the right half plane
                toward = mpf(t) + mp.pi + mp.atan2(l4 * sine, l1 - l4 * cosine)
            theta2.append(toward + mp.atan2(across, along))
        return Angles(theta2, direction)


def requested_crank(request: Mapping[str, Any]) -> list[Any]:
    """Crank angles of a request's samples, from 0 on, in radians."""
    with mp.workdps(DIGITS):
        unit = _unit(request)
        samples = len(request.get("rotation") or request["position"])
        if request.get("crank_angle") is not None:
            angles = [mpf(float(value)) for value in request["crank_angle"]]
            return [(angle - angles[0]) * unit for angle in angles]
        return [mpf(float(request["crank_span"])) * m / (samples - 1) * unit for m in range(samples)]


def recompute(request: Mapping[str, Any], solution: Mapping[str, Any]) -> Recomputed | None:
    """Return the errors of a solution of a reply against the request; None if it does not close at every sample."""
    with mp.workdps(DIGITS):
        unit = _unit(request)
        links = [solution["links"][name] for name in LINKS]
        start = mpf(float(solution["start_angle"])) * unit
        crank = [start + t for t in requested_crank(request)]
        closed = close_by_circles(links, solution["branch"], crank)
        if closed is None:
            return None
        mount = solution["mount"]
        ground = mpf(float(mount["ground_angle"])) * unit if mount is not None else mpf(0)
        rotation_rms = rotation_max = position_rms = position_max = None
        square = mpf(0)
        if request.get("rotation") is not None:
            # the reply means theta2 in (-180, 180] degrees at the first sample, continuous from there
            turns = mp.ceil((closed.theta2[0] - mp.pi) / (2 * mp.pi))
            shift = ground + mpf(float(solution["body_offset"])) * unit - 2 * mp.pi * turns
            gaps = [
                mpf(float(expected)) * unit - angle - shift
                for expected, angle in zip(request["rotation"], closed.theta2)
            ]
            if abs(abs(closed.theta2[0] - 2 * mp.pi * turns) - mp.pi) < mpf("1e-9"):  # at the seam both readings hold
                turn = 2 * mp.pi * mp.nint(gaps[0] / (2 * mp.pi))
                gaps = [gap - turn for gap in gaps]
            rotation_rms, rotation_max = _rms_and_max(gaps)
            square += rotation_rms**2
        if request.get("position") is not None:
            points = body_points(links[0], mount, unit, ground, crank, closed)
            gaps = [
                mp.hypot(mpf(float(x)) - px, mpf(float(y)) - py)
                for (x, y), (px, py) in zip(request["position"], points)
            ]
            position_rms, position_max = _rms_and_max(gaps)
            square += (position_rms / _length_scale(request)) ** 2
        errors = (rotation_rms, rotation_max, position_rms, position_max)
        return Recomputed(*(None if value is None else float(value) for value in errors), float(mp.sqrt(square)))


class Compared(NamedTuple):
    """A solution's recomputed J, and the differences of its reported errors, in the objective's measure."""

    objective: float
    gap: float
    size: float
    """Largest length or distance in the solution over the length scale: the gap cannot be below its rounding."""


def compare(request: Mapping[str, Any], solution: Mapping[str, Any]) -> Compared:
    """Compare reported with recomputed errors of a solution of a request in degrees."""
    mine = recompute(request, solution)
    if mine is None:
        return Compared(np.inf, np.inf, 1.0)
    reported, unit, size = solution["errors"], np.pi / 180, 1.0
    gaps = [abs(reported["objective"] - mine.objective)]
    if mine.rotation_rms is not None:
        gaps += [abs(reported[name] * unit - getattr(mine, name)) for name in ("rotation_rms", "rotation_max")]
    if mine.position_rms is not None:
        with mp.workdps(DIGITS):
            scale = float(_length_scale(request))
        gaps += [abs(reported[name] - getattr(mine, name)) / scale for name in ("position_rms", "position_max")]
        mount = solution["mount"]
        lengths = [*solution["links"].values(), mount["coupler_point_polar"]["radius"]]
        points = [mount["pivot_a"], mount["pivot_b"], request["position"][0]]
        size = max(1.0, max(lengths) / scale, *(math.hypot(*point) / scale for point in points))
    return Compared(mine.objective, max(gaps), size)


DENSE = 20_001
"""Crank angles at which limits are looked at."""


def broken_limits(request: Mapping[str, Any], solution: Mapping[str, Any]) -> list[str]:
    """Return names of the limits that a solution violates, on `DENSE` crank angles over the used interval and over
    the turn.

    The preset "practical" is expanded; angles in degrees. Prescribed pivots and lengths must be met to 1e-12 of
    the linkage's size; the other limits to the last bit, angles to 1e-9 degrees.
    """
    limits, broken = practical(request) | request["limits"], []
    links = np.array([solution["links"][name] for name in LINKS])
    l1, _, _, l4 = links
    if "link_min" in limits and links.min() < limits["link_min"]:
        broken.append("link_min")
    if "link_max" in limits and links.max() > limits["link_max"]:
        broken.append("link_max")
    if "link_ratio_max" in limits and links.max() > limits["link_ratio_max"] * links.min():
        broken.append("link_ratio_max")
    for name, length in limits.get("links", {}).items():
        if abs(solution["links"][name] - length) > 1e-12 * links.max():
            broken.append(f"links.{name}")
    # Grashof: shortest + longest < the other two, in exact arithmetic; the family is named by the shortest link
    shortest, *middle, longest = sorted(Fraction(float(value)) for value in links)
    grashof = shortest + longest < sum(middle)
    crank_rocker, double_crank = grashof and l1 == links.min(), grashof and l4 == links.min()
    allowed = {
        "full_crank": crank_rocker or double_crank,
        "crank_rocker": crank_rocker,
        "double_crank": double_crank,
        "any": True,
    }
    swings = (
        request.get("timing") == "free" and not request.get("closed") and "transmission_angle_min_turn" not in limits
    )
    if not allowed[limits.get("family", "any" if swings else "full_crank")]:
        broken.append("family")
    fine = np.radians(solution["start_angle"]) + _used(request, solution)
    smallest = _transmission(links, fine)
    if smallest is None:
        broken.append("closure")
    elif smallest < limits.get("transmission_angle_min", 0.0) - 1e-9:
        broken.append("transmission_angle_min")
    if (crank_rocker or double_crank) and "transmission_angle_min_turn" in limits:
        turn = _transmission(links, np.linspace(0, 2 * np.pi, DENSE))
        if turn is None or turn < limits["transmission_angle_min_turn"] - 1e-9:
            broken.append("transmission_angle_min_turn")
    if smallest is not None and solution.get("mount"):
        broken += _broken_places(limits, solution, links, fine)
    return broken


def practical(request: Mapping[str, Any]) -> dict[str, Any]:
    """Return the limits of the preset "practical", if a request of poses or points names it."""
    if request["limits"].get("preset") != "practical":
        return {}
    xs, ys = zip(*(position for position in request["position"] if position is not None))
    middle = complex(sum(xs) / len(xs), sum(ys) / len(ys))
    distant = 10 * max(abs(complex(x, y) - middle) for x, y in zip(xs, ys))
    distant = max(distant, 2 * request["limits"].get("link_min", 0.0))
    angles = {"transmission_angle_min": 35.0, "transmission_angle_min_turn": 15.0}
    return angles | {"link_ratio_max": 10.0, "link_max": distant, "pivot_reach": (middle, distant)}


def _used(request: Mapping[str, Any], solution: Mapping[str, Any]) -> np.ndarray:
    """Crank angles of the used interval from the first sample on, in radians, densely."""
    if request.get("timing") == "free":
        crank = np.radians(solution["crank_angle"])
    else:
        crank = np.array([float(t) for t in requested_crank(request)])
    return np.linspace(crank.min(), crank.max(), DENSE)


def _transmission(links: np.ndarray, theta1: np.ndarray) -> float | None:
    """Least transmission angle in degrees; None where the linkage opens."""
    l1, l2, l3, l4 = links
    square = l1**2 + l4**2 - 2 * l1 * l4 * np.cos(theta1)
    cosine = (l2**2 + l3**2 - square) / (2 * l2 * l3)
    if np.abs(cosine).max() > 1 + 1e-9:
        return None
    return float(np.degrees(np.arccos(np.minimum(np.abs(cosine), 1.0)).min()))


def _broken_places(
    limits: Mapping[str, Any], solution: Mapping[str, Any], links: np.ndarray, theta1: np.ndarray
) -> list[str]:
    """The limits on pivots, body point and joints that a mounted solution breaks."""
    broken, mount = [], solution["mount"]
    a, b = (complex(*mount[name]) for name in ("pivot_a", "pivot_b"))
    size = max(links.max(), abs(a), abs(b))
    for name, pivot in (("pivot_a", a), ("pivot_b", b)):
        if name in limits and abs(pivot - complex(*limits[name])) > 1e-12 * size:
            broken.append(name)
        for box in (f"{name}_box", "pivot_box"):
            if box in limits and not _in_box(pivot, limits[box]):
                broken.append(box)
        placed = {name, f"{name}_box", "pivot_box", "envelope"} & limits.keys()
        middle, distant = limits.get("pivot_reach", (a, np.inf))
        if not placed and abs(pivot - middle) > distant * (1 + 1e-12):
            broken.append("pivot_reach")
        for out in limits.get("keep_out", []):
            if out[0] < pivot.real < out[2] and out[1] < pivot.imag < out[3]:
                broken.append("keep_out")
    point = mount["coupler_point_polar"]
    if "coupler_radius_max" in limits and point["radius"] > limits["coupler_radius_max"]:
        broken.append("coupler_radius_max")
    if "envelope" in limits:
        # the coupler pin by circles about crank pin and pivot B, on the solution's side
        turned = np.exp(1j * np.radians(mount["ground_angle"]))
        pin = a + links[0] * np.exp(1j * theta1) * turned
        gap = b - pin
        along = (links[1] ** 2 - links[2] ** 2 + np.abs(gap) ** 2) / (2 * np.abs(gap))
        aside = np.sqrt(np.maximum(links[1] ** 2 - along**2, 0.0))
        joint = pin + (along + 1j * solution["branch"] * aside) * gap / np.abs(gap)
        body = pin + point["radius"] * np.exp(1j * np.radians(point["angle"])) * (joint - pin) / links[1]
        # the box is met between the examined angles too: to the sagitta of a step
        spare = 1e-9 * size
        if not all(_in_box(positions, limits["envelope"], spare) for positions in (a, b, pin, joint, body)):
            broken.append("envelope")
    return broken


def _in_box(positions: Any, box: Sequence[float], spare: float = 0.0) -> bool:
    xmin, ymin, xmax, ymax = box
    x, y = np.real(positions), np.imag(positions)
    return bool(np.all((x >= xmin - spare) & (x <= xmax + spare) & (y >= ymin - spare) & (y <= ymax + spare)))


def _unit(request: Mapping[str, Any]) -> Any:
    return mpf(1) if request.get("angle_unit", "deg") == "rad" else mp.pi / 180


def body_points(
    crank_length: float, mount: Mapping[str, Any], unit: Any, ground: Any, crank: list[Any], closed: Angles
) -> list[tuple[Any, Any]]:
    """Return positions of the body point at crank angles, see `Angles`; ``ground`` is the ground's angle in radians."""
    ax, ay = (mpf(float(value)) for value in mount["pivot_a"])
    radius = mpf(float(mount["coupler_point_polar"]["radius"]))
    arm_cos, arm_sin = mp.cos_sin(mpf(float(mount["coupler_point_polar"]["angle"])) * unit + ground)
    points = []
    for t, (cosine2, sine2) in zip(crank, closed.direction):
        cosine, sine = mp.cos_sin(t + ground)
        x = ax + mpf(float(crank_length)) * cosine + radius * (arm_cos * cosine2 - arm_sin * sine2)
        y = ay + mpf(float(crank_length)) * sine + radius * (arm_cos * sine2 + arm_sin * cosine2)
        points.append((x, y))
    return points


def _length_scale(request: Mapping[str, Any]) -> Any:
    if request.get("length_scale") is not None:
        return mpf(float(request["length_scale"]))
    xs, ys = ([mpf(float(point[k])) for point in request["position"]] for k in (0, 1))
    x, y = sum(xs) / len(xs), sum(ys) / len(ys)
    return max(mp.hypot(a - x, b - y) for a, b in zip(xs, ys))


def _rms_and_max(values: list[Any]) -> tuple[Any, Any]:
    return mp.sqrt(sum(value * value for value in values) / len(values)), max(abs(value) for value in values)
