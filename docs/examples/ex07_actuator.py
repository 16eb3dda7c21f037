"""
7. Place a linear actuator
==========================

A flap of 400 mm on a hinge is lifted by 60 degrees against 100 N at its end.
An actuator of 255 mm with 150 mm stroke is at hand: where do its two ends go so that it pushes least?
"""

import linkage_atlas as la

flap = {"pivot": [0, 0], "start": 0, "swing": 60, "length": 400}
actuator = {"kind": "actuator", "retracted": 255, "stroke": 150, "ground_box": [-300, -400, 300, 0], "reach_max": 300}
found = la.drives(rocker=flap, drives=[actuator], load={"force": [0, -100]}, length_unit="mm")
print(found)

# %%
# ``peak_force_ratio`` compares its peak force with the smallest that any actuator of this stroke can have.
drive = found.best("actuator")
print(drive.ground_point, drive.pin, round(drive.peak_force, 1), round(drive.peak_force_ratio, 3))
assert drive.peak_force_ratio < 1.5

found.plot()
