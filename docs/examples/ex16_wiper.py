"""
16. Move a wiper with a motor that keeps turning
================================================

A wiper swings by 90 degrees, to and fro.
A motor that keeps turning drives it through a rod.
The search finds the position of the motor and the lengths of its crank and rod.
At both ends of its swing the wiper rests for a moment: a dwell.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkage_atlas as la

wiper = {"pivot": [0, 0], "start": 45, "swing": 90, "length": 400}
motor = {"kind": "dyad", "motor_box": [-200, -200, 200, 0], "pin_radius": 60}
found = la.drives(rocker=wiper, drives=[motor], length_unit="mm")
print(found)

# %%
# The motor's linkage is a four-bar whose rocker is the wiper.
drive = found.drives[0]
joints = drive.six_bar.joints
four_bar = la.Linkage.from_points(joints["M"], joints["K"], joints["Q"], joints["B"])
print(four_bar)
before, after = drive.six_bar.dwell
print(
    f"while the motor turns by {before:.0f} and {after:.0f} degrees, the wiper stays within 1 % of its swing at each end"
)
assert drive.six_bar.kind == "crank_rocker"

# %%
# The angle of the wiper over a turn of the motor.
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4))
four_bar.plot(left, [0, 90, 180, 270])
turn = np.asarray(drive.six_bar.motor_angle)
right.plot(turn - turn[0], drive.six_bar.crank_angle)
right.set(xlabel="angle of the motor (degrees)", ylabel="angle of the wiper (degrees)")
