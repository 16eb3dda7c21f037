"""A function generator as a table: what was wanted at the samples, what the linkage makes of it, and where it stands."""

from __future__ import annotations

import numpy as np

from synthesis.fourbar.drawing import used_joints
from synthesis.fourbar.linkage import Linkage
from synthesis.function.answers import rocker_angles
from synthesis.function.wanted import Wanted
from synthesis.sheet import csv_text


def to_csv(wanted: Wanted, linkage: Linkage, offset: float, unit: float) -> str:
    """The function at the samples; angles are divided by ``unit`` (radians in one unit of angle)."""
    used_joints(linkage, wanted.interval)
    joints = linkage.joints(wanted.crank)
    output = rocker_angles([linkage], wanted.crank)[0] + offset
    columns = {
        "input": wanted.crank,
        "output_wanted": wanted.output,
        "output": output,
        "error": wanted.output - output,
        "transmission_angle": joints.transmission_angle,
        "crank_direction": joints.crank_angle,
        "coupler_direction": joints.coupler_angle,
        "rocker_direction": joints.rocker_angle,
    }
    return csv_text({name: (np.asarray(values) / unit).tolist() for name, values in columns.items()})
