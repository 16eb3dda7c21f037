"""
14. A chain on a U-shaped slide
===============================

A chain of 16 rigid links runs around two wheels and along a slide.
It fits the bare slide only at the ends of a period; in between, a free pin must move into a slot.
The slot is computed so that all links keep their length at every phase.
"""

import matplotlib.pyplot as plt

from synthesis.scenes.chain.crescent import Dimensions
from synthesis.scenes.chain.slot import analyse_slot, crescent_slot

crescent, slot = crescent_slot(Dimensions(pitch=131.0, links=16, upper_radius=181.78))
phases = slot.phases(91)
report = analyse_slot(slot, phases)
print(f"depth of the slot {report.depth_max:.3f} mm, smallest radius {report.radius_min:.1f} mm")
print(
    f"links stay {report.chord_error:.1e} mm within their length; loose without the slot: {report.slack_max.value:.3f} mm"
)
assert report.chord_error < 1e-9

# %%
# The chain in the middle of a period, with the path of its free pin in red.
pins = slot.pins(phases[45:46])[0]
path = slot.path(phases)
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
left.plot(pins.real, pins.imag, "o-")
left.plot(path.real, path.imag, "r")
left.set_aspect("equal")
right.plot(phases - slot.start, slot.depth(phases), "r")
right.set(xlabel="travel of the chain (mm)", ylabel="depth of the slot (mm)")
