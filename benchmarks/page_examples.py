"""Make the examples of the page, app/static/examples.json: eight machines and four motions, with a short explanation each.

With ``python -m benchmarks.page_examples --solve`` it also searches and stores the results with their errors, which the
page shows at once. Without ``--solve`` the stored results of unchanged requests remain.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np

from benchmarks.product import answer, prepared_service
from benchmarks.report import ROOT, Times

FILE = ROOT / "app/static/examples.json"
BUDGET_MS = 8000
"""Time limit of the search for each example."""
STORED = 3
"""Linkages of each example that are stored."""
DIGITS = 9
"""Digits of the stored numbers."""
SHOWN = (
    "rank has_smallest_error source links branch start_angle body_offset mount errors crank_angle verdict excursion size "
    "family transmission_angle_min transmission_angle_min_turn determination"
).split()
"""Fields of a solution that the page shows,"""
REPORTED = ("elapsed_ms", "trace", "stopped_by", "length_scale", "notes")
"""and of a report."""
PRACTICAL = {"preset": "practical", "family": "any"}


def motion(position: Any, angle: Any = None, **more: Any) -> dict[str, Any]:
    """A request for positions in the complex plane and angles in degrees, rounded to three digits."""
    position = np.asarray(position, dtype=complex)
    request = {"position": (np.round(np.c_[position.real, position.imag], 3) + 0.0).tolist()}
    if angle is not None:
        request = {"rotation": (np.round(angle, 3) + 0.0).tolist()} | request
    return {**request, **more}


def free(position: Any, angle: Any = None, limits: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
    """A motion with free crank angles within practical limits, and such of its own; answers are to be different mechanisms."""
    return motion(position, angle, timing="free", **more, limits={**PRACTICAL, **(limits or {})}, diverse=True, top=8)


# -- machines ---------------------------------------------------------------------------------------------------------


def casement() -> dict[str, Any]:
    """A sash opens by 85° and moves aside on the way. Both pivots lie in the frame's box, links are 60 to 500 mm."""
    position = [300, 296 - 43j, 287 - 87j, 271 - 133j, 247 - 178j, 212 - 222j, 165 - 263j, 104 - 297j]
    angle = [0, -8.3, -17.8, -28.4, -40.3, -53.5, -68.2, -85]
    return free(position, angle, {"pivot_box": [-100, -250, 400, 150], "link_min": 60, "link_max": 500})


def wiper() -> dict[str, Any]:
    """The blade of a bus's wiper sweeps 76° of the windscreen and leans by no more than 14° at either end."""
    turn = np.deg2rad(np.linspace(128, 52, 9))
    box = {"pivot_box": [-200, -160, 200, 60], "link_max": 800}
    return free(700 * np.exp(1j * turn), np.linspace(14, -14, 9), box)


def bucket() -> dict[str, Any]:
    """A loader's bucket is lifted level at first, then tipped by 58° over the edge of the truck."""
    u = np.linspace(0, 1, 8)
    box = {"pivot_box": [-500, -500, 700, 900]}
    return free(900 * u - 150 * u**2 + 1j * (300 * u + 380 * u**2), 10 - 58 * u**2, box)


def hood() -> dict[str, Any]:
    """A car's hood opens by 58°, while its rear edge rises by 90 mm to clear the windscreen; pivots lie behind it."""
    u = np.linspace(0, 1, 7)
    position = -40 * u + 90j * u + 450 * np.exp(1j * np.deg2rad(180 - 58 * u))
    return free(position, -58 * u, {"pivot_box": [-250, -350, 250, 60]})


def film() -> dict[str, Any]:
    """A claw pulls 35 mm film down by 19 mm, a straight stroke, and goes back around: a closed path without angles."""
    down = 1j * np.linspace(9.5, -9.5, 9)
    back = np.deg2rad(np.linspace(-90, 90, 9))[1:-1]
    return free([*down, *(8 * np.cos(back) + 9.5j * np.sin(back))], limits={"family": "crank_rocker"}, closed=True)


def leg() -> dict[str, Any]:
    """The foot of a walking machine: 120 mm level on the ground, then back through the air; the crank turns on."""
    lift = np.deg2rad(np.linspace(180, 0, 8))[1:-1]
    foot = [*np.linspace(60, -60, 9), *(60 * np.cos(lift) + 32j * np.sin(lift))]
    return free(foot, limits={"family": "crank_rocker"}, closed=True)


def flap() -> dict[str, Any]:
    """A wing's flap runs back by 260 mm before it turns down by 38°; both pivots lie below the wing."""
    u = np.linspace(0, 1, 7)
    return free(260 * u - 1j * (30 * u + 80 * u**2), -38 * u**1.6, {"pivot_box": [-250, -400, 450, -20]})


def pick() -> dict[str, Any]:
    """A gripper lifts a part off a belt, turns it by 90° and sets it down 390 mm further on."""
    position = [0, 30 + 80j, 150 + 160j, 300 + 150j, 380 + 60j, 390]
    return free(position, [0, 8, 35, 65, 85, 90], {"pivot_box": [-100, -400, 500, 400]})


# -- motions with crank angles, to compare with -------------------------------------------------------------------------


def worked() -> dict[str, Any]:
    """The published worked example: 16 poses over 70° of crank, met to within rounding by a crank-rocker of 19, 72, 144, 165."""
    return json.loads((ROOT / "app/examples/worked_example.json").read_text())


def straight_line() -> dict[str, Any]:
    """A tray is pushed 120 mm to the side and must stay level. No four-bar does both exactly: look at what each gives up."""
    u = np.linspace(0, 1, 13)
    limits = {"transmission_angle_min": 30, "pivot_box": [-250, -500, 250, -20], "link_min": 20}
    return motion(-60 + 120 * u + 0j, 0 * u, crank_span=-45, limits=limits)


def landing_gear() -> dict[str, Any]:
    """The leg swings 88° inboard and lays its wheel into the bay; both pivots must lie within the wing's root."""
    u = np.linspace(0, 1, 12)
    turn = np.deg2rad(88 * u)
    position = 1250 * np.sin(turn) + 60 * u + 1j * (-1250 * np.cos(turn) - 40 * np.sin(np.pi * u))
    limits = {"family": "any", "transmission_angle_min": 30, "pivot_box": [-700, -500, 900, 500], "link_min": 120}
    return motion(position, 88 * u, crank_span=100, limits=limits)


def carton_folder() -> dict[str, Any]:
    """A flap is folded by 90° about its crease, gently at both ends, by a crank that turns on and stays below the board."""
    t = np.array([0, 16, 28, 38, 47, 55, 63, 72, 82, 94, 110], dtype=float)
    turn = np.deg2rad(90 * (1 - np.cos(np.pi * t / t[-1])) / 2)
    limits = {"transmission_angle_min": 25, "pivot_box": [-150, -260, 300, 0], "link_min": 10}
    return motion(80 * np.exp(1j * turn), np.rad2deg(turn), crank_angle=(-t).tolist(), limits=limits)


MACHINES = {
    "casement": ("Casement window", casement),
    "wiper": ("Windscreen wiper", wiper),
    "bucket": ("Tipping bucket", bucket),
    "hood": ("Hood hinge", hood),
    "film": ("Film advance", film),
    "leg": ("Walking leg", leg),
    "flap": ("Wing flap", flap),
    "pick": ("Pick and place", pick),
}
OTHER_MOTIONS = {
    "worked": ("Worked example", worked),
    "line": ("Straight line, constant angle", straight_line),
    "gear": ("Landing gear", landing_gear),
    "carton": ("Carton folder", carton_folder),
}
"""Title and request of each; the request's docstring is the word that the page shows."""


def examples() -> list[dict[str, Any]]:
    """Name, title, word and request of each, and whether it is one of the machines."""
    return [
        {"name": name, "title": title, "word": request.__doc__, "machine": name in MACHINES, "request": request()}
        for name, (title, request) in (MACHINES | OTHER_MOTIONS).items()
    ]


UNUSED = {"verdict": ("practical_without_collisions", "assembly")}
"""Fields of a solution that the page does not read before it has looked for layers."""


def rounded(value: Any) -> Any:
    """A part of a reply with numbers of `DIGITS` digits."""
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    if isinstance(value, dict):
        return {name: rounded(part) for name, part in value.items()}
    return [rounded(part) for part in value] if isinstance(value, list) else value


def stored(reply: dict[str, Any]) -> dict[str, Any]:
    """The parts of a reply that the page shows."""
    solutions = [{name: solution.get(name) for name in SHOWN} for solution in reply["solutions"][:STORED]]
    for solution in solutions:
        solution["determination"] = {name: solution["determination"][name] for name in ("ill_posed", "active_limits")}
        for part, names in UNUSED.items():
            solution[part] = {name: value for name, value in solution[part].items() if name not in names}
    report = {name: reply["report"][name] for name in REPORTED}
    report["elapsed_ms"] = {"total": round(report["elapsed_ms"]["total"])}
    report["trace"] = [[round(ms), float(f"{objective:.4g}")] for ms, objective in report["trace"]]
    return rounded({"status": reply["status"], "solutions": solutions, "report": report})


def text(found: dict[str, Any]) -> str:
    """The file's content, with replies by the example's name."""
    rows = [example | {"reply": found.get(example["name"])} for example in examples()]
    return "[\n" + ",\n".join(json.dumps(row, ensure_ascii=False, separators=(",", ":")) for row in rows) + "\n]\n"


def stored_replies() -> dict[str, Any]:
    """Return the stored results of requests that are unchanged."""
    requests = {example["name"]: example["request"] for example in examples()}
    return {
        row["name"]: row.get("reply")
        for row in json.loads(FILE.read_text())
        if requests.get(row["name"]) == row["request"]
    }


def main() -> None:
    """Write the file; with ``--solve`` search, store the replies and print the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solve", nargs="*", metavar="NAME", help="search these, or all")
    names = parser.parse_args().solve
    found = stored_replies()
    if names is not None:
        resources, times = prepared_service(), Times()
        for example in examples():
            if names and example["name"] not in names:
                continue
            reply = answer({"top": 8, **example["request"], "budget_ms": BUDGET_MS}, resources, times)
            found[example["name"]] = stored(reply)
            report = reply["report"]
            print(
                f"{example['name']}: {reply['status']} by {report['stopped_by']}, {report['elapsed_ms']['total']:.0f} ms"
            )
            for solution in reply["solutions"][:STORED]:
                lengths = " ".join(f"{value:.4g}" for value in solution["links"].values())
                errors, angle = solution["errors"], solution["transmission_angle_min"]
                rotation = "" if errors["rotation_max"] is None else f" rotation {errors['rotation_max']:.3g}"
                print(
                    f"  {solution['family']:14} {lengths:32}{rotation} position {errors['position_max']:.3g} transmission "
                    f"{angle:.0f} {'; '.join(solution['verdict']['reasons'])}"
                )
    FILE.write_text(text(found))


if __name__ == "__main__":
    main()
