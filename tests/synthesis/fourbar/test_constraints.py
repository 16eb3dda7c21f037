"""Limits agree with dense samples of the linkage, and their derivatives with differences.

A limit that is violated between two samples would show here.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from synthesis.constraints import Constraints
from synthesis.four_bar import close_loop, transmission_angle_over
from synthesis.fourbar.mechanism import GrashofChart
from synthesis.limits import Limits, Reach
from synthesis.linkage import as_lengths, four_bar
from synthesis.mechanism import Placed
from synthesis.solution import assess
from synthesis.target import Interval, Target
from synthesis.violations import violations_of

LAW = settings(max_examples=40, deadline=None)
ALL_CASES = {
    "transmission_angle_min": Limits("any", transmission_angle_min=0.6),
    "transmission_angle_min_turn": Limits(transmission_angle_min_turn=0.3),
    "link_min": Limits(link_min=0.7),
    "link_max": Limits(link_max=1.8),
    "link_ratio_max": Limits(link_ratio_max=3.0),
    "links": Limits(links=(0.5, None, 1.1, None)),
    "pivot_a": Limits(pivot_a=0.3 + 0.1j),
    "pivot_b": Limits(pivot_b=0.3 + 0.1j),
    "pivot_box": Limits(pivot_box=(-0.5, -0.4, 0.6, 0.5)),
    "pivot_a_box": Limits(pivot_a_box=(-0.5, -0.4, 0.6, 0.5)),
    "pivot_b_box": Limits(pivot_b_box=(-0.5, -0.4, 0.6, 0.5)),
    "pivot_reach": Limits(pivot_reach=Reach(0.1 - 0.2j, 0.8, 1.1)),
    "body_reach": Limits(pivot_reach=Reach(0j, None, None, 0.8)),
    "keep_out": Limits(keep_out=((-0.5, -0.4, 0.6, 0.5), (1.0, 0.0, 2.0, 1.0))),
    "coupler_radius_max": Limits(coupler_radius_max=0.6),
    "envelope": Limits(envelope=(-1.0, -0.9, 1.4, 1.1)),
}


def placed(seed: int, count: int = 30) -> Placed:
    """Random full cranks in random poses."""
    random = np.random.default_rng(seed)
    chart = GrashofChart()
    unknowns = random.uniform(0.1, 1.0, (count, 4))
    unknowns[:, 0] *= random.choice([-1, 1], count)
    first = random.uniform(0, 6, count)
    return Placed(
        chart.shape(unknowns).lengths,
        random.choice([-1.0, 1.0], count),
        Interval(first, first + random.uniform(0.5, 5.5, count)),
        random.normal(size=count) + 1j * random.normal(size=count),
        random.uniform(-3, 3, count),
        random.normal(size=count) + 1j * random.normal(size=count),
    )


@LAW
@given(st.integers(0, 10_000), st.sampled_from(sorted(ALL_CASES)))
def test_they_say_what_a_dense_look_says(seed, name) -> None:
    limits, linkages = ALL_CASES[name], placed(seed, 20)
    found = Constraints(limits)(linkages)
    assert set(found.names) <= {name, "links.crank", "links.rocker"}
    theta1 = linkages.used.first[:, None] + np.linspace(0, 1, 4001) * np.subtract(*linkages.used[::-1])[:, None]
    closure = close_loop(linkages.lengths, theta1)
    a = linkages.pivot[:, None]
    turned = np.exp(1j * linkages.turned)[:, None]
    arm = np.exp(1j * closure.coupler_angle(linkages.branch))
    pin = a + linkages.lengths[:, :1] * np.exp(1j * theta1) * turned
    b = a + linkages.lengths[:, 3:] * turned
    body = pin + linkages.coupler[:, None] * arm
    moving = np.stack([pin, pin + linkages.lengths[:, 1:2] * arm * turned, body])
    joints = np.concatenate([a, b, *moving], axis=1)

    def inside(positions: np.ndarray, box: tuple[float, float, float, float]) -> np.ndarray:
        x, y = positions.real, positions.imag
        edges = [x - box[0], y - box[1], box[2] - x, box[3] - y]
        return np.min(edges, axis=0)

    links = linkages.lengths
    dense = {
        "transmission_angle_min": lambda: np.cos(0.6) - np.cos(transmission_angle_over(links, linkages.used)),
        "transmission_angle_min_turn": lambda: (
            np.cos(0.3)
            - np.cos(transmission_angle_over(links, Interval(0 * links[:, 0], 0 * links[:, 0] + 2 * np.pi)))
        ),
        "link_min": lambda: links.min(axis=1) - 0.7,
        "link_max": lambda: 1.8 - links.max(axis=1),
        "link_ratio_max": lambda: (3 * links.min(axis=1) - links.max(axis=1)) / links.sum(axis=1),
        "links": lambda: -np.abs(links[:, [0, 2]] - [0.5, 1.1]).max(axis=1),
        "pivot_a": lambda: -np.maximum(abs((a - limits.pivot_a).real), abs((a - limits.pivot_a).imag))[:, 0],
        "pivot_b": lambda: -np.maximum(abs((b - limits.pivot_b).real), abs((b - limits.pivot_b).imag))[:, 0],
        "pivot_box": lambda: np.minimum(inside(a, limits.pivot_box), inside(b, limits.pivot_box))[:, 0],
        "pivot_a_box": lambda: inside(a, limits.pivot_a_box)[:, 0],
        "pivot_b_box": lambda: inside(b, limits.pivot_b_box)[:, 0],
        "pivot_reach": lambda: np.minimum(0.8 - abs(a - limits.pivot_reach[0]), 1.1 - abs(b - limits.pivot_reach[0]))[
            :, 0
        ],
        "body_reach": lambda: (
            0.8 - np.max([abs(linkages.coupler), abs(linkages.coupler - links[:, 1] * turned[:, 0])], axis=0)
        ),
        "keep_out": lambda: -np.max([inside(p, box)[:, 0] for p in (a, b) for box in limits.keep_out], axis=0),
        "coupler_radius_max": lambda: 0.6 - abs(linkages.coupler),
        "envelope": lambda: inside(joints, limits.envelope).min(axis=1),
    }[name]()
    smallest = np.where(found.equal, -np.abs(found.values), found.values).min(axis=1)
    # between two of the angles a joint rises by an eighth of the second difference, and no farther
    rise = np.abs(np.diff(moving, 2)).max(axis=(0, 2)) / 8 if name == "envelope" else 0.0
    assert np.all(smallest <= dense + 1e-9) and np.all(smallest >= dense - 1.01 * rise - 1e-9)


@LAW
@given(st.integers(0, 10_000), st.sampled_from(sorted(ALL_CASES)))
def test_a_finished_linkage_violates_what_its_search_avoids(seed, name) -> None:
    """The check of finished linkages of all kinds agrees with the functions of the search for four-bars."""
    limits, linkages = ALL_CASES[name], placed(seed, 20)
    found = Constraints(limits)(linkages)
    around = np.exp(2j * np.pi * np.arange(3) / 3)  # the middle is 0, and the extent is 1
    for k, values in enumerate(found.values):
        arm = linkages.coupler[k] * np.exp(-1j * linkages.turned[k])
        linkage = four_bar(
            as_lengths(linkages.lengths[k]),
            int(linkages.branch[k]),
            linkages.used.first[k],
            linkages.pivot[k],
            linkages.turned[k],
            (abs(arm), float(np.angle(arm))),
            0.0,
        )
        travel = (linkages.used.last[k] - linkages.used.first[k]) * np.array([0, 0.5, 1])
        (solution,) = assess(Target(None, around, crank=travel), [linkage])
        violations = violations_of(solution, Target(None, around, crank=travel), limits)
        worst = np.where(found.equal, -np.abs(values), values).min()
        if abs(worst) > 1e-9:
            assert bool(violations) == (worst < 0), violations
        if violations and name not in ("transmission_angle_min", "transmission_angle_min_turn", "link_ratio_max"):
            # a given point differs in two coordinates
            assert -worst <= max(violations.values()) * (1 + 1e-9) + 1e-9
            assert max(violations.values()) <= -worst * (1.5 if found.equal.any() else 1 + 1e-9) + 1e-9
