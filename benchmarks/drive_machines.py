"""Ten machines with a drive that one would buy: what la.drives finds for each, its picture and its curve (`make drives`)."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

import linkage_atlas as la
from benchmarks import report
from benchmarks.figures import BLUE, GREEN, GREY, INK, ORANGE, RED, bare, figure
from benchmarks.report import ROOT
from linkage_atlas.drive_design.records import ActuatorDrive, MotorCurve, MotorDrive, ToggleCurve, ToggleDrive

GALLERY = {one["name"]: one["request"] for one in json.loads((ROOT / "app/static/examples.json").read_text())}
HYDRAULIC = "name,retracted,stroke,force,pull,rod\n" + "\n".join(
    f"hydraulic {bore} x {stroke},{stroke + 220},{stroke},{force},{pull},{rod}"
    for bore, rod, force, pull in ((32, 20, 14400, 8700), (40, 25, 22600, 13700), (50, 30, 35300, 22600))
    for stroke in (200, 300, 400, 500)
)
"""A catalogue of one's own: cylinders at 180 bar, of no maker."""
COUNTER = "name,stiffness,free_length,preload,longest\n" + "\n".join(
    f"counter spring {rate} N/mm,{rate},{free},{preload},{longest}"
    for rate, free, preload, longest in ((1, 350, 40, 900), (2, 400, 60, 900), (3, 450, 80, 950), (5, 400, 100, 800))
)
LAMP = "name,stiffness,free_length,preload,longest\n" + "\n".join(
    f"lamp spring {rate} N/mm,{rate},{free},{preload},{longest}"
    for rate, free, preload, longest in ((0.2, 70, 2, 240), (0.4, 60, 3, 220), (0.8, 60, 5, 200), (1.2, 90, 8, 260))
)
"""Springs of one's own for a door and a lamp."""


def solved(name: str) -> dict[str, Any]:
    """The best linkage of a machine of the page's gallery, and its motion."""
    request = GALLERY[name]
    given = {key: request[key] for key in ("rotation", "position", "timing", "crank_span") if key in request}
    return {"linkage": la.synthesize(**given, limits=request.get("limits"), top=1).best}


def door() -> dict[str, Any]:
    """A canopy door: rollers at its foot in upright rails, an arm from the frame to its middle; it opens outwards and up."""
    arm = {"guide": "circle", "pivot": [0, 1300], "radius": 520, "body_point": [0, 800]}
    rail = {"guide": "rail", "point": [0, 0], "direction": 90, "body_point": [0, 0]}
    return {"linkage": la.Linkage([arm, rail], "crank", 1, -88.0), "crank_angle": [0, 150]}


MACHINES: dict[str, dict[str, Any]] = {
    "window opener": {
        "of": lambda: solved("casement"),
        "asked": {
            "load": {"force": [0, 150]},
            "drives": [
                {"kind": "actuator", "catalogue": "spindle", "reach_max": 250, "ground_box": [-100, -250, 400, 150]}
            ],
        },
    },
    "tipper": {
        "of": lambda: {"rocker": {"pivot": [0, 0], "start": 0, "swing": 50, "length": 2400}},
        "asked": {
            "load": {"masses": [{"link": "body", "mass": 900, "at": [-1300, 250]}]},
            "drives": [
                {"kind": "cylinder", "catalogue": HYDRAULIC, "ground_box": [200, -500, 1500, -200], "reach_max": 1500}
            ],
        },
    },
    "flap with gas spring": {
        "of": lambda: {"rocker": {"pivot": [0, 0], "start": -90, "swing": 100, "length": 500}},
        "asked": {
            "load": {"masses": [{"link": "body", "mass": 6, "at": [-250, 0]}]},
            "springs": [
                {"kind": "gas", "between": ["ground", "rocker"], "ground_box": [-60, -400, -20, 0], "reach_max": 300}
            ],
        },
    },
    "bonnet": {
        "of": lambda: solved("hood"),
        "asked": {
            "load": {"masses": [{"link": "body", "mass": 9}]},
            "springs": [{"kind": "gas", "between": ["ground", "rocker"]}],
        },
    },
    "wiper with motor": {
        "of": lambda: solved("wiper"),
        "asked": {
            "load": {"torque": 2500},
            "drives": [{"kind": "dyad", "time_ratio": 1, "pin_radius": 60, "links": ["crank", "rocker"]}],
        },
    },
    "bucket cylinder": {
        "of": lambda: solved("bucket"),
        "asked": {
            "load": {"masses": [{"link": "body", "mass": 40}]},
            "drives": [
                {"kind": "cylinder", "catalogue": "iso_15552", "links": ["crank", "rocker"], "reach_max": 500}
            ],
        },
    },
    "landing gear lock": {
        "of": lambda: solved("gear"),
        "asked": {
            "load": {"force": [300, 500]},
            "drives": [
                {"kind": "toggle", "at": at, "over_centre": 6, "reach_max": 400, "ground_box": [-300, -100, 900, 500]}
                for at in ("first", "last")
            ],
        },
    },
    "desk lamp": {
        "of": lambda: {
            "linkage": la.FourBar(
                380, 60, 380, 60, -1, ground_angle=90, start_angle=-70, coupler_point_polar=(150, -60), body_offset=0
            ),
            "crank_angle": [0, 50],
        },
        "asked": {
            "load": {
                "masses": [
                    {"link": "body", "mass": 0.6},
                    {"link": "crank", "mass": 0.15},
                    {"link": "rocker", "mass": 0.15},
                ]
            },
            "springs": [
                {
                    "kind": "tension",
                    "between": ["ground", "crank"],
                    "catalogue": LAMP,
                    "ground_box": [-60, -60, 60, 180],
                    "reach_max": 200,
                }
            ],
        },
    },
    "garage door": {
        "of": door,
        "asked": {
            "load": {"masses": [{"link": "body", "mass": 35, "at": [0, 1000]}]},
            "springs": [
                {
                    "kind": "tension",
                    "between": ["ground", "crank"],
                    "catalogue": COUNTER,
                    "ground_box": [-80, 100, 80, 2100],
                    "reach_max": 500,
                    "pivot_distance_min": 60,
                }
            ],
        },
    },
    "pump jack": {
        "of": lambda: {"rocker": {"pivot": [0, 3000], "start": 155, "swing": 50, "length": 2400}},
        "asked": {
            "load": {"force": [0, -25000]},
            "drives": [{"kind": "dyad", "time_ratio": 1, "pin_radius": 2000, "motor_box": [500, 300, 3500, 1500]}],
        },
    },
}


def found_for(name: str) -> tuple[Mapping[str, Any], la.Drives]:
    """The machine, and what drives it."""
    machine = MACHINES[name]["of"]()
    asked = {"drives": [], **MACHINES[name]["asked"]}
    return machine, la.drives(**machine, **asked, top=1)


def words(found: la.Drives) -> dict[str, str]:
    """What was found, in the columns of the table."""
    if found.springs:
        spring = found.springs[0]
        before, after = spring.torque.before.rms, spring.torque.after.rms
        return {
            "drive": f"{spring.name}, {' to '.join(spring.between)}",
            "needs": f"torque left {100 * after / before:.1f} % (rms)",
            "place": " to ".join(_pair(place) for place in spring.points),
        }
    one = found.drives[0]
    place = f"{_pair(one.motor if isinstance(one, MotorDrive) else one.ground_point)} to {_pair(one.pin)}"
    if isinstance(one, MotorDrive):
        return {
            "drive": f"motor, crank {one.six_bar.crank:.4g}, rod {one.six_bar.coupler:.4g}, on the {one.link}",
            "needs": f"{one.six_bar.motor_torque_max / 1000:.3g} N m, rod at {one.six_bar.transmission_angle_min:.3g}° or more",
            "place": place,
        }
    if isinstance(one, ToggleDrive):
        holds = "holds" if one.lock.holds else "does not hold"
        return {
            "drive": f"knee, handle {one.lock.handle:.4g}, strut {one.lock.strut:.4g}, on the {one.link}",
            "needs": f"{holds} {abs(one.holding[0 if one.lock.at == 'first' else 1]):.4g} N at its {one.lock.at} pose",
            "place": place,
        }
    return {
        "drive": f"{one.name}, on the {one.link}",
        "needs": f"{one.peak_force:.4g} N, {one.peak_force_ratio:.3f} of the least",
        "place": place,
    }


def _pair(place: Any) -> str:
    return f"({place[0]:.0f}, {place[1]:.0f})"


def measure() -> Iterator[dict[str, Any]]:
    """A row a machine."""
    rows = []
    for name in MACHINES:
        _, found = found_for(name)
        assert found.drives or found.springs, (name, found.refused)
        rows.append({"machine": name, **words(found)})
    yield {"tables": {"machines": rows}}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """The table of docs/drives.md."""
    return report.tables("drive_machines", results["tables"])


def draw(results: dict[str, Any]) -> None:
    """Each machine at both ends and between, with its curve: five to a picture."""
    names = list(MACHINES)
    for number, some in enumerate((names[:5], names[5:]), 1):
        with figure(f"drives_{number}.png", 2, 5, (17, 6.4)) as (_, panels):
            for k, name in enumerate(some):
                machine, found = found_for(name)
                _machine(panels[k], name, machine, found)
                _curve(panels[5 + k], found)


def _machine(axes: Any, name: str, machine: Mapping[str, Any], found: la.Drives) -> None:
    body = found.machine
    count = body.at.size
    for k, alpha in ((count - 1, 0.25), (count // 2, 0.45), (0, 1.0)):
        for part in _lines(machine, found, k):
            axes.plot(part.real, part.imag, color=BLUE, lw=2.6, alpha=alpha, solid_capstyle="round")
        for part in _driving(found, k):
            axes.plot(part.real, part.imag, color=ORANGE, lw=3.4, alpha=alpha, solid_capstyle="round", zorder=3)
            axes.plot(part.real, part.imag, "o", ms=5, mfc="white", mec=INK, alpha=alpha, zorder=4)
    for link in body.links.values():
        if link.pivot is not None:
            axes.plot(link.pivot.real, link.pivot.imag, "o", ms=7, color=INK, zorder=5)
    bare(axes)
    axes.set_title(name)


def _lines(machine: Mapping[str, Any], found: la.Drives, k: int) -> list[Any]:
    """The links at one position."""
    links, body = found.machine.links, found.machine.body
    point = [] if body is None else [body.origin[k]]
    if "rocker" in links and len(links) == 1:
        pins = [one.curve.pin[k] for one in found.drives] + [one.curve.ends[k][1] for one in found.springs]
        arms = [np.array([links["rocker"].origin[k], complex(*pin)]) for pin in pins]
        return [np.array([links["rocker"].origin[k], *point]), *arms]
    if "slider" in links:
        top = links["coupler"].place(2000j)[k]
        pin = links["crank"].place(520.0)[k]
        return [np.array([links["crank"].origin[k], pin]), np.array([links["slider"].origin[k], top])]
    crank, coupler, rocker = (links[one] for one in ("crank", "coupler", "rocker"))
    plain = machine["linkage"]
    plain = getattr(plain, "linkage", plain)
    c = rocker.place(plain.rocker)[k]
    d = coupler.origin[k]
    return [np.array([crank.origin[k], d]), np.array([rocker.origin[k], c]), np.array([d, c, *point, d])]


def _driving(found: la.Drives, k: int) -> list[Any]:
    """What drives it at one position."""
    if found.springs:
        return [one.curve.ends[k] @ np.array([1, 1j]) for one in found.springs]
    curve = found.drives[0].curve
    joints = [
        curve.ground[k],
        *([curve.knee[k]] if isinstance(curve, (MotorCurve, ToggleCurve)) else []),
        curve.pin[k],
    ]
    return [np.array(joints) @ np.array([1, 1j])]


def _curve(axes: Any, found: la.Drives) -> None:
    x = np.abs(found.torque.crank_angle)
    if found.springs:
        axes.plot(x, found.torque.torque / 1000, color=GREY, ls="--")
        axes.plot(x, found.springs[0].curve.torque / 1000, color=GREEN)
        axes.set_title("torque without and with spring, N m", fontsize=9)
        return
    one = found.drives[0]
    if isinstance(one, MotorDrive):
        turn = np.abs(one.six_bar.motor_angle - one.six_bar.motor_angle[0])
        axes.plot(turn, one.six_bar.motor_torque / 1000, color=GREEN)
        axes.set_title("motor torque over its turn, N m", fontsize=9)
        return
    axes.plot(x, np.abs(one.curve.force), color=GREEN)
    bound = one.bound if isinstance(one, ActuatorDrive) else None
    if bound is not None:
        axes.axhline(bound, color=RED, ls="--", lw=1.2)
    axes.set_ylim(0, None)
    axes.set_title("force, N" + (" (dashed: no peak is below)" if bound else ""), fontsize=9)


if __name__ == "__main__":
    report.run(measure)
