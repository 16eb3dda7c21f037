"""
2. Open a casement window
=========================

A casement window opens by 85 degrees and moves aside.
Its eight poses come from a drawing, both pivots must lie in the frame, and links may be 60 to 500 mm long.
No four-bar makes this motion exactly, so every solution has errors.
"""

import matplotlib.pyplot as plt

import linkage_atlas as la

motion = la.Motion.from_table("../../app/examples/casement.csv", length_unit="mm")
limits = la.Limits(pivot_box=[-100, -250, 400, 150], link_min=60, link_max=500)
result = la.synthesize(motion, limits, top=3)
print(result)

# %%
# The verdict lists every reason against using a linkage, each as a sentence.
best = result.best
print(best.errors_in_words(), best.verdict.works, sep="\n")
assert best.verdict.works
assert best.errors.position_max < 1.0  # mm

# %%
# The pivots A and B lie in the box, and the sash follows the requested poses.
figure, ax = plt.subplots()
motion.plot(ax)
result.linkage.plot(ax)
left, bottom, right, top = -100, -250, 400, 150
ax.add_patch(plt.Rectangle((left, bottom), right - left, top - bottom, fill=False, linestyle=":"))
