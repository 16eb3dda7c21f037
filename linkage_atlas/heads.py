"""Heads of the columns of tables: which names mean which field, for each question."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

SHARES = ("weight", "weight_rotation", "weight_position", "tolerance_rotation", "tolerance_position")
"""Columns with the weight of each sample, for both parts or one of them, and with the allowed errors."""


def _names(words: str) -> frozenset[str]:
    return frozenset(words.split())


def axis_names(axis: str, number: int) -> frozenset[str]:
    """Names of a column that holds a coordinate of the body point."""
    before = (
        "p pos position t trans translation translate tvec loc location coord coordinate c center centre point pt com"
    ).split()
    behind = "pos position coord coordinate koordinate wert value".split()
    names = {axis, *(f"{word}_{axis}" for word in before), *(f"{word}{axis}" for word in before)}
    names |= {f"{axis}_{word}" for word in behind} | {f"{axis}{word}" for word in behind}
    return frozenset(names | {f"{word}_{number}" for word in ("t", "tvec", "translation")})


_NUMBERING = _names(
    "no nr number nummer n id pose point sample index frame pos step timestep row i k name label part_name part"
)
_TIMES = _names("t time zeit timestamp datetime date seconds sec")
_X, _Y = axis_names("x", 0) | {"easting"}, axis_names("y", 1) | {"northing"}
_CRANK = _names(
    "crank crank_angle crankangle theta1 theta_1 theta2 theta_2 input input_angle motor motor_angle kurbel kurbelwinkel"
)
ANGLES = _names(
    "angle rotation rot gamma phi theta alpha beta psi yaw heading orientation direction winkel drehung drehwinkel "
    "body_angle coupler_angle rotation_angle tilt "
    "rz r_z rotz rot_z rotation_z rotationz angle_z anglez theta_z euler_z yaw_z z_rot z_rotation z_angle"
)
RADIAN_ANGLES = _names("rvec_z rvec_2 rotation_euler_z rotation_euler_2")
"""Angles that programs always write in radians: rotation vectors of OpenCV, Blender's Python interface."""
_OUTPUT = _names("output output_angle rocker rocker_angle follower theta3 theta_3 theta4 theta_4 psi out abtrieb")
_COSINE = _names(
    "cos c cosine cos_theta costheta cos_phi cosphi cos_angle cos_alpha ux u_x dir_x direction_x r11 r_11 r00 r_00"
)
_SINE = _names(
    "sin s sine sin_theta sintheta sin_phi sinphi sin_angle sin_alpha uy u_y dir_y direction_y r21 r_21 r10 r_10"
)


def _quaternion(part: str) -> frozenset[str]:
    return frozenset(f"{word}{part}" for word in ("q", "q_", "quat_", "rotation_quaternion_", "orientation_"))


COORDINATE = re.compile(r"(?P<before>.*?)_?(?P<axis>[xy])|(?P<first>[xy])_?(?P<behind>.+)")
"""Name of a column with a coordinate of a labelled point: x1, p1_x, joint_a_x, model_x."""
NO_POINTS = _names(
    "v vel velocity speed acc accel acceleration f force rot rotation rotation_euler rvec euler omega q d delta err error std "
    "weight tolerance"
)
"""Labels of vectors that are no points."""


@dataclass(frozen=True)
class Kind:
    """Columns of the tables of a question."""

    roles: Mapping[str, frozenset[str]]
    """Names of the columns that have each role."""
    bare: Mapping[int, tuple[str, ...]]
    """Roles of the columns of a table without heads, by their number."""
    angles: tuple[str, ...]
    lengths: tuple[str, ...] = ()
    gaps: bool = False
    """A cell may be empty."""
    described: str = ""
    """Heads that are read, for messages."""

    @property
    def known(self) -> frozenset[str]:
        """All names that mark a line as a line of heads."""
        return frozenset().union(
            *self.roles.values(), _NUMBERING, _TIMES, axis_names("z", 2), {"x1", "y1", "x2", "y2"}
        )


POSES = Kind(
    {
        "crank_angle": _CRANK,
        "x": _X,
        "y": _Y,
        "rotation": ANGLES | RADIAN_ANGLES,
        "cos": _COSINE,
        "sin": _SINE,
        **{f"q{part}": _quaternion(part) for part in "wxyz"},
        **{name: frozenset({name}) for name in SHARES},
    },
    {1: ("rotation",), 2: ("x", "y"), 3: ("x", "y", "rotation"), 4: ("crank_angle", "x", "y", "rotation")},
    ("crank_angle", "rotation", "tolerance_rotation"),
    ("x", "y", "x1", "y1", "x2", "y2", "tolerance_position"),
    gaps=True,
    described="x and y, angle, crank; or x1, y1, x2, y2; or x, y, cos, sin",
)
"""Tables of /v2/synthesize."""
ROTATIONS = Kind(
    {"crank_angle": _CRANK, "rotation": ANGLES | RADIAN_ANGLES, "cos": _COSINE, "sin": _SINE},
    {1: ("rotation",), 2: ("crank_angle", "rotation")},
    ("crank_angle", "rotation"),
    described="angle, crank",
)
"""Tables of /v2/match."""
FUNCTIONS = Kind(
    {"input": _CRANK, "output": _OUTPUT, "angle": ANGLES - _OUTPUT, "x": frozenset({"x"}), "y": frozenset({"y"})},
    {1: ("output",), 2: ("input", "output")},
    ("input", "output", "angle"),
    described="input and output, or x and y",
)
"""Tables of /v2/function."""
KINDS: Mapping[str, Kind] = {"synthesize": POSES, "assembly": POSES, "match": ROTATIONS, "function": FUNCTIONS}
"""Kind of table of each question."""
