"""The lift's optimum design: even speed of the platform under the closure constraints, reduced to two variables.

Five lengths, three equations: collinear start (31), closure there (32), stroke (33). In the variables l2 and gamma
(the triangle's angle at A) they are solved *explicitly*. At the start A, B, O lie on a line, so with
psi = atan2(b, sa) the start turn is theta = psi + gamma; and l3 + l5 = sb says that C lies on an ellipse with foci A
and D, whose polar form about A is l3 = (sb^2 - sa^2) / (2 (sb - sa cos theta)). No equation is left to a penalty.

For each l2 the admissible gammas are found as intervals with their ends, and each interval is searched from end to
end; an optimum *on* a constraint, the usual case, is therefore met exactly. The cylinder's speed is set to 1 within:
the objective is then scaled by its square, so speed cannot move the optimum.

Numbers in parentheses are the equations of the source named in `synthesis.lift`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from synthesis.errors import FieldError
from synthesis.lift import EPSILON, Cylinder, Design, dead_point, shape, top_lever, travel_time

Kind = Literal["discrete", "continuous", "normalized"]

GAUSS_NODES = 200
"""Nodes of the height average of the continuous objectives, graded towards the start."""
ARM_NODES = 48
"""Values of l2 in each of the even and the geometric grid of the global search."""
ANGLE_NODES = 129
"""Values of gamma on which the admissible intervals are isolated."""
FIRST_LOOK, CLOSER_LOOK = 17, 9
"""Points across an interval at first, and at each closer look (which narrows it by a factor of four)."""
INNER_LOOKS, OUTER_LOOKS = 12, 12
CANDIDATES = 3
"""Local optima over l2 that are followed to the end."""
BLOCK = 1 << 19
"""Poses that are evaluated at a time: bounds the memory."""
ACTIVE = 1e-7
"""A constraint is active when its slack is below this share of the top height."""
STRICT = 1e-9
"""Share of the range that is kept away from open ends (the strict inequalities (34), (36), (37))."""


@dataclass(frozen=True)
class Objective:
    """What is minimised: the variance of the platform's speed over height.

    ``discrete``: the mean over n + 1 even heights, the lowest one included; without it when `include_start` is
    False, as (30) prints it. ``continuous``: the integral (28). ``normalized``: that divided by the squared mean
    speed (29), which no longer rewards slowness.
    """

    kind: Kind
    n: int = 310
    include_start: bool = True


@dataclass(frozen=True)
class Task:
    """One optimisation: the drive, the stroke from `low` to `high`, the objective and the bound on all five lengths."""

    cylinder: Cylinder
    low: float
    high: float
    objective: Objective
    upper_bound: float


@dataclass(frozen=True)
class Optimum:
    """The best design of a task, its objective, the active inequalities by name and the slacks of all of them."""

    design: Design
    objective: float
    active: tuple[str, ...]
    slacks: dict[str, float]
    equations: dict[str, float]
    duration: float
    velocity_bottom: float
    mean_velocity: float
    evaluations: int


def design_from_angle(l2: Any, gamma: Any, length: Any, low: Any, high: Any) -> Design:
    """The design that meets (31), (32) and (33), from its two free variables; arrays broadcast.

    Law: `equation_residuals` is 0 to rounding. NaN where l1' + l2 does not reach past `low`.
    """
    l2, gamma = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(gamma, dtype=float))
    b = _base(l2, length, low)
    theta = np.arctan2(b, low) + gamma
    # sb - sa cos(theta) as a sum of positive terms
    l3 = (high - low) * (high + low) / (2 * ((high - low) + 2 * low * np.sin(0.5 * theta) ** 2))
    l4 = np.sqrt((l2 - l3) ** 2 + 4 * l2 * l3 * np.sin(0.5 * gamma) ** 2)
    return Design(l2, l3, l4, high - l3, b)


def _base(l2: np.ndarray, length: Any, low: Any) -> np.ndarray:
    square = (length + l2 - low) * (length + l2 + low)
    return np.sqrt(np.where(square > 0, square, np.nan))


def project(l2: Any, l4: Any, length: float, low: float, high: float) -> Design:
    """The design with given l2 and l4 that meets (31)-(33); arrays broadcast, NaN where there is none.

    Almost always one root at most is a lift (l3 < l5, l3 <= l2); if there are more, the one with the least l3.
    """
    l2, l4 = np.broadcast_arrays(np.asarray(l2, dtype=float), np.asarray(l4, dtype=float))
    arms, sides = l2.reshape(-1), l4.reshape(-1)
    limit = np.pi - np.arctan2(_base(arms, length, low), low)
    gammas = np.linspace(STRICT, 1 - STRICT, 2 * ANGLE_NODES - 1) * limit[:, None]
    excess = design_from_angle(arms[:, None], gammas, length, low, high).l4 - sides[:, None]
    row, at = np.nonzero((excess[:, :-1] < 0) != (excess[:, 1:] < 0))
    row, at = row[~np.isnan(excess[row, at])], at[~np.isnan(excess[row, at])]
    left, right = gammas[row, at], gammas[row, at + 1]
    starts_below = excess[row, at] < 0
    for _ in range(60):
        middle = 0.5 * (left + right)
        below = design_from_angle(arms[row], middle, length, low, high).l4 < sides[row]
        left, right = np.where(below == starts_below, middle, left), np.where(below == starts_below, right, middle)
    found = design_from_angle(arms[row], 0.5 * (left + right), length, low, high)
    l3 = np.full(arms.shape, np.nan)
    lifts = (found.l3 < found.l5) & (found.l3 <= found.l2 * (1 + EPSILON))
    np.fmin.at(l3, row[lifts], found.l3[lifts])
    l3 = l3.reshape(l2.shape)
    base = np.where(np.isnan(l3), np.nan, _base(l2, length, low))
    wanted = [np.where(np.isnan(l3), np.nan, value) for value in (l2, l4)]
    return Design(wanted[0][()], l3[()], wanted[1][()], (high - l3)[()], base[()])


def equation_residuals(design: Design, length: Any, low: Any, high: Any) -> dict[str, Any]:
    """By how much a design fails (31), (32) and (33), each as a length (start height, l5 and stroke)."""
    start = np.sqrt(np.maximum((length + design.l2 - design.b) * (length + design.l2 + design.b), 0.0))
    theta = np.arctan2(design.b, low) + shape(design).gamma
    l5 = np.sqrt((design.l3 - low) ** 2 + 4 * low * design.l3 * np.sin(0.5 * theta) ** 2)
    return {"(31) start": start - low, "(32) closure": l5 - design.l5, "(33) stroke": design.l3 + design.l5 - high}


def _slacks(design: Design, task: Task) -> dict[str, np.ndarray]:
    """Slack of each inequality as a length, negative where it fails."""
    bound = task.upper_bound
    slacks = {
        "l3<l5": design.l5 - design.l3,
        "l3<=l2": design.l2 - design.l3,
        "l4<=l2": design.l2 - design.l4,
        "l2<=upper_bound": bound - design.l2,
        "l5<=upper_bound": bound - design.l5,
        "b<=upper_bound": bound - design.b,
    }
    drive = task.cylinder
    along = drive.acceleration * np.sign(drive.speed)
    if along < 0:
        slacks["stopping"] = drive.speed**2 / (-2 * along) - _travel(design, task)
    return slacks


def _travel(design: Design, task: Task) -> np.ndarray:
    form = shape(design)
    x, y = design.b + design.l2 * form.sin_gamma, task.high - design.l2 * form.cos_gamma
    return np.hypot(x, y) - task.cylinder.length


# -- the objective ---------------------------------------------------------------------------------------------------


def speeds_at_turn(design: Design, cylinder: Cylinder, sin_turn: Any, cos_turn: Any) -> tuple[Any, Any]:
    """Speed of the platform and ds/dT, from sine and cosine of the turn; negative past a dead point.

    `pose_at_turn` without second derivatives, and with the cylinder's speed taken from its length.
    """
    form = shape(design)
    l2, l3 = design.l2, design.l3
    level = l3 * cos_turn
    root = np.sqrt(form.k_squared + level * level)
    both = root + np.abs(level)
    s = np.where(level >= 0, both, form.k_squared / both)
    s_1 = -l3 * sin_turn * s / root
    down = l2 * (cos_turn * form.cos_gamma + sin_turn * form.sin_gamma)
    across = l2 * (sin_turn * form.cos_gamma - cos_turn * form.sin_gamma)
    y = s - down
    # x x' + y y', in which two products cancel each other
    rate = across * s - design.b * down + s_1 * y
    length = np.hypot(across - design.b, y)
    gain = np.divide(length * s_1, rate, out=np.full(np.broadcast(length, rate).shape, np.inf), where=rate != 0)
    speed = abs(cylinder.speed)
    along = cylinder.acceleration * np.sign(cylinder.speed)
    if along:
        covered = length - cylinder.length
        if cylinder.speed < 0:
            top = np.hypot(design.b + l2 * form.sin_gamma, l3 + design.l5 - l2 * form.cos_gamma)
            covered = top - length
        speed = np.sqrt(np.maximum(speed * speed + 2 * along * covered, 0.0))
    return speed * gain, s_1


class Evaluator:
    """The objective of a task for batches of designs; counts what it evaluates."""

    def __init__(self, task: Task) -> None:
        self.task = task
        self.evaluations = 0
        objective = task.objective
        if objective.kind == "discrete":
            steps = np.arange(0 if objective.include_start else 1, objective.n + 1) / objective.n
            self._heights = task.low + steps * (task.high - task.low)
            self._weights = np.ones(steps.size)
        else:
            z, weights = np.polynomial.legendre.leggauss(GAUSS_NODES)
            z, weights = 0.5 * (z + 1), 0.5 * weights
            self._fractions, self._weights = 1 - z**3, 3 * z * z * weights

    def __call__(self, design: Design) -> np.ndarray:
        """The objective of each design, shape of its fields; infinite where the platform would pass a dead point."""
        fields = np.broadcast_arrays(*(np.asarray(value, dtype=float) for value in design.as_tuple()))
        flat = [field.reshape(-1) for field in fields]
        values = np.empty(flat[0].shape)
        rows = max(1, BLOCK // self._weights.size)
        for start in range(0, values.size, rows):
            block = slice(start, start + rows)
            values[block] = self._moments(Design(*(field[block, None] for field in flat)))[0]
        self.evaluations += values.size
        return values.reshape(fields[0].shape)[()]

    def mean_velocity(self, design: Design) -> float:
        """The mean over height (29) that the objective uses, of one design."""
        return float(self._moments(Design(*(np.asarray([[value]], dtype=float) for value in design.as_tuple())))[1][0])

    def _moments(self, design: Design) -> tuple[np.ndarray, np.ndarray]:
        task = self.task
        if task.objective.kind == "discrete":
            s = self._heights
            # the triangle ADC, as in `synthesis.lift.pose_at_height`; rounding past an end counts as the end
            down = np.maximum((design.l5 + (design.l3 - s)) * (design.l5 - (design.l3 - s)), 0.0)
            up = np.maximum(((s - design.l5) + design.l3) * (s + design.l3 + design.l5), 0.0)
            product = 4 * design.l3 * s
            sin_turn, cos_turn = 2 * np.sqrt(down * up) / product, (up - down) / product
            weights = self._weights
        else:
            theta = np.arctan2(design.b, task.low) + shape(design).gamma
            turn = theta * self._fractions
            sin_turn, cos_turn = np.sin(turn), np.cos(turn)
            weights = self._weights * theta
        v, s_1 = speeds_at_turn(design, task.cylinder, sin_turn, cos_turn)
        if task.objective.kind != "discrete":
            weights = -weights * s_1
        works = np.all((v >= 0) & np.isfinite(v), axis=1) & (top_lever(design)[:, 0] > 0)
        v = np.where(works[:, None], v, 1.0)
        total = np.where(works[:, None], np.sum(weights, axis=-1, keepdims=True), 1.0)
        mean = np.sum(weights * v, axis=1, keepdims=True) / total
        variance = np.sum(weights * (v - mean) ** 2, axis=1, keepdims=True) / total
        if task.objective.kind == "normalized":
            variance = np.divide(variance, mean * mean, out=np.full(mean.shape, np.inf), where=mean > 0)
        return np.where(works, variance[:, 0], np.inf), mean[:, 0]


# -- the search ------------------------------------------------------------------------------------------------------


def optimize(task: Task) -> Optimum:
    """The global optimum of a task; deterministic, no random start.

    Global: the best gamma for each of about a hundred values of l2 (even and geometric grid). Local: the best few
    valleys are narrowed around their best l2, each value again with its best gamma.

    Raises
    ------
    FieldError
        Where no design is admissible: ``constraint`` and ``amount`` are of the one that fails most in the design
        that comes closest; ``violated`` lists all of them.

    Laws: the objective is not above that of any admissible design; it scales with the square of the speed, and the
    design does not change with it; scaling all lengths scales the design.
    """
    check_task(task)
    drive = task.cylinder
    speed = abs(drive.speed)
    unit = Cylinder(drive.length, np.sign(drive.speed), drive.acceleration / speed / speed)
    scaled = Task(unit, task.low, task.high, task.objective, task.upper_bound)
    evaluator = Evaluator(scaled)
    low, high = _arm_range(scaled)
    span = high - low
    if not span > 0:
        raise _infeasible(scaled)
    even = low + span * np.linspace(STRICT, 1.0, ARM_NODES)
    arms = np.union1d(even, low + np.geomspace(min(1e-3 * task.high, 0.5 * span), span, ARM_NODES))
    arms[-1] = high
    values, gammas = _best_angles(arms, evaluator)
    if not np.any(np.isfinite(values)):
        raise _infeasible(scaled)
    padded = np.concatenate([[np.inf], values, [np.inf]])
    valleys = np.nonzero(np.isfinite(values) & (values <= padded[:-2]) & (values <= padded[2:]))[0]
    valleys = valleys[np.argsort(values[valleys], kind="stable")][:CANDIDATES]
    best = (np.inf, 0.0, 0.0)
    for at in valleys:
        best = min(best, _narrow(arms, values, gammas, int(at), evaluator))
    value, arm, gamma = best
    design = Design(*(float(part) for part in design_from_angle(arm, gamma, drive.length, task.low, task.high).as_tuple()))
    scale = 1.0 if task.objective.kind == "normalized" else speed * speed
    slacks = {name: float(slack) for name, slack in _slacks(design, task).items()}
    theta = np.arctan2(design.b, task.low) + gamma
    bottom, _ = speeds_at_turn(design, drive, np.sin(theta), np.cos(theta))
    return Optimum(
        design=design,
        objective=value * scale,
        active=tuple(name for name, slack in slacks.items() if slack <= ACTIVE * task.high),
        slacks=slacks,
        equations={k: float(v) for k, v in equation_residuals(design, drive.length, task.low, task.high).items()},
        duration=float(travel_time(_travel(design, task), drive.speed, drive.acceleration)),
        velocity_bottom=float(bottom) * float(np.sign(drive.speed)),
        mean_velocity=evaluator.mean_velocity(design) * speed,
        evaluations=evaluator.evaluations,
    )


def check_task(task: Task) -> None:
    """Refuse what no search is needed for: a cylinder at rest, or a stroke that does not rise."""
    if task.cylinder.speed == 0:
        raise FieldError(
            "/cylinder/speed", "the cylinder stands still: its speed must not be 0", constraint="speed", amount=0.0
        )
    if not task.low < task.high:
        raise FieldError(
            "/stroke",
            f"the stroke must rise: {task.low:.9g} is not below {task.high:.9g}",
            constraint="stroke",
            amount=task.low - task.high,
        )


def _arm_range(task: Task) -> tuple[float, float]:
    """The open lower and closed upper end of l2: b real in (31), and l2 and b within the bound."""
    length, bound = task.cylinder.length, task.upper_bound
    reach = np.hypot(bound, task.low)
    return max(task.low - length, 0.0), min(bound, reach - length)


def _angle_limit(arms: np.ndarray, task: Task) -> np.ndarray:
    """Upper end of gamma: the start turn psi + gamma stays below a half turn, or the platform would fall first."""
    return np.pi - np.arctan2(_base(arms, task.cylinder.length, task.low), task.low)


def _room(arms: np.ndarray, gammas: np.ndarray, task: Task) -> np.ndarray:
    """The least slack of the inequalities that depend on gamma; those of l2 alone are kept by its range."""
    design = design_from_angle(arms, gammas, task.cylinder.length, task.low, task.high)
    slacks = _slacks(design, task)
    del slacks["l2<=upper_bound"], slacks["b<=upper_bound"]
    slacks["l3<l5"] = slacks["l3<l5"] - STRICT * task.high
    return np.minimum.reduce(list(slacks.values()))


def _intervals(arms: np.ndarray, task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The admissible intervals of gamma as (index into arms, lower end, upper end); ends by halving, inside."""
    limit = _angle_limit(arms, task)
    gammas = np.linspace(STRICT, 1 - STRICT, ANGLE_NODES) * limit[:, None]
    inside = _room(arms[:, None], gammas, task) >= 0
    # an interval narrower than the grid shows as a peak of the slack: add the peak's top to the nodes
    missing = np.nonzero(~inside.any(axis=1))[0]
    if missing.size:
        some = arms[missing]
        left, right = gammas[missing, 0], gammas[missing, -1]
        for _ in range(INNER_LOOKS):
            looks = np.linspace(left, right, ANGLE_NODES, axis=1)
            best = np.argmax(_room(some[:, None], looks, task), axis=1)
            pick = np.arange(missing.size)
            middle = looks[pick, best]
            left, right = looks[pick, np.maximum(best - 1, 0)], looks[pick, np.minimum(best + 1, ANGLE_NODES - 1)]
        slot = np.clip(np.sum(gammas[missing] < middle[:, None], axis=1), 0, ANGLE_NODES - 1)
        gammas[missing, slot] = middle
        inside[missing, slot] = _room(some, middle, task) >= 0
    edge = np.zeros((arms.size, 1), dtype=bool)
    steps = np.diff(np.concatenate([edge, inside, edge], axis=1).astype(np.int8), axis=1)
    row, first = np.nonzero(steps == 1)
    _, after = np.nonzero(steps == -1)
    lower = _edge(arms[row], gammas[row, np.maximum(first - 1, 0)], gammas[row, first], task)
    upper = _edge(arms[row], gammas[row, np.minimum(after, ANGLE_NODES - 1)], gammas[row, after - 1], task)
    return row, lower, upper


def _edge(arms: np.ndarray, outside: np.ndarray, inside: np.ndarray, task: Task) -> np.ndarray:
    """The admissible end between an inadmissible and an admissible gamma, to the last bit."""
    for _ in range(60):
        middle = 0.5 * (outside + inside)
        admissible = _room(arms, middle, task) >= 0
        outside, inside = np.where(admissible, outside, middle), np.where(admissible, middle, inside)
    return inside


def _best_angles(arms: np.ndarray, evaluator: Evaluator) -> tuple[np.ndarray, np.ndarray]:
    """The least objective over the admissible gammas, and that gamma, for each l2; infinite where there is none."""
    task = evaluator.task
    values, gammas = np.full(arms.shape, np.inf), np.zeros(arms.shape)
    row, left, right = _intervals(arms, task)
    if not row.size:
        return values, gammas
    pick = np.arange(row.size)
    for look in range(1 + INNER_LOOKS):
        count = FIRST_LOOK if look == 0 else CLOSER_LOOK
        looks = np.linspace(left, right, count, axis=1)
        tried = evaluator(design_from_angle(arms[row][:, None], looks, task.cylinder.length, task.low, task.high))
        best = np.argmin(tried, axis=1)
        left, right = looks[pick, np.maximum(best - 1, 0)], looks[pick, np.minimum(best + 1, count - 1)]
    found, at = tried[pick, best], looks[pick, best]
    for index in range(row.size):
        if found[index] < values[row[index]]:
            values[row[index]], gammas[row[index]] = found[index], at[index]
    return values, gammas


def _narrow(
    arms: np.ndarray, values: np.ndarray, gammas: np.ndarray, at: int, evaluator: Evaluator
) -> tuple[float, float, float]:
    """The best (objective, l2, gamma) of the valley around one value of l2, by closer and closer looks."""
    best = (float(values[at]), float(arms[at]), float(gammas[at]))
    left, right = arms[max(at - 1, 0)], arms[min(at + 1, arms.size - 1)]
    for _ in range(OUTER_LOOKS):
        looks = np.union1d(np.linspace(left, right, CLOSER_LOOK), best[1])
        tried, angles = _best_angles(looks, evaluator)
        index = int(np.argmin(tried))
        best = min(best, (float(tried[index]), float(looks[index]), float(angles[index])))
        index = int(np.argmin(np.abs(looks - best[1])))
        left, right = looks[max(index - 1, 0)], looks[min(index + 1, looks.size - 1)]
    return best


def _infeasible(task: Task) -> FieldError:
    """The error that names the constraint which the closest design fails most."""
    length = task.cylinder.length
    start = max(task.low - length, 0.0)
    reach = 4 * (task.upper_bound + task.high + length)
    arms = np.array([start + STRICT * reach, start + reach])
    fractions = np.array([STRICT, 1 - STRICT])
    worst: dict[str, float] = {}
    for _ in range(INNER_LOOKS):
        tall = np.linspace(arms[0], arms[1], ANGLE_NODES)[:, None]
        wide = np.linspace(fractions[0], fractions[1], ANGLE_NODES)
        design = design_from_angle(tall, wide * _angle_limit(tall, task), length, task.low, task.high)
        slacks = _slacks(design, task)
        least = np.minimum.reduce(list(slacks.values()))
        row, column = np.unravel_index(int(np.argmax(least)), least.shape)
        worst = {name: -float(slack[row, column]) for name, slack in slacks.items() if slack[row, column] <= 0}
        arms = np.clip([tall[max(row - 2, 0), 0], tall[min(row + 2, ANGLE_NODES - 1), 0]], arms[0], arms[1])
        fractions = np.array([wide[max(column - 2, 0)], wide[min(column + 2, ANGLE_NODES - 1)]])
    if worst:
        name = max(worst, key=lambda key: worst[key])
        field = "/cylinder/acceleration" if name == "stopping" else "/upper_bound" if "bound" in name else "/stroke"
        text = ", ".join(f"{key} by {amount:.6g}" for key, amount in worst.items())
        return FieldError(
            field,
            f"no design reaches this stroke: even the one that comes closest fails {text}",
            constraint=name,
            amount=worst[name],
            violated=worst,
        )
    return FieldError(
        "/stroke",
        "no design reaches this stroke without passing a dead point of the cylinder",
        constraint="dead_point",
        amount=0.0,
    )
