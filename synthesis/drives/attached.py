"""A drive on a linkage as it is drawn, tabulated and simulated: columns, lines of a drawing, and parts of a MuJoCo model."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.arrays import Complexes
from synthesis.drives.links import GROUND, LinkMotions
from synthesis.drives.six_bar import SixBar
from synthesis.errors import FieldError
from synthesis.export.simulation import xy0
from synthesis.sheet import Extra, Sheet
from synthesis.target import TURN

LAYER, COLOUR = "DRIVE", 6
"""Of a drawing, and AutoCAD's number of its colour."""
_LIGHT = 0.1
"""Of the heaviest link in a simulation: what the two links of a motor or of a knee weigh."""
_STYLE = "<style>.drive{stroke:#d97706;stroke-width:6}.arm{stroke:#1d2733;stroke-width:8}</style>"
_BODY_WIDTH = 0.08
"""Of an actuator's body in a drawing, over its retracted length."""


@dataclass(frozen=True)
class Attached:
    """A drive at its place on a linkage.

    ``kind``: rotary, actuator, dyad or toggle. ``ground``: its other end, the motor, or the pivot of a rotary drive, in the
    plane at the first sample; on the link ``on``. ``pin``: in the frame of ``link``. ``sizes``: retracted length and stroke,
    motor crank and rod, or handle and strut. ``knee``: of a toggle, where its links meet at the first sample.
    """

    machine: LinkMotions
    kind: str
    link: str
    on: str
    ground: complex
    pin: complex
    sizes: tuple[float, float]
    extends: bool = True
    knee: complex | None = None
    six_bar: SixBar | None = None
    """Of a motor that swings the machine."""

    def ends(self) -> tuple[Complexes, Complexes]:
        """Where its other end and its pin are, (n,) each."""
        for name in (self.link, self.on):
            if name not in (*self.machine.links, GROUND):
                raise FieldError("/drive/link", f"this linkage has no {name}")
        ground = self.machine.end(self.on, self.machine.point_on(self.on, self.ground))
        return ground, ground if self.kind == "rotary" else self.machine.end(self.link, self.pin)

    def knees(self) -> Complexes | None:
        """Where motor crank and rod meet on the way forwards, or handle and strut, (n,); None where there is no such place."""
        if self.six_bar is not None:
            return self.six_bar.knee(self.six_bar.forwards(self.machine.at))
        if self.kind != "toggle" or self.knee is None:
            return None
        ground, pin = self.ends()
        first, second = self.sizes
        v = pin - ground
        length = np.abs(v)
        along = (first**2 - second**2 + length**2) / (2 * length)
        high = np.sqrt(np.maximum(first**2 - along**2, 0.0))
        side = np.sign(np.imag(np.conj(v[0]) * (self.knee - ground[0])))
        # the locked end is bent the other way than all others; the side is known of the first position
        bent = np.full(length.size, side if self.extends else -side)
        bent[-1 if self.extends else 0] *= -1
        return np.asarray(ground + (along + 1j * bent * high) * v / length)

    def columns(self) -> dict[str, list[Any]]:
        """Columns of a table over the machine's positions: length, arm, and where its joints are."""
        ground, pin = self.ends()
        found: dict[str, Any] = {}
        if self.kind != "rotary":
            link = self.machine.seen(self.link, self.on)
            found["drive_length"], found["drive_arm"] = link.leverage(self.ground, self.pin)
        knees = self.knees()
        places = {"ground": ground, "pin": pin} | ({} if knees is None else {"knee": knees})
        for name, place in places.items():
            found[f"drive_{name}_x"], found[f"drive_{name}_y"] = place.real, place.imag
        return {name: values.tolist() for name, values in found.items()}

    def lines(self) -> tuple[list[complex], list[complex], list[tuple[Complexes, bool]]]:
        """What is drawn of it at the first position: its fixed place, its pins, and lines, closed or not."""
        ground, pin = (complex(place[0]) for place in self.ends())
        if self.kind == "rotary":
            return [ground], [], []
        knees = self.knees()
        if knees is not None:
            knee = complex(knees[0])
            way = ground + abs(knee - ground) * np.exp(1j * np.linspace(0.0, TURN, 73))
            return (
                [ground],
                [pin, knee],
                [(np.array([ground, knee, pin]), False)] + [(way, True)] * (self.kind == "dyad"),
            )
        along = (pin - ground) / abs(pin - ground)
        body, half = 0.85 * self.sizes[0], 0.5 * _BODY_WIDTH * self.sizes[0]
        corners = np.array([1j * half, body + 1j * half, body - 1j * half, -1j * half])
        rod = np.array([ground + along * body, pin])
        return [ground], [pin], [(ground + along * corners, True), (rod, False)]

    def arms(self) -> list[Complexes]:
        """Return the lines from the joints of each link that carries an end of it to that end, at the first position."""
        found = []
        for name, end in ((self.on, self.ends()[0][0]), (self.link, self.ends()[1][0])):
            if name == GROUND or self.kind == "rotary":
                continue
            joints = [complex(self.machine.link(name).origin[0])]
            if name in self.machine.middles:
                joints.append(complex(self.machine.link(name).place(2 * self.machine.middles[name])[0]))
            found.append(np.array([joints[0], end, *joints[1:]]))
        return found

    def draw(self, space: Any, xy: Callable[[complex], tuple[float, float]], size: float) -> None:
        """It on the layer `LAYER` of a drawing for CAD; ``size``: of the drawing, in its unit."""
        at = {"layer": LAYER}
        pivots, pins, lines = self.lines()
        for places, radius in ((pivots, 0.02), (pins, 0.012)):
            for place in places:
                space.add_circle(xy(place), radius * size, dxfattribs=at)
        for line, closed in [*lines, *((arm, False) for arm in self.arms())]:
            space.add_lwpolyline([xy(complex(place)) for place in line], close=closed, dxfattribs=at)

    def shown(self) -> Extra:
        """It in a drawing to look at."""
        pivots, pins, lines = self.lines()
        arms = self.arms()

        def draw(sheet: Sheet) -> str:
            parts = [sheet.line(arm, "arm") for arm in arms]
            parts += [sheet.line(line, "drive", closed) for line, closed in lines]
            parts += [sheet.dot(place, 11, 'class="pivot"') for place in pivots]
            return _STYLE + "".join([*parts, *(sheet.dot(place, 8, 'class="pin"') for place in pins)])

        return Extra(np.concatenate([np.array([*pivots, *pins]), *(line for line, _ in lines), *arms]), draw)

    def simulated(self, model: str, metre: float) -> str:
        """A MuJoCo model with this drive in the place of its own; ``metre``: metres in the machine's unit of length."""
        if self.kind == "rotary":
            self._need(model, self.link)
            return re.sub(r'(<velocity name="drive" joint=")[^"]+"', rf'\g<1>{self.link}"', model)
        ground, pin = self.ends()
        if self.kind in ("dyad", "toggle"):
            return self._with_knee(model, metre, complex(ground[0]))
        model = self._with_site(model, self.link, "drive_pin", self.pin, metre)
        if self.on == GROUND:
            site = f'    <site name="drive_ground" pos="{xy0(self.ground * metre)}"/>\n  </worldbody>'
            model = model.replace("  </worldbody>", site)
        else:
            point = self.machine.point_on(self.on, self.ground)
            model = self._with_site(model, self.on, "drive_ground", point, metre)
        tendon = (
            '  <tendon>\n    <spatial name="drive" width="0.005" rgba="0.8 0.2 0.6 1">\n'
            '      <site site="drive_ground"/>\n      <site site="drive_pin"/>\n    </spatial>\n  </tendon>\n'
        )
        length = np.abs(pin - ground) * metre
        low, high = float(length.min()), float(length.max())
        servo = (
            f'  <actuator>\n    <position name="drive" tendon="drive" kp="1e4" kv="1e2" ctrlrange="{low!r} {high!r}"/>\n'
            "  </actuator>\n"
        )
        model = re.sub(r"  <actuator>.*?</actuator>\n", lambda _: tendon + servo, model, flags=re.DOTALL)
        return re.sub(r'<key name="start"[^>]*/>', f'<key name="start" ctrl="{float(length[0])!r}"/>', model)

    def _with_knee(self, model: str, metre: float, ground: complex) -> str:
        knees = self.knees()
        if knees is None:
            raise FieldError("/drive", "this motor does not drive the linkage through the samples in their order")
        pin, knee = complex(self.ends()[1][0]), complex(knees[0])
        first, second = (size * metre for size in self.sizes)
        turned = float(np.angle(knee - ground))
        rod = float(np.angle(pin - knee)) - turned
        model = self._with_site(model, self.link, "drive_pin", self.pin, metre)

        heaviest = max(float(one) for one in re.findall(r'<inertial [^>]*?mass="([^"]+)"', model))

        def part(length: float) -> str:
            mass = _LIGHT * heaviest
            inertia = mass * length**2 / 12
            return (
                f'<inertial pos="{length / 2!r} 0 0" mass="{mass!r}" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
                f'<geom type="capsule" fromto="0 0 0 {length!r} 0 0" size="{0.01 * max(first, second)!r}" '
                'rgba="0.8 0.2 0.6 1"/>'
            )

        bodies = (
            f'    <body name="motor" pos="{xy0(ground * metre)}" euler="0 0 {turned!r}">\n'
            f'      <joint name="motor"/>\n      {part(first)}\n'
            f'      <body name="rod" pos="{first!r} 0 0" euler="0 0 {rod!r}">\n        <joint name="rod"/>\n'
            f'        {part(second)}\n        <site name="drive_rod" pos="{second!r} 0 0"/>\n      </body>\n    </body>\n'
            "  </worldbody>"
        )
        model = model.replace("  </worldbody>", bodies)
        loop = '    <connect name="drive_loop" site1="drive_rod" site2="drive_pin" solref="0.0002 1"/>\n  </equality>'
        model = model.replace("  </equality>", loop)
        model = re.sub(r'(<velocity name="drive" joint=")[^"]+"', r'\g<1>motor"', model)
        return re.sub(r'(<key name="start" ctrl="[^"]*")[^>]*/>', r"\g<1>/>", model)

    def _need(self, model: str, name: str) -> None:
        if f'<body name="{name}"' not in model:
            raise FieldError("/drive/link", f"the model has no body {name}")

    def _with_site(self, model: str, body: str, name: str, point: complex, metre: float) -> str:
        self._need(model, body)
        site = f'\n      <site name="{name}" pos="{xy0(point * metre)}"/>'
        return re.sub(rf'<body name="{body}"[^>]*>', lambda found: found.group() + site, model, count=1)
