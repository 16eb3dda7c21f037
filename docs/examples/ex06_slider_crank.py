"""
6. Drive a slider
=================

A slider-crank is one of the linkages with a rail or a slot; every method of a four-bar works for it too.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkage_atlas as la

pump = la.SliderCrank(30, 100, offset=10)
print(pump)

# %%
# Positions, and velocities at 360 degrees per second.
turn = np.linspace(0, 360, 181)
slider = pump.joints(turn).coupler_pin
print("stroke", np.ptp(slider[:, 0]).round(3))
assert np.isclose(np.ptp(slider[:, 0]), np.sqrt(130**2 - 10**2) - np.sqrt(70**2 - 10**2), atol=1e-2)

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
pump.plot(left, [40, 140, 240])
right.plot(turn, slider[:, 0])
right.set(xlabel="crank angle (degrees)", ylabel="position of the slider")
