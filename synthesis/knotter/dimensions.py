"""The dimensions of a knotter by name, and many mechanisms that differ in some of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from synthesis.errors import FieldError
from synthesis.knotter.mechanism import AXES, Linear, Mechanism
from synthesis.one_variable import Floats

ANGLES = ("alpha1", "alpha2", "alpha3", "beta.lead", "alpha4.lead")
"""Dimensions that are angles; ratios of laws are pure numbers, all others are lengths."""


def dimensions(mechanism: Mechanism) -> dict[str, float]:
    """Every dimension and its value: parameters, ``law.lead`` and ``law.ratio`` of laws that are linear, ``point.axis``.

    Points without a name of their own in the source (a frame's origin) are left out.
    """
    found = {name: float(np.asarray(value)) for name, value in mechanism.parameters.items()}
    for name, law in mechanism.laws.items():
        if isinstance(law, Linear):
            found |= {f"{name}.lead": float(np.asarray(law.lead)), f"{name}.ratio": float(np.asarray(law.ratio))}
    for name, (_, xyz) in mechanism.points.items():
        if name.startswith("S"):
            found |= {f"{name}.{axis}": float(at) for axis, at in zip(AXES, xyz)}
    return found


def varied(mechanism: Mechanism, values: Mapping[str, Floats | float]) -> Mechanism:
    """The mechanism with other values of some dimensions, each a number or an array of shape (items,).

    Law: with the values of `dimensions` it is the same mechanism.

    Raises
    ------
    FieldError
        A dimension that this mechanism does not have.
    """
    parameters, laws, points = dict(mechanism.parameters), dict(mechanism.laws), dict(mechanism.points)
    for name, value in values.items():
        owner, _, part = name.partition(".")
        law = laws.get(owner)
        if name in parameters:
            parameters[name] = value
        elif isinstance(law, Linear) and part in ("lead", "ratio"):
            laws[owner] = Linear(value, law.ratio) if part == "lead" else Linear(law.lead, value)
        elif owner in points and part in tuple(AXES):
            frame, xyz = points[owner]
            moved = list(xyz)
            moved[AXES.index(part)] = value
            points[owner] = (frame, tuple(moved))
        else:
            raise FieldError(
                "",
                f"there is no dimension {name}: a parameter, law.lead or law.ratio of a linear law, or point.i, .j, .k",
            )
    return replace(mechanism, parameters=parameters, laws=laws, points=points)
