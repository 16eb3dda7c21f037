"""A drive on a linkage, for drawings and tables: columns and lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from synthesis.arrays import Complexes
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.six_bar import SixBar
from synthesis.sheet import Extra, Sheet
from synthesis.target import TURN

LAYER = "DRIVE"
"""Layer of a drawing for CAD."""
COLOUR = 6
"""AutoCAD's index of the layer's colour."""
_STYLE = "<style>.drive{stroke:#d97706;stroke-width:6}.arm{stroke:#1d2733;stroke-width:8}</style>"
_BODY_WIDTH = 0.08
"""Width of an actuator's body in a drawing, as a fraction of its retracted length."""


class DriveEnds(NamedTuple):
    """Ends and lengths of a drive."""

    kind: str
    """``rotary``, ``actuator`` or ``dyad``."""
    link: str
    """Link that carries the pin."""
    on: str
    """Link that carries the other end, or ``ground``."""
    ground: complex
    """Other end, motor, or pivot of a rotary drive, in the plane at the first sample."""
    pin: complex
    """Pin in the frame of its link."""
    sizes: tuple[float, float]
    """Retracted length and stroke, or motor crank and rod."""


@dataclass(frozen=True)
class Attached:
    """A drive that is attached to a linkage."""

    machine: LinkMotions
    drive: DriveEnds
    six_bar: SixBar | None = None
    """Six-bar of a motor that swings the linkage."""

    def ends(self) -> tuple[Complexes, Complexes]:
        """Return the paths (n,) of the other end and of the pin."""
        ground = self.machine.end(self.drive.on, self.machine.point_on(self.drive.on, self.drive.ground))
        return ground, ground if self.drive.kind == "rotary" else self.machine.end(self.drive.link, self.drive.pin)

    def knees(self) -> Complexes | None:
        """Return the path (n,) of the joint of motor crank and rod in the forward stroke; None for other drives."""
        return None if self.six_bar is None else self.six_bar.knee(self.six_bar.forwards(self.machine.at))

    def columns(self) -> dict[str, list[Any]]:
        """Return columns of a table over the machine's positions: length, arm, and the coordinates of the joints."""
        ground, pin = self.ends()
        columns: dict[str, Any] = {}
        if self.drive.kind != "rotary":
            link = self.machine.seen(self.drive.link, self.drive.on)
            columns["drive_length"], columns["drive_arm"] = link.leverage(self.drive.ground, self.drive.pin)
        knees = self.knees()
        points = {"ground": ground, "pin": pin} | ({} if knees is None else {"knee": knees})
        for name, positions in points.items():
            columns[f"drive_{name}_x"], columns[f"drive_{name}_y"] = positions.real, positions.imag
        return {name: values.tolist() for name, values in columns.items()}

    def lines(self) -> tuple[list[complex], list[complex], list[tuple[Complexes, bool]]]:
        """Return the drawing of the drive at the first position.

        Returns
        -------
        pivots, pins : list of complex
        lines : list of (ndarray of complex, bool)
            Points of each line, and whether it is closed.
        """
        ground, pin = (complex(path[0]) for path in self.ends())
        if self.drive.kind == "rotary":
            return [ground], [], []
        knees = self.knees()
        if knees is not None:
            knee = complex(knees[0])
            circle = ground + abs(knee - ground) * np.exp(1j * np.linspace(0.0, TURN, 73))
            return [ground], [pin, knee], [(np.array([ground, knee, pin]), False), (circle, True)]
        along = (pin - ground) / abs(pin - ground)
        body, half = 0.85 * self.drive.sizes[0], 0.5 * _BODY_WIDTH * self.drive.sizes[0]
        corners = np.array([1j * half, body + 1j * half, body - 1j * half, -1j * half])
        rod = np.array([ground + along * body, pin])
        return [ground], [pin], [(ground + along * corners, True), (rod, False)]

    def arms(self) -> list[Complexes]:
        """Return lines, at the first position, from the joints of each link that carries an end of the drive to that end."""
        lines = []
        for name, end in ((self.drive.on, self.ends()[0][0]), (self.drive.link, self.ends()[1][0])):
            if name == GROUND or self.drive.kind == "rotary":
                continue
            joints = [complex(self.machine.link(name).origin[0])]
            if name in self.machine.middles:
                joints.append(complex(self.machine.link(name).position(2 * self.machine.middles[name])[0]))
            lines.append(np.array([joints[0], end, *joints[1:]]))
        return lines

    def draw(self, space: Any, xy: Callable[[complex], tuple[float, float]], size: float) -> None:
        """Draw the drive on the layer `LAYER` of a drawing for CAD.

        Parameters
        ----------
        space : modelspace of ezdxf
        xy : callable
            Return the drawing's coordinates of a point.
        size : float
            Size of the drawing, in its unit.
        """
        at = {"layer": LAYER}
        pivots, pins, lines = self.lines()
        for centres, radius in ((pivots, 0.02), (pins, 0.012)):
            for centre in centres:
                space.add_circle(xy(centre), radius * size, dxfattribs=at)
        for line, closed in [*lines, *((arm, False) for arm in self.arms())]:
            space.add_lwpolyline([xy(complex(point)) for point in line], close=closed, dxfattribs=at)

    def shown(self) -> Extra:
        """Return the drive for an SVG drawing."""
        pivots, pins, lines = self.lines()
        arms = self.arms()

        def draw(sheet: Sheet) -> str:
            parts = [sheet.line(arm, "arm") for arm in arms]
            parts += [sheet.line(line, "drive", closed) for line, closed in lines]
            parts += [sheet.dot(pivot, 11, 'class="pivot"') for pivot in pivots]
            return _STYLE + "".join([*parts, *(sheet.dot(pin, 8, 'class="pin"') for pin in pins)])

        return Extra(np.concatenate([np.array([*pivots, *pins]), *(line for line, _ in lines), *arms]), draw)
