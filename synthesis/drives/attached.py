"""A drive on a linkage as it is drawn, tabulated and simulated: columns, lines of a drawing, and parts of a MuJoCo model."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from synthesis.arrays import Complexes
from synthesis.drives.dyad import driven
from synthesis.drives.links import GROUND, Machine
from synthesis.errors import FieldError

LAYER, COLOUR = "DRIVE", 6
"""Of a drawing, and AutoCAD's number of its colour."""
_BODY_WIDTH = 0.08
"""Of an actuator's body in a drawing, over its retracted length."""


@dataclass(frozen=True)
class Attached:
    """A drive at its place on a self.machine.

    ``kind``: rotary, actuator, dyad or toggle. ``ground``: its other end, the motor, or the pivot of a rotary drive, in the
    plane at the first sample; on the link ``on``. ``pin``: in the frame of ``link``. ``sizes``: retracted length and stroke,
    motor crank and rod, or handle and strut. ``knee``: of a toggle, where its links meet at the first sample.
    """

    machine: Machine
    kind: str
    link: str
    on: str
    ground: complex
    pin: complex
    sizes: tuple[float, float]
    extends: bool = True
    knee: complex | None = None

    def ends(self) -> tuple[Complexes, Complexes]:
        """Where its other end and its pin are, (n,) each."""
        for name in (self.link, self.on):
            if name not in (*self.machine.links, GROUND):
                raise FieldError("/drive/link", f"this linkage has no {name}")
        still = np.full(self.machine.at.size, self.ground, dtype=complex)
        pin = still if self.kind == "rotary" else self.machine.links[self.link].place(self.pin)
        if self.on == GROUND:
            return still, pin
        other = self.machine.links[self.on]
        return other.place(other.point_at(self.ground)), pin

    def knees(self) -> Complexes | None:
        """Where motor crank and rod meet on the way forwards, or handle and strut, (n,); None where there is no such place."""
        if self.kind == "dyad":
            link = self.machine.links[self.link]
            found = driven(link, np.zeros(self.machine.at.size), self.ground, self.pin, *self.sizes, self.extends)
            return None if found is None else found.crank_pin[0]
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
            length = np.abs(pin - ground)
            link = self.machine.links[self.link]
            speed = link.speed(self.pin)
            if self.on != GROUND:
                other = self.machine.links[self.on]
                speed = speed - other.speed(other.point_at(self.ground))
            found["drive_length"] = length
            found["drive_arm"] = np.real(np.conj(pin - ground) * speed) / length
        knees = self.knees()
        places = {"ground": ground, "pin": pin} | ({} if knees is None else {"knee": knees})
        for name, place in places.items():
            found[f"drive_{name}_x"], found[f"drive_{name}_y"] = place.real, place.imag
        return {name: values.tolist() for name, values in found.items()}

    def draw(self, space: Any, xy: Callable[[complex], tuple[float, float]], size: float) -> None:
        """Its lines on the layer `LAYER` of a drawing, at the first position; ``size``: of the drawing, in its unit."""
        at = {"layer": LAYER}
        ground, pin = (complex(place[0]) for place in self.ends())
        space.add_circle(xy(ground), 0.02 * size, dxfattribs=at)
        if self.kind == "rotary":
            return
        space.add_circle(xy(pin), 0.012 * size, dxfattribs=at)
        knees = self.knees()
        if knees is not None:
            space.add_lwpolyline([xy(ground), xy(complex(knees[0])), xy(pin)], dxfattribs=at)
            space.add_circle(xy(complex(knees[0])), 0.012 * size, dxfattribs=at)
            if self.kind == "dyad":
                turn = abs(complex(*xy(ground)) - complex(*xy(ground + self.sizes[0])))
                space.add_circle(xy(ground), turn, dxfattribs=at)
            return
        way = (pin - ground) / abs(pin - ground)
        body, half = 0.85 * self.sizes[0], 0.5 * _BODY_WIDTH * self.sizes[0]
        corners = [
            ground + way * (along + 1j * across)
            for along, across in ((0, half), (body, half), (body, -half), (0, -half))
        ]
        space.add_lwpolyline([xy(corner) for corner in corners], close=True, dxfattribs=at)
        space.add_line(xy(ground + way * body), xy(pin), dxfattribs=at)

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
            site = f'    <site name="drive_ground" pos="{_place(self.ground * metre)}"/>\n  </worldbody>'
            model = model.replace("  </worldbody>", site)
        else:
            point = self.machine.links[self.on].point_at(self.ground)
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

        def part(length: float) -> str:
            return (
                f'<geom type="capsule" fromto="0 0 0 {length!r} 0 0" size="{0.01 * max(first, second)!r}" '
                'rgba="0.8 0.2 0.6 1"/>'
            )

        bodies = (
            f'    <body name="motor" pos="{_place(ground * metre)}" euler="0 0 {turned!r}">\n'
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
        site = f'\n      <site name="{name}" pos="{_place(point * metre)}"/>'
        return re.sub(rf'<body name="{body}"[^>]*>', lambda found: found.group() + site, model, count=1)


def _place(z: complex) -> str:
    return f"{z.real!r} {z.imag!r} 0"
