"""The chain over HTTP and on the command line: its slot on a crescent or any track, and its slack within tolerances."""

from app.scenes.chain.slot import SLOT, TRACK
from app.scenes.chain.tolerance import TOLERANCE

QUERIES = (SLOT, TRACK, TOLERANCE)
