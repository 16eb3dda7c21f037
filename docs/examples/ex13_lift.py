"""
13. A pneumatic lift
====================

A cylinder raises a platform through a triangle of links.
The dimensions are optimised so that the platform rises as evenly as possible, and compared with a published design.
"""

import matplotlib.pyplot as plt

from synthesis.scenes.lift.constrained import optimize, source_limits
from synthesis.scenes.lift.motion import motion
from synthesis.scenes.lift.optimum import Objective, Task
from synthesis.scenes.lift.pose import Cylinder, Design

cylinder = Cylinder(length=220.0, speed=100.0)
task = Task(cylinder, 200.0, 510.0, Objective("normalized"), 600.0)
optimum = optimize(task, source_limits(task))
print(optimum.design)

# %%
# The speed of the platform over its height, for the optimum and for the published design.
published = Design(351.9, 162.8, 351.9, 347.2, 535.8)
figure, ax = plt.subplots()
for name, design in {"optimum": optimum.design, "published": published}.items():
    rise = motion(design, cylinder)
    ax.plot(rise.pose.height, rise.velocity, label=name)
ax.set(xlabel="height of the platform (mm)", ylabel="speed of the platform (mm/s)")
ax.legend()
