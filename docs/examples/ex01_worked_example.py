"""
1. Recover a linkage from its motion
====================================

The coupler of a four-bar with links 19, 72, 144 and 165 turns while its crank turns by 70 degrees.
This example, published by Sun, Liu and Chu, takes 16 samples of that motion and asks for a linkage that makes it.
A motion that some four-bar makes exactly is recovered to rounding.
"""

import json
from pathlib import Path

import matplotlib.pyplot as plt

import linkage_atlas as la

request = json.loads(Path("../../app/examples/worked_example.json").read_text())
motion = la.Motion(request["rotation"], request["position"], request["crank_span"])
result = la.synthesize(motion, top=1)
print(result)

# %%
# The errors of a solution are recomputed from its own numbers.
best = result.best
print(best.errors.objective)
assert best.errors.objective < 1e-10
assert sorted(result.linkage.links.round(6)) == [19, 72, 144, 165]

# %%
# ``plot`` draws the linkage with the path of its body point, and a motion its requested poses.
figure, ax = plt.subplots()
motion.plot(ax)
result.linkage.plot(ax, travel=[0, 35, 70])
ax.legend()
