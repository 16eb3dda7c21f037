"""The four-bar's questions over HTTP and on the command line: match, synthesize, function, drives, and files of finds."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

QUESTIONS = {
    "synthesize": "Rotation, positions or both: actual dimensions and mounting pose.",
    "function": "Function generation: whose rocker, crank or slider moves as a wanted function of the input?",
    "drive": "What moves a linkage: rotary drives, cylinders, motors that turn on, locks and springs.",
    "assembly": "Plates in layers: can a linkage be built so that its parts pass one another, and how far does it move?",
    "motion": "How is a table of samples read: which column is what, in which unit?",
    "match": "Rotation only: which atlas rows, at which start?",
}
"""One line of help of each question; their modules are imported when they are asked."""


def worked_example() -> dict[str, Any]:
    """The bundled request: the motion of type 45,185 over crank 30 to 100 degrees, mounted as in the paper."""
    return json.loads(files("app").joinpath("examples/worked_example.json").read_text())
