"""Pictures of docs/chain.md."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from benchmarks import figures
from synthesis.scenes.chain.crescent import Crescent
from synthesis.scenes.chain.slot import Slot


def plot(axes: Any, points: np.ndarray, *style: Any, **options: Any) -> None:
    axes.plot(points.real, points.imag, *style, **options)


def draw_slot(axes: Any, slot: Slot, phase: float, size: float) -> np.ndarray:
    """Draw track, chain and slot, and return the pins."""
    track, pins = slot.chain.track, slot.pins(np.array([phase]))[0]
    outline = track.points(track.locate(np.linspace(0, track.total, 2000)))
    plot(axes, outline, color=figures.GREY, lw=5, alpha=0.45)
    plot(axes, np.append(pins, pins[0]), "o-", color=figures.INK, lw=1.3, ms=size, mfc="white", zorder=3)
    plot(axes, slot.path(np.linspace(slot.start, slot.end, 400)), color=figures.RED, lw=2.2, zorder=4)
    plot(axes, pins[[slot.free - 1]], "o", ms=size + 1, color=figures.RED, zorder=5)
    figures.bare(axes)
    return pins


def draw_track(crescent: Crescent, slot: Slot) -> None:
    """Draw track, chain and slot, and an enlarged slot with the walls for a roller."""
    r1 = crescent.upper_radius
    c, b = r1 + crescent.wheel_radius, crescent.eccentricity
    with figures.figure("chain_track.png", 2, 1, (9.2, 9.4), height_ratios=[1.45, 1]) as (_, (top, zoom)):
        pins = draw_slot(top, slot, slot.start + 0.5235 * slot.chain.period, 5.0)
        for index, pin in enumerate(pins):
            upper = abs(pin.real) < 1.05 * r1 and -200 < pin.imag < 60
            away = -pin if upper else pin + 60j
            away *= 16 / abs(away)
            colour = figures.RED if index == slot.free - 1 else figures.INK
            style = {"ha": "center", "va": "center", "fontsize": 8, "color": colour}
            figures.note(top, f"P{index + 1}", (pin.real, pin.imag), (away.real, away.imag), **style)
        for point, name in ((0, "O1"), (1j * b, "O2"), (-c, "C left"), (c, "C right")):
            point = complex(point)
            top.plot(point.real, point.imag, "+", color=figures.INK, ms=9)
            figures.note(top, name, (point.real, point.imag), (7, 5), fontsize=8.5)
        for centre, degrees, radius, name in (
            (0, -35, r1, "R1"),
            (1j * b, -107, crescent.lower_radius, "R2"),
            (-c, 128, crescent.wheel_radius, "R0"),
        ):
            end = centre + radius * np.exp(1j * math.radians(degrees))
            start, label = complex(centre), centre + 0.55 * (end - centre)
            figures.arrow(top, (start.real, start.imag), (end.real, end.imag))
            box = {"fc": "white", "ec": "none", "pad": 1.2}
            top.text(label.real, label.imag, f"{name} = {radius:.3f}", fontsize=8.5, ha="center", bbox=box)
        top.set_title(f"Track (grey), chain of {slot.chain.links} links and compensation slot (red), mm")
        plot(
            zoom,
            -1j * r1 * np.exp(1j * np.linspace(-0.42, 0.42, 300)),
            color=figures.GREY,
            label="bare upper arc, R1",
        )
        phases = np.linspace(slot.start, slot.end, 400)
        path, normals = slot.path(phases), slot.normals(phases)
        plot(zoom, path, color=figures.RED, label="slot of the free pin")
        for sign, name in ((1, "walls for a 20 mm roller"), (-1, None)):
            plot(zoom, path + 20 * sign * normals, color=figures.BLUE, lw=1, ls="--", label=name)
        crossings = slot.path(np.array([crossing.phase for crossing in slot.crossings]))
        plot(zoom, crossings, "D", ms=4.5, color=figures.INK, label="a pin passes a joint: curvature jumps")
        zoom.set(aspect="equal", xlim=(-92, 92), ylim=(-212, -142))
        zoom.legend(loc="upper center", bbox_to_anchor=(0.5, -0.08), ncols=2)


def draw_defect(crescent: Crescent, slot: Slot) -> None:
    """Draw closure defect, depth and curvature over a period."""
    phases, unit = np.linspace(slot.start, slot.end, 1200), crescent.wheel_radius * math.radians(1)
    with figures.figure("chain_defect.png", 3, 1, (8.4, 7.6), sharex=True) as (drawing, (defect, depth, curvature)):
        defect.plot(phases / unit, np.degrees(slot.slack(phases) / crescent.upper_radius), color=figures.INK)
        defect.set(ylabel="closure defect, deg", ylim=(-0.06, 1.32))
        depth.plot(phases / unit, slot.depth(phases), color=figures.RED)
        depth.set_ylabel("depth of the slot, mm")
        for a, b in zip(slot.breaks[:-1], slot.breaks[1:]):
            inner = np.linspace(a + 1e-6, b - 1e-6, 300)
            curvature.plot(inner / unit, slot.curvature(inner), color=figures.BLUE)
        curvature.set(ylabel="curvature of the slot, 1/mm", xlabel="theta1, deg")
        names = ("left wheel", "lower arc", "right wheel", "upper arc")
        for crossing in slot.crossings:
            for axes in (defect, depth, curvature):
                axes.axvline(crossing.phase / unit, color=figures.GREY, lw=0.8, ls=":")
            label, box = f"P{crossing.pin} onto {names[crossing.segment]}", {"fc": "white", "ec": "none", "pad": 1}
            defect.text(crossing.phase / unit, 1.2, label, fontsize=8, ha="center", bbox=box)
        drawing.suptitle("One period: the chain fits the bare track at its two ends only")
