"""The errors of a reply, recomputed from its JSON numbers alone by other means than the software's own.

Nothing of the software is imported. The loop is closed by intersecting two circles, in mpmath at `DIGITS` digits, where the
software uses half-angle formulas in double precision; so agreement of both is no tautology, also near change points.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from mpmath import mp, mpf

DIGITS = 50


class Angles(NamedTuple):
    """Coupler angle and direction of one linkage at crank angles, in high precision."""

    theta2: list[Any]
    """Continuous in the crank angle."""
    direction: list[tuple[Any, Any]]
    """Cosine and sine of theta2."""


class Recomputed(NamedTuple):
    """Errors of one solution: angles in radians, positions in the user's unit; None for what was not asked."""

    rotation_rms: float | None
    rotation_max: float | None
    position_rms: float | None
    position_max: float | None
    objective: float


def close_by_circles(links: Sequence[float], branch: int, crank: Sequence[Any]) -> Angles | None:
    """The loop by intersection of the circles about D (coupler) and B (rocker).

    Parameters
    ----------
    links : sequence of 4 floats
        Crank, coupler, rocker, ground.
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
        l1, l2, l3, l4 = (mpf(float(value)) for value in links)
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
    """Errors of a solution of a reply against the request; None where it does not close at every sample."""
    with mp.workdps(DIGITS):
        unit = _unit(request)
        links = [solution["links"][name] for name in ("crank", "coupler", "rocker", "ground")]
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
                mpf(float(wanted)) * unit - angle - shift for wanted, angle in zip(request["rotation"], closed.theta2)
            ]
            if abs(abs(closed.theta2[0] - 2 * mp.pi * turns) - mp.pi) < mpf("1e-9"):  # at the seam both readings hold
                turn = 2 * mp.pi * mp.nint(gaps[0] / (2 * mp.pi))
                gaps = [gap - turn for gap in gaps]
            rotation_rms, rotation_max = _rms_and_max(gaps)
            square += rotation_rms**2
        if request.get("position") is not None:
            points = _body_points(links[0], mount, unit, ground, crank, closed)
            gaps = [
                mp.hypot(mpf(float(x)) - px, mpf(float(y)) - py)
                for (x, y), (px, py) in zip(request["position"], points)
            ]
            position_rms, position_max = _rms_and_max(gaps)
            square += (position_rms / _length_scale(request)) ** 2
        errors = (rotation_rms, rotation_max, position_rms, position_max)
        return Recomputed(*(None if value is None else float(value) for value in errors), float(mp.sqrt(square)))


def _unit(request: Mapping[str, Any]) -> Any:
    return mpf(1) if request.get("angle_unit", "deg") == "rad" else mp.pi / 180


def _body_points(
    crank_length: float, mount: Mapping[str, Any], unit: Any, ground: Any, crank: list[Any], closed: Angles
) -> list[tuple[Any, Any]]:
    ax, ay = (mpf(float(value)) for value in mount["pivot_a"])
    radius = mpf(float(mount["coupler_point"]["radius"]))
    arm_cos, arm_sin = mp.cos_sin(mpf(float(mount["coupler_point"]["angle"])) * unit + ground)
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
