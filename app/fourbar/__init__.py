"""Queries about linkages over HTTP and on the command line: synthesize, match, function, drive, assembly and exports."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

QUESTIONS = {
    "synthesize": "Find linkages with dimensions and mounting position for a motion of a body.",
    "function": "Find linkages whose output is a prescribed function of the input.",
    "drive": "Find drives, locks and springs for a linkage.",
    "assembly": "Arrange the plates of a linkage in layers so that its parts do not collide.",
    "motion": "Read a table of samples and report how each column was interpreted.",
    "match": "Find the rows of the atlas whose rotation is closest to a prescribed rotation.",
}
"""Line of help of each query. It is stored here so that the help does not import the modules of the queries."""


def worked_example() -> dict[str, Any]:
    """Return the bundled request: the motion of type 45,185 for crank angles 30 to 100 degrees, mounted as in the paper."""
    return json.loads((Path(__file__).parents[1] / "examples" / "worked_example.json").read_text())
