"""Times of the scan of an atlas, as JSON: ``python benchmarks/scan_times.py FILE REQUESTS``, by any version's Python.

`benchmarks.retrieval` runs it for this version and for an earlier one, so that both answer the same requests.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from linkage_atlas import atlases
from synthesis.four_bar import coupler_angle
from synthesis.target import Target, make_target

TOP = 10
CLASSES = ((16, 70), (8, 30), (64, 180), (256, 360), (4, 20), (32, 120), (32, 300), (16, 20))
"""Samples and span in degrees."""


def request(samples: int, span: int, seed: int) -> Target:
    """Return the rotation of a random crank-rocker on no lattice."""
    random = np.random.default_rng([samples, span, seed])
    lengths = np.zeros(4)
    while lengths[0] < 0.005 or lengths[0] + lengths[3] >= lengths[1] + lengths[2]:
        lengths = np.sort(random.dirichlet(np.ones(4)))
    crank, start = np.linspace(0, np.deg2rad(span), samples), random.uniform(0, 2 * np.pi)
    angle = coupler_angle(lengths[None], random.choice([1.0, -1.0], 1), (start + crank)[None])[0]
    return make_target(angle, crank_angle=crank)


def measure_scan(scan: Any, requests: int) -> list[dict[str, Any]]:
    """Return processor time (the better of three runs) and number of evaluated windows for each class."""
    rows = []
    for samples, span in CLASSES:
        times, evaluated = [], []
        for seed in range(requests):
            target, runs = request(samples, span, seed), []
            for _ in range(3):
                begin = time.process_time()
                _, found = scan.best(target, TOP)
                runs.append(1000 * (time.process_time() - begin))
            times.append(min(runs))
            evaluated.append(found.evaluated)
        row = {"samples": samples, "span": span, "ms": float(np.median(times)), "max_ms": float(max(times))}
        rows.append(row | {"evaluated": float(np.median(evaluated))})
    return rows


if __name__ == "__main__":
    file = Path(sys.argv[1])
    if hasattr(atlases, "open_atlas"):  # a version with an index beside the file
        atlas = atlases.open_atlas(file)
        atlas.prepare(threads=1)
    else:
        atlas = atlases.load_atlas(file)
    with threadpool_limits(1):
        print(json.dumps(measure_scan(atlas.scan, int(sys.argv[2]))))
