"""
8. Hold a flap with a gas spring
================================

A flap of 5 kg opens upwards by 80 degrees.
A gas spring from the catalogue is to keep it open and shut, and the hand is to need little force.
"""

import matplotlib.pyplot as plt

import linkage_atlas as la

flap = {"pivot": [0, 0], "start": -80, "swing": 80, "length": 500}
load = {"masses": [{"link": "body", "mass": 5, "centre": [0, 0]}]}
spring = {"kind": "gas", "between": ["ground", "rocker"]}
found = la.drives(rocker=flap, drives=[{"kind": "rotary"}], load=load, springs=[spring], length_unit="mm")
print(found)

# %%
# The torque at the hinge, without and with the spring.
best = found.springs[0]
figure, ax = plt.subplots()
ax.plot(found.torque.crank_angle, found.torque.torque, label="without spring")
ax.plot(best.curve.crank_angle, best.curve.torque, label="with spring")
ax.set(xlabel="opening (degrees)", ylabel="torque at the hinge (N mm)")
ax.legend()
assert max(abs(best.curve.torque)) < max(abs(found.torque.torque))
