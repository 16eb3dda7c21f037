"""
4. Guide a point along a straight line
======================================

A path without crank angles: only the points are given, and the search finds when the crank passes each of them.
"""

import matplotlib.pyplot as plt
import numpy as np

import linkage_atlas as la

line = la.Motion(position=np.column_stack([np.linspace(0, 100, 11), np.zeros(11)]))
result = la.synthesize(line, top=1)
print(result)

# %%
# Between the samples the point leaves the line by little more than at the samples.
linkage, crank_angle = result.linkage, result.best.crank_angle
along = linkage.joints(np.linspace(crank_angle[0], crank_angle[-1], 201)).body_point
print(f"largest distance from the line: {np.abs(along[:, 1]).max():.4f} of 100")
assert np.abs(along[:, 1]).max() < 0.2

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4))
line.plot(left)
linkage.plot(left)
right.plot(along[:, 0], along[:, 1])
right.set(xlabel="x", ylabel="distance from the line")
