"""
12. Compare with a general optimiser
====================================

Is a special search worth it? Differential evolution from scipy gets the same motion and the same kinematics.
"""

import time

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import differential_evolution

import linkage_atlas as la

known = la.FourBar(40, 120, 80, 100, start_angle=50, coupler_point_polar=(60, 30))
crank_angle = np.linspace(0, 120, 12)
target = known.joints(crank_angle)
motion = la.Motion(target.rotation, target.body_point, crank_angle=crank_angle)

# %%
# Our search.
started = time.process_time()
result = la.synthesize(motion, top=1)
ours = result.best.errors.objective
print(f"linkage-atlas: objective {ours:.1e}")
seconds = {"linkage-atlas": time.process_time() - started}
assert ours < 1e-6


# %%
# Differential evolution over nine dimensions: four lengths, start angle, coupler point and pivot A.
# `linkage_atlas.objective` computes the error that the search minimises, for any linkage.
def objective(values: np.ndarray) -> float:
    """Return the error of the motion; 1000 if there is no such linkage."""
    crank, coupler, rocker, ground, start, radius, angle, x, y = values
    try:
        linkage = la.FourBar(
            crank, coupler, rocker, ground, start_angle=start, coupler_point_polar=(radius, angle), pivot_a=(x, y)
        )
    except la.FieldError:
        return 1e3
    return float(np.nan_to_num(la.objective(linkage, motion), nan=1e3))


started = time.process_time()
bounds = [(20, 200)] * 4 + [(0, 360), (0, 150), (-180, 180), (-50, 50), (-50, 50)]
found = differential_evolution(objective, bounds, maxiter=40, popsize=6, rng=0, polish=False)
seconds["differential evolution"] = time.process_time() - started
print(f"differential evolution: objective {found.fun:.3g} after {found.nfev} evaluations")
assert found.fun > ours

figure, ax = plt.subplots()
ax.loglog([seconds["linkage-atlas"]], [ours], "o", label="linkage-atlas")
ax.loglog([seconds["differential evolution"]], [found.fun], "s", label="differential evolution")
ax.set(xlabel="processor time (s)", ylabel="objective")
ax.legend()
