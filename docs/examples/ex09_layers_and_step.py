"""
9. Make parts that do not collide
=================================

Links are plates on pins. Which plate lies in which layer, so that none runs into another?
The layers are proved to be free of collisions over the whole motion, and the parts are written as a STEP file for CAD.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import linkage_atlas as la

motion = la.Motion.from_table("../../app/examples/casement.csv", length_unit="mm")
result = la.synthesize(motion, la.Limits(pivot_box=[-100, -250, 400, 150], link_min=60, link_max=500), top=1)
assembly = result.linkage.assembly()
print(assembly)

# %%
# One file holds all plates and pins.
with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "window.step"
    result.linkage.save(path)
    print(path.name, path.stat().st_size // 1000, "kB")
    assert path.read_text().startswith("ISO-10303-21;")

figure, ax = plt.subplots()
result.linkage.plot(ax, travel=[0])
