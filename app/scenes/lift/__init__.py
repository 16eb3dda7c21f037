"""The lift over HTTP and on the command line: its motion, and its optimum design."""

from app.scenes.lift.motion import MOTION
from app.scenes.lift.optimum import OPTIMIZE

QUERIES = (MOTION, OPTIMIZE)
