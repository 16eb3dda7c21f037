"""Makes the page's examples, app/static/examples.json: six motions that machines need, with a word on each.

Run ``python -m benchmarks.page_examples``; with ``--solve`` it also prints what the search finds.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np

from benchmarks.product import answer, prepared_service
from benchmarks.report import ROOT, Times

FILE = ROOT / "app/static/examples.json"


def motion(place: np.ndarray, angle: np.ndarray, **more: Any) -> dict[str, Any]:
    """A request for positions in the complex plane and angles in degrees, rounded to three digits."""
    position, rotation = ((np.round(values, 3) + 0.0).tolist() for values in (np.c_[place.real, place.imag], angle))
    return {"rotation": rotation, "position": position, **more}


def worked() -> dict[str, Any]:
    """The published worked example: 16 poses over 70° of crank, met to within rounding by a crank-rocker of 19, 72, 144, 165."""
    return json.loads((ROOT / "app/examples/worked_example.json").read_text())


def straight_line() -> dict[str, Any]:
    """A tray is pushed 120 mm to the side and must stay level. No four-bar does both exactly: look at what each gives up."""
    u = np.linspace(0, 1, 13)
    limits = {"transmission_angle_min": 30, "pivot_box": [-250, -500, 250, -20], "link_min": 20}
    return motion(-60 + 120 * u + 0j, 0 * u, crank_span=-45, limits=limits)


def tipping_bucket() -> dict[str, Any]:
    """A loader's bucket is lifted level at first, then tipped by 58° over the edge of the truck."""
    u = np.linspace(0, 1, 11)
    place = 900 * u - 150 * u**2 + 1j * (300 * u + 380 * u**2)
    limits = {"family": "any", "transmission_angle_min": 25, "link_min": 150}
    return motion(place, 10 - 58 * u**2, crank_span=-85, limits=limits)


def landing_gear() -> dict[str, Any]:
    """The leg swings 88° inboard and lays its wheel into the bay; both pivots must lie within the wing's root."""
    u = np.linspace(0, 1, 12)
    turn = np.deg2rad(88 * u)
    place = 1250 * np.sin(turn) + 60 * u + 1j * (-1250 * np.cos(turn) - 40 * np.sin(np.pi * u))
    limits = {"family": "any", "transmission_angle_min": 30, "pivot_box": [-700, -500, 900, 500], "link_min": 120}
    return motion(place, 88 * u, crank_span=100, limits=limits)


def carton_folder() -> dict[str, Any]:
    """A flap is folded by 90° about its crease, gently at both ends, by a crank that turns on and stays below the board."""
    t = np.array([0, 16, 28, 38, 47, 55, 63, 72, 82, 94, 110], dtype=float)
    turn = np.deg2rad(90 * (1 - np.cos(np.pi * t / t[-1])) / 2)
    limits = {"transmission_angle_min": 25, "pivot_box": [-150, -260, 300, 0], "link_min": 10}
    return motion(80 * np.exp(1j * turn), np.rad2deg(turn), crank_angle=(-t).tolist(), limits=limits)


def casement() -> dict[str, Any]:
    """A sash opens by 85° and moves aside on the way. Only its eight poses count: the search finds crank angles for them."""
    place = [300, 296 - 43j, 287 - 87j, 271 - 133j, 247 - 178j, 212 - 222j, 165 - 263j, 104 - 297j]
    angle = [0, -8.3, -17.8, -28.4, -40.3, -53.5, -68.2, -85]
    limits = {"family": "any", "transmission_angle_min": 35}
    return motion(np.array(place), np.array(angle), timing="free", limits=limits)


EXAMPLES = {
    "worked": ("Worked example", worked),
    "line": ("Straight line, constant angle", straight_line),
    "bucket": ("Tipping bucket", tipping_bucket),
    "gear": ("Landing gear", landing_gear),
    "carton": ("Carton folder", carton_folder),
    "casement": ("Casement window, crank angles free", casement),
}
"""Title and request of each; the request's docstring is the word that the page shows."""


def examples() -> list[dict[str, Any]]:
    """Name, title, word and request of each."""
    return [
        {"name": name, "title": title, "word": request.__doc__, "request": request()}
        for name, (title, request) in EXAMPLES.items()
    ]


def text() -> str:
    """The file's content."""
    return "[\n" + ",\n".join(json.dumps(one, ensure_ascii=False) for one in examples()) + "\n]\n"


def main() -> None:
    """Write the file; print solutions if asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solve", action="store_true")
    FILE.write_text(text())
    if parser.parse_args().solve:
        resources, times = prepared_service(), Times()
        for one in examples():
            for budget in (120, 10000):
                reply = answer({**one["request"], "top": 8, "budget_ms": budget}, resources, times)
                stopped, milliseconds = reply["report"]["stopped_by"], 1000 * times.wall[-1]
                print(f"{one['name']}: {reply['status']} by {stopped}, {milliseconds:.0f} ms")
                for found in reply["solutions"][:4]:
                    lengths = " ".join(f"{value:.4g}" for value in found["links"].values())
                    errors = " {rotation_rms:.3g} position {position_rms:.3g}".format_map(found["errors"])
                    angle = found["transmission_angle_min"]
                    print(f"  {found['family']:14} {lengths:32} rotation{errors} transmission {angle:.0f}")


if __name__ == "__main__":
    main()
