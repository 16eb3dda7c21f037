"""Ten machines with commercial drives: the drives that la.drives finds, with pictures and curves (`make drives`)."""

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

GALLERY = {
    machine["name"]: machine["request"] for machine in json.loads((ROOT / "app/static/examples.json").read_text())
}
HYDRAULIC = "name,retracted,stroke,force,pull,rod\n" + "\n".join(
    f"hydraulic {bore} x {stroke},{stroke + 220},{stroke},{force},{pull},{rod}"
    for bore, rod, force, pull in ((32, 20, 14400, 8700), (40, 25, 22600, 13700), (50, 30, 35300, 22600))
    for stroke in (200, 300, 400, 500)
)
"""Catalogue of hydraulic cylinders at 180 bar, not of a manufacturer."""
COUNTER = "name,stiffness,free_length,preload,longest\n" + "\n".join(
    f"counter spring {rate} N/mm,{rate},{free},{preload},{longest}"
    for rate, free, preload, longest in ((1, 350, 40, 900), (2, 400, 60, 900), (3, 450, 80, 950), (5, 400, 100, 800))
)
LAMP = "name,stiffness,free_length,preload,longest\n" + "\n".join(
    f"lamp spring {rate} N/mm,{rate},{free},{preload},{longest}"
    for rate, free, preload, longest in ((0.2, 70, 2, 240), (0.4, 60, 3, 220), (0.8, 60, 5, 200), (1.2, 90, 8, 260))
)
"""Catalogue of springs for a door and a lamp."""


def solved(name: str) -> dict[str, Any]:
    """Return the best linkage of a machine of the page, and its motion."""
    request = GALLERY[name]
    motion_fields = {key: request[key] for key in ("rotation", "position", "timing", "crank_span") if key in request}
    return {"linkage": la.synthesize(**motion_fields, limits=request.get("limits"), top=1).best}


def door() -> dict[str, Any]:
    """Return a canopy door with rollers at its foot in upright rails and an arm from the frame to its middle."""
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
    """Return the machine and its drives."""
    machine = MACHINES[name]["of"]()
    request = {"drives": [], **MACHINES[name]["asked"]}
    return machine, la.drives(**machine, **request, top=1)


def words(found: la.Drives) -> dict[str, str]:
    """Describe the drives in the columns of the table."""
    if found.springs:
        spring = found.springs[0]
        before, after = spring.torque.before.rms, spring.torque.after.rms
        return {
            "drive": f"{spring.name}, {' to '.join(spring.between)}",
            "needs": f"torque left {100 * after / before:.1f} % (rms)",
            "place": " to ".join(_pair(point) for point in spring.points),
        }
    drive = found.drives[0]
    position = f"{_pair(drive.motor if isinstance(drive, MotorDrive) else drive.ground_point)} to {_pair(drive.pin)}"
    if isinstance(drive, MotorDrive):
        return {
            "drive": f"motor, crank {drive.six_bar.crank:.4g}, rod {drive.six_bar.coupler:.4g}, on the {drive.link}",
            "needs": f"{drive.six_bar.motor_torque_max / 1000:.3g} N m, "
            f"rod at {drive.six_bar.transmission_angle_min:.3g}° or more",
            "place": position,
        }
    if isinstance(drive, ToggleDrive):
        holds = "holds" if drive.lock.holds else "does not hold"
        return {
            "drive": f"knee, handle {drive.lock.handle:.4g}, strut {drive.lock.strut:.4g}, on the {drive.link}",
            "needs": f"{holds} {abs(drive.holding[0 if drive.lock.at == 'first' else 1]):.4g} N at its {drive.lock.at} pose",
            "place": position,
        }
    return {
        "drive": f"{drive.name}, on the {drive.link}",
        "needs": f"{drive.peak_force:.4g} N, {drive.peak_force_ratio:.3f} of the least",
        "place": position,
    }


def _pair(point: Any) -> str:
    return f"({point[0]:.0f}, {point[1]:.0f})"


def measure() -> Iterator[dict[str, Any]]:
    """Measure each machine."""
    rows = []
    for name in MACHINES:
        _, found = found_for(name)
        assert found.drives or found.springs, (name, found.refused)
        rows.append({"machine": name, **words(found)})
    yield {"tables": {"machines": rows}}


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the table of docs/drives.md."""
    return report.tables("drive_machines", results["tables"])


def draw(results: dict[str, Any]) -> None:
    """Draw each machine in both end positions and an intermediate position with its curve, five to a picture."""
    names = list(MACHINES)
    for number, page in enumerate((names[:5], names[5:]), 1):
        with figure(f"drives_{number}.png", 2, 5, (17, 6.4)) as (_, panels):
            for k, name in enumerate(page):
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
    """Draw the links in a position."""
    links, body = found.machine.links, found.machine.body
    point = [] if body is None else [body.origin[k]]
    if "rocker" in links and len(links) == 1:
        pins = [drive.curve.pin[k] for drive in found.drives] + [spring.curve.ends[k][1] for spring in found.springs]
        arms = [np.array([links["rocker"].origin[k], complex(*pin)]) for pin in pins]
        return [np.array([links["rocker"].origin[k], *point]), *arms]
    if "slider" in links:
        top = links["coupler"].place(2000j)[k]
        pin = links["crank"].place(520.0)[k]
        return [np.array([links["crank"].origin[k], pin]), np.array([links["slider"].origin[k], top])]
    crank, coupler, rocker = (links[name] for name in ("crank", "coupler", "rocker"))
    plain = machine["linkage"]
    plain = getattr(plain, "linkage", plain)
    c = rocker.place(plain.rocker)[k]
    d = coupler.origin[k]
    return [np.array([crank.origin[k], d]), np.array([rocker.origin[k], c]), np.array([d, c, *point, d])]


def _driving(found: la.Drives, k: int) -> list[Any]:
    """Return the ends of the drives in a position."""
    if found.springs:
        return [spring.curve.ends[k] @ np.array([1, 1j]) for spring in found.springs]
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
    drive = found.drives[0]
    if isinstance(drive, MotorDrive):
        turn = np.abs(drive.six_bar.motor_angle - drive.six_bar.motor_angle[0])
        axes.plot(turn, drive.six_bar.motor_torque / 1000, color=GREEN)
        axes.set_title("motor torque over its turn, N m", fontsize=9)
        return
    axes.plot(x, np.abs(drive.curve.force), color=GREEN)
    bound = drive.bound if isinstance(drive, ActuatorDrive) else None
    if bound is not None:
        axes.axhline(bound, color=RED, ls="--", lw=1.2)
    axes.set_ylim(0, None)
    axes.set_title("force, N" + (" (dashed: no peak is below)" if bound else ""), fontsize=9)


if __name__ == "__main__":
    report.run(measure)
