"""The knotter over HTTP and on the command line: a module for each question, and their common requests and replies."""

from app.scenes.knotter.curves import CURVES
from app.scenes.knotter.needle import NEEDLE
from app.scenes.knotter.scan import SCAN

QUERIES = (CURVES, SCAN, NEEDLE)
