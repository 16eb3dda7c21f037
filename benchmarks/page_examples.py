"""Makes the page's examples, app/static/examples.json: five motions that machines need, with a word on each.

Run ``python -m benchmarks.page_examples`` from the project's root; with ``--solve`` it also prints what the search finds.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

FILE = Path(__file__).parents[1] / "app/static/examples.json"


def _rows(values: np.ndarray, digits: int) -> list[Any]:
    return (np.round(values, digits) + 0.0).tolist()


def _request(place: np.ndarray, angle: np.ndarray, **more: Any) -> dict[str, Any]:
    position = _rows(np.column_stack([place.real, place.imag]), 3)
    return {"rotation": _rows(angle, 3), "position": position, **more}


def worked_example() -> dict[str, Any]:
    """The bundled request, digit by digit."""
    return json.loads((Path(__file__).parents[1] / "app/examples/worked_example.json").read_text())


def straight_line() -> dict[str, Any]:
    """A tray that is pushed 120 mm to the side and must stay level."""
    u = np.linspace(0, 1, 13)
    return _request(
        -60 + 120 * u + 0j,
        0 * u,
        crank_span=-45,
        limits={"transmission_angle_min": 30, "pivot_box": [-250, -500, 250, -20], "link_min": 20},
    )


def tipping_bucket() -> dict[str, Any]:
    """The bucket of a loader: lifted level at first, then tipped over the edge of the truck."""
    u = np.linspace(0, 1, 11)
    place = 900 * u - 150 * u**2 + 1j * (300 * u + 380 * u**2)
    return _request(
        place, 10 - 58 * u**2, crank_span=-85, limits={"family": "any", "transmission_angle_min": 25, "link_min": 150}
    )


def landing_gear() -> dict[str, Any]:
    """A main gear: the leg swings 88 degrees inboard, its wheel into the bay under the floor."""
    u = np.linspace(0, 1, 12)
    turn = np.deg2rad(88 * u)
    place = 1250 * np.sin(turn) + 60 * u + 1j * (-1250 * np.cos(turn) - 40 * np.sin(np.pi * u))
    return _request(
        place,
        88 * u,
        crank_span=100,
        limits={
            "family": "any",
            "transmission_angle_min": 30,
            "pivot_box": [-700, -500, 900, 500],
            "link_min": 120,
        },
    )


def carton_folder() -> dict[str, Any]:
    """The flap of a carton is folded by 90 degrees about its crease, slow at both ends, from below the board."""
    t = np.array([0, 16, 28, 38, 47, 55, 63, 72, 82, 94, 110], dtype=float)
    u = t / t[-1]
    turn = np.deg2rad(90 * (1 - np.cos(np.pi * u)) / 2)
    return _request(
        80 * np.exp(1j * turn),
        np.rad2deg(turn),
        crank_angle=(-t).tolist(),
        limits={"transmission_angle_min": 25, "pivot_box": [-150, -260, 300, 0], "link_min": 10},
    )


EXAMPLES = (
    (
        "worked",
        "Worked example",
        "The published worked example: 16 poses over 70° of crank, met to within rounding by a crank-rocker of 19, 72, 144, 165.",
        worked_example,
    ),
    (
        "line",
        "Straight line, constant angle",
        "A tray is pushed 120 mm to the side and must stay level. No four-bar does both exactly: look at what each gives up.",
        straight_line,
    ),
    (
        "bucket",
        "Tipping bucket",
        "A loader's bucket is lifted level at first, then tipped by 58° over the edge of the truck.",
        tipping_bucket,
    ),
    (
        "gear",
        "Landing gear",
        "The leg swings 88° inboard and lays its wheel into the bay; both pivots must lie within the wing's root.",
        landing_gear,
    ),
    (
        "carton",
        "Carton folder",
        "A flap is folded by 90° about its crease, gently at both ends, by a crank that turns on and stays below the board.",
        carton_folder,
    ),
)


def text() -> str:
    """The file's content."""
    rows = [
        json.dumps({"name": name, "title": title, "word": word, "request": make()}, ensure_ascii=False)
        for name, title, word, make in EXAMPLES
    ]
    return "[\n" + ",\n".join(rows) + "\n]\n"


def _solve() -> None:
    from app.fourbar.answers import answer_synthesize
    from app.fourbar.models import SynthesizeRequest
    from app.resources import ServiceResources
    from app.settings import Settings

    resources = ServiceResources(Settings())
    for name, _, _, make in EXAMPLES:
        for budget in (120, 10000):
            request = SynthesizeRequest.model_validate({**make(), "top": 8, "budget_ms": budget})
            reply = answer_synthesize(request, resources)
            print(f"{name}: {reply.status} by {reply.report.stopped_by}, {reply.report.elapsed_ms['total']:.0f} ms")
            for s in reply.solutions[:4]:
                lengths = " ".join(f"{v:.4g}" for v in s.links.model_dump().values())
                print(
                    f"  {s.family:14} {lengths:32} rotation {s.errors.rotation_rms:.3g} position "
                    f"{s.errors.position_rms:.3g} transmission {s.transmission_angle_min:.0f}"
                )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--solve", action="store_true")
    FILE.write_text(text())
    if parser.parse_args().solve:
        _solve()
