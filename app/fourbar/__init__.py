"""The four-bar's routes and commands: match, synthesize, export."""

SUMMARIES = {
    "synthesize": "Rotation, positions or both: actual dimensions and mounting pose.",
    "function": "Function generation: whose rocker turns as a wanted function of its crank?",
    "match": "Rotation only: which atlas rows, at which start?",
}
"""One line of help of the four-bar's questions, whose modules are imported when they are asked."""
