"""
5. Generate a function
======================

The rocker of a four-bar is to turn as the logarithm of the crank angle.
The largest error over the whole interval is minimised, as in Freudenstein's tables.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkage_atlas as la

result = la.function(np.log10, 60, interval=(1, 2), output_span=90, objective="max", top=1, curves=True)
print(result)

# %%
# The error curve touches its largest value several times: that is the mark of the best approximation.
best = result.best
assert best.errors.max < 0.05  # degrees

figure, ax = plt.subplots()
ax.plot(best.error_curve.input, best.error_curve.error)
ax.set(xlabel="crank angle (degrees)", ylabel="error of the rocker (degrees)")
