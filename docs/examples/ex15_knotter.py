"""
15. A knotter
=============

The hook of a baler's knotter must wrap the rope around itself and bite it.
Whether it does depends on the spatial angles of its shafts: each condition has a margin.
A knot is made if all margins are positive.
"""

import matplotlib.pyplot as plt
import numpy as np

from synthesis.scenes.knotter import d_knotter
from synthesis.scenes.knotter.conditions import study

alpha1, alpha3 = np.radians([0, 5, 10, 15, 20]), np.radians([20, 22.5, 25, 27.5, 30])
result = study(d_knotter.mechanism(), {"alpha1": alpha1, "alpha3": alpha3}, [d_knotter.wrap(), d_knotter.bite()])
for first, third, feasible in zip(*(np.degrees(values) for values in result.grid.values()), result.feasible):
    if feasible:
        print(f"alpha1 = {first:g} and alpha3 = {third:g} degrees make a knot")
assert result.feasible.any() and not result.feasible.all()

figure, ax = plt.subplots()
margins = result.margin.reshape(len(alpha1), len(alpha3))
picture = ax.pcolormesh(np.degrees(alpha3), np.degrees(alpha1), margins, cmap="RdYlGn")
figure.colorbar(picture, label="smallest margin")
ax.set(xlabel="alpha3 (degrees)", ylabel="alpha1 (degrees)")
