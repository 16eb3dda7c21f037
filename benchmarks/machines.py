"""Measure chain and knotter as built: pins, groove, powers, wear and tolerances.

The figures contain no times and are the same on every machine, to rounding.
``python -m benchmarks.machines`` fills docs/chain.md and docs/knotter.md in half a minute.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from app.resources import ServiceResources
from app.scenes.chain.tolerance import ChainToleranceRequest, answer_tolerance
from app.scenes.knotter.tolerance import KnotterToleranceRequest
from app.scenes.knotter.tolerance import answer_tolerance as answer_knotter_tolerance
from app.settings import Settings
from benchmarks.report import lines, run
from synthesis.scenes.chain import crescent as chain
from synthesis.scenes.chain.fit import exact_slot, fit_error, fit_slot, power_basis, power_error
from synthesis.scenes.chain.groove import slot_polyarc

DEGREES = (4, 6, 8, 12, 16, 24)
ROLLER = 20.0


def measure_chain() -> dict[str, Any]:
    """Measure the published crescent."""
    _, slot = chain.crescent_slot(131.0, 16, 181.78)
    phases = np.linspace(slot.start, slot.end, 9001)
    exact = exact_slot(slot, phases)
    points = np.concatenate([bend.points_at(np.linspace(0, 1, 9)) for bend in slot_polyarc(slot)])
    path = slot.path(np.linspace(slot.start, slot.end, 20_001))
    start, along = path[:-1], np.diff(path)
    fraction = np.clip(((points[:, None] - start) / along).real, 0, 1)
    rows = []
    for degree in DEGREES:
        fit = fit_slot(slot, degree)
        powers = {f"decimals_{n}": power_error(fit, power_basis(fit, n), exact) for n in (4, 6, None)}
        rows.append({"degree": degree, "normal": fit_error(slot, fit, exact).normal, **powers})
    resources = ServiceResources(Settings())
    return {
        "arcs_error": float(np.abs(points[:, None] - start - fraction * along).min(axis=1).max()),
        "powers": rows,
        "tolerance": answer_tolerance(ChainToleranceRequest(), resources).model_dump(),
    }


def measure_knotter() -> dict[str, Any]:
    """Measure the tolerances of the pair that the source chose."""
    resources = ServiceResources(Settings())
    return {
        "tolerance": answer_knotter_tolerance(KnotterToleranceRequest(), resources).model_dump(),
    }


def chain_blocks(found: dict[str, Any]) -> dict[str, str]:
    """Return the blocks of docs/chain.md."""
    tolerance = found["tolerance"]
    wear = [
        [
            f"{row['pitch_error']:+.3f}",
            f"{row['slack_min'] + 0.0:.3f}".replace("-0.000", "0.000"),
            f"{row['slack_max']:.3f}",
            "yes" if row["stretched"] else "no",
            *("-" if row[name] is None else f"{row[name]:.3f}" for name in ("depth_max", "beyond_slot")),
        ]
        for row in tolerance["wear"][::2]
    ]
    eight = next(row for row in found["powers"] if row["degree"] == 8)
    sensitivity = ", ".join(
        f"{value:+.1f} per mm of the {name.replace('_', ' ')}"
        for name, value in tolerance["tolerance"]["sensitivity"].items()
    )
    return {
        "arcs_error": f"{found['arcs_error']:.0e}",
        "wear": lines(["pitch error", "least slack", "largest slack", "stretched", "depth", "past the slot"], wear),
        "sensitivity": sensitivity,
        "powers": "{:.1e} mm with all digits, {:.1e} with 6 decimals, {:.1e} with 4".format(
            *(eight[f"decimals_{count}"] for count in (None, 6, 4))
        ),
    }


def knotter_blocks(found: dict[str, Any]) -> dict[str, str]:
    """Return the blocks of docs/knotter.md."""
    tolerance = found["tolerance"]
    rows = []
    for name in ("wrap", "clearance", "bite"):
        condition = tolerance[name]
        largest = ", ".join(f"{key} {value:+.2g}" for key, value in list(condition["sensitivity"].items())[:3])
        factor = "-" if condition["factor"] is None else f"{condition['factor']:.1f}"
        rows.append(
            [
                name,
                *(f"{condition[key]:.2f}" for key in ("margin", "corner", "margin_min")),
                f"{100 * condition['share']:.1f}",
                factor,
                largest,
            ]
        )
    head = [
        "condition",
        "margin",
        "worst corner",
        "smallest sample",
        "samples that hold, %",
        "multiple of the tolerances at failure",
        "largest sensitivities, per mm or degree",
    ]
    return {
        "tolerance": lines(head, rows),
    }


def blocks(results: dict[str, Any]) -> dict[str, str]:
    """Return the tables and figures of both documents."""
    chain_part = {f"chain_{name}": text for name, text in chain_blocks(results["chain"]).items()}
    return chain_part | {f"knotter_{name}": text for name, text in knotter_blocks(results["knotter"]).items()}


def measure() -> Iterator[dict[str, Any]]:
    """Measure both machines."""
    found = {"chain": measure_chain(), "knotter": measure_knotter()}
    assert math.isfinite(found["chain"]["arcs_error"])
    yield found


if __name__ == "__main__":
    run(measure)
