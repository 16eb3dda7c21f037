"""
3. Find the best lid among infinitely many
==========================================

Three poses are met exactly by infinitely many four-bars.
The search samples them, drops those that lock or leave the pivot box, and ranks the others by size, transmission angle and swing.
"""

import matplotlib.pyplot as plt

import linkage_atlas as la

poses = la.Motion(rotation=[0, 15, 40], position=[[0, 0], [40, 8], [75, 30]])
result = la.synthesize(poses, la.Limits(pivot_box=[-30, -30, 100, 60]), top=6)
for solution in result:
    print(
        solution.linkage.links.round(1), round(solution.transmission_angle_min, 1), f"{solution.errors.objective:.1e}"
    )

# %%
# All six are exact; they differ in size, and in how well they transmit force.
assert all(solution.errors.objective < 1e-9 for solution in result)

figure, axes = plt.subplots(2, 3, figsize=(9, 6))
for ax, solution in zip(axes.flat, result):
    poses.plot(ax)
    solution.linkage.plot(ax)
    ax.set_title(f"{solution.transmission_angle_min:.0f}° transmission angle", fontsize="small")
figure.tight_layout()
